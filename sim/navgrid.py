# SPDX-License-Identifier: Apache-2.0
"""Where a disc can drive in a static layout, and how far it is from there to a goal."""

from __future__ import annotations

import heapq
import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slam._jit import njit
from slam.frames import Float

_FAR = 1e6


class NavGrid:
    """Clearance and cost-to-go on a grid; row 0 is the lowest y, (x0, y0) its lower left corner.

    A cell that a box touches is blocked, so thin walls have no holes and clearance is at most one
    cell too small, never too large.

    bounds     xmin, ymin, xmax, ymax of the floor, m; outside counts as wall
    obstacles  (n, 5) boxes: centre x, y, half sizes (m), yaw (rad)
    radius     m, the disc's; cells nearer than this to an obstacle cannot be entered
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        obstacles: Float,
        radius: float,
        cell: float = 0.1,
    ) -> None:
        self.cell = cell
        self.x0, self.y0 = bounds[0], bounds[1]
        columns = math.ceil((bounds[2] - bounds[0]) / cell)
        rows = math.ceil((bounds[3] - bounds[1]) / cell)
        boxes = np.ascontiguousarray(obstacles, dtype=np.float64).reshape(-1, 5)
        blocked = np.zeros((rows + 2, columns + 2), dtype=np.bool_)  # one ring of wall around it
        blocked[0], blocked[-1], blocked[:, 0], blocked[:, -1] = True, True, True, True
        _rasterise(blocked[1:-1, 1:-1], boxes, self.x0, self.y0, cell)
        distance = ndimage.distance_transform_edt(~blocked)[1:-1, 1:-1]
        self.clearance: Float = np.ascontiguousarray((distance - 0.5) * cell)
        self._passable = self.clearance > radius
        self._costs: dict[tuple[float, float], Float] = {}

    def lookup(self, field: Float, x: float, y: float) -> float:
        """``field`` in the cell of (x, y); 1e6 outside."""
        i, j = math.floor((y - self.y0) / self.cell), math.floor((x - self.x0) / self.cell)
        inside = 0 <= i < field.shape[0] and 0 <= j < field.shape[1]
        return float(field[i, j]) if inside else _FAR

    def cost_to(self, goal: Float) -> Float:
        """Cost of the best way to ``goal`` from every cell: metres, dearer close to walls.

        1e6 where there is no way. Computed once per goal.
        """
        key = (float(goal[0]), float(goal[1]))
        if key not in self._costs:
            i = math.floor((key[1] - self.y0) / self.cell)
            j = math.floor((key[0] - self.x0) / self.cell)
            self._costs[key] = _cost_to(self._passable, self.clearance, i, j, self.cell)
        return self._costs[key]


@njit
def _rasterise(
    blocked: NDArray[np.bool_], boxes: NDArray[np.float64], x0: float, y0: float, cell: float
) -> None:
    for k in range(boxes.shape[0]):
        cx, cy, hx, hy, yaw = boxes[k]
        c, s = math.cos(yaw), math.sin(yaw)
        reach = math.sqrt(hx * hx + hy * hy)
        for i in range(
            max(0, int((cy - reach - y0) / cell)),
            min(blocked.shape[0], int((cy + reach - y0) / cell) + 2),
        ):
            for j in range(
                max(0, int((cx - reach - x0) / cell)),
                min(blocked.shape[1], int((cx + reach - x0) / cell) + 2),
            ):
                dx, dy = x0 + (j + 0.5) * cell - cx, y0 + (i + 0.5) * cell - cy
                u, v = c * dx + s * dy, -s * dx + c * dy
                if abs(u) <= hx + 0.5 * cell and abs(v) <= hy + 0.5 * cell:
                    blocked[i, j] = True


@njit
def _cost_to(
    passable: NDArray[np.bool_], clearance: NDArray[np.float64], i0: int, j0: int, cell: float
) -> NDArray[np.float64]:
    """Dijkstra on eight neighbours; a step costs its length times 1 to 3 near walls."""
    rows, columns = passable.shape
    cost = np.full((rows, columns), _FAR)
    if i0 < 0 or j0 < 0 or i0 >= rows or j0 >= columns:
        return cost
    cost[i0, j0] = 0.0
    queue = [(0.0, i0, j0)]
    while len(queue) > 0:
        here, i, j = heapq.heappop(queue)
        if here > cost[i, j]:
            continue
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if (di == 0 and dj == 0) or a < 0 or b < 0 or a >= rows or b >= columns:
                    continue
                if not passable[a, b]:
                    continue
                tight = max(0.0, 0.7 - clearance[a, b]) / 0.7
                length = cell * (math.sqrt(2.0) if di != 0 and dj != 0 else 1.0)
                there = here + length * (1.0 + 2.0 * tight * tight)
                if there < cost[a, b]:
                    cost[a, b] = there
                    heapq.heappush(queue, (there, a, b))
    return cost
