# SPDX-License-Identifier: Apache-2.0
"""What is read off the network of the shunting SLAM: its peaks, and its rasters."""
