# SPDX-License-Identifier: Apache-2.0
"""What ways are planned on: the scene's static layout, or the map that the SLAM has so far.

Both are grids in the world frame, reached through the known start; where the robot is on them is
what its SLAM believes.
"""

from __future__ import annotations

import numpy as np

from scenes.scene import Scene
from sim.driving.drive import TourConfig
from sim.driving.navgrid import NavGrid
from slam import se2
from slam.frames import Float
from slam.system import Raster

MARGIN_M = 1.0  # of floor round what is known
OCCUPIED = 0.5  # cells of a map above this are walls
# A pose estimate may be wrong by this before a wall of the layout stops a robot whose scanner sees
# the floor free.
SLACK_M = 0.15
_KEPT_BACK_M = 0.05  # planned ways come this much nearer to walls than the driver does


class LayoutPlanner:
    """Walls and furniture as the architect drew them."""

    def __init__(self, scene: Scene, tour: TourConfig) -> None:
        xmin, ymin, xmax, ymax = scene.bounds
        bounds = (xmin - MARGIN_M, ymin - MARGIN_M, xmax + MARGIN_M, ymax + MARGIN_M)
        self._grid = NavGrid(bounds, scene.obstacles, tour.robot_radius_m - _KEPT_BACK_M)
        self._walls = self._grid.with_boxes(np.zeros((0, 5)))
        self._walls.clearance += SLACK_M

    def grids(self, raster: Raster | None, places: Float) -> tuple[NavGrid, NavGrid]:
        """The plan, and the walls that stop the robot whatever it sees.

        The SLAM's map, and the ``places`` that must be on the plan, do not matter here.
        """
        return self._grid, self._walls


class MapPlanner:
    """The SLAM's own map; what it has not seen counts as free."""

    def __init__(self, T_world_map: Float, tour: TourConfig) -> None:
        self._T_world_map, self._radius = T_world_map, tour.robot_radius_m - _KEPT_BACK_M

    def grids(self, raster: Raster | None, places: Float) -> tuple[NavGrid, NavGrid]:
        """The plan on the map as it is, and no walls: only what is seen stops the robot.

        ``places`` (n, 2) m must lie on it.
        """
        corners = places
        boxes = np.zeros((0, 5))
        if raster is not None and raster.values.size:
            boxes = self._boxes(raster)
            corners = np.concatenate([places, boxes[:, :2]])
        low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
        bounds = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
        plan = NavGrid(bounds, boxes, self._radius)
        return plan, NavGrid(bounds, np.zeros((0, 5)), self._radius)

    def _boxes(self, raster: Raster) -> Float:
        """(n, 5) occupied cells as boxes in the world."""
        rows, columns = np.nonzero(np.nan_to_num(raster.values) > OCCUPIED)
        step = raster.resolution_m
        cells = np.column_stack([(columns + 0.5) * step, (rows + 0.5) * step])
        T_world_raster = se2.compose(self._T_world_map, raster.T_map_origin)
        boxes = np.empty((len(cells), 5))
        boxes[:, :2] = se2.transform(T_world_raster, cells)
        boxes[:, 2:4] = 0.5 * step
        boxes[:, 4] = T_world_raster[2]
        return boxes
