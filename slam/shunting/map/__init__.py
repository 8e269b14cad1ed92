# SPDX-License-Identifier: Apache-2.0
"""The map of the shunting SLAM: neurons on a grid, Eq. (8), how it is written, saved and shown."""
