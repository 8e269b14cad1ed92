# SPDX-License-Identifier: Apache-2.0
"""``mobilia tune``: numbers of a SLAM searched on training seeds, judged on fresh ones."""
