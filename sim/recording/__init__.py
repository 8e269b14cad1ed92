# SPDX-License-Identifier: Apache-2.0
"""Datasets: an episode is one ROS 2 bag beside the recipe that makes it again."""
