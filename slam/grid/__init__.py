# SPDX-License-Identifier: Apache-2.0
"""The ordinary occupancy grid: what the map of the shunting SLAM is measured against."""

from slam.grid.occupancy import OccupancySlam

__all__ = ["OccupancySlam"]
