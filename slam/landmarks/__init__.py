# SPDX-License-Identifier: Apache-2.0
"""Point landmarks: the filter over pose and landmarks, and data association."""
