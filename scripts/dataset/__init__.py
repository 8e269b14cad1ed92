# SPDX-License-Identifier: Apache-2.0
"""What ``mobilia generate`` does: the episodes that a dataset lacks, and a table of what it has."""
