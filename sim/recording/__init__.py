# SPDX-License-Identifier: Apache-2.0
"""Datasets: an episode is one ROS 2 bag beside the recipe that makes it again."""

MINARI = "minari"  # ``Plan.format`` of a dataset without bags, and what it is written as
