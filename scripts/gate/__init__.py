# SPDX-License-Identifier: Apache-2.0
"""Has a SLAM got worse? Its runs against saved ones of the same recordings, as few as it takes."""
