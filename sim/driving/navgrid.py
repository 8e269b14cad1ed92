# SPDX-License-Identifier: Apache-2.0
"""Where a disc can drive in a static layout, and how far it is from there to a goal."""

import heapq
import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.frames import Float

_FAR = 1e6
CLEAR_M = 1.0  # clearance is not told apart beyond this


class NavGrid:
    """Clearance and cost-to-go on a grid; row 0 is the lowest y, (x0, y0) its lower left corner.

    bounds     xmin, ymin, xmax, ymax of the floor, m; outside counts as wall
    obstacles  (n, 5) boxes: centre x, y, half sizes (m), yaw (rad)
    radius     m; a cell whose centre is nearer than this to an obstacle cannot be entered. Keep it
               above half a cell, else a path may cross a thin wall between two centres

    ``clearance`` is the distance from each cell's centre to the nearest obstacle, at most 1 m.
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        obstacles: Float,
        radius: float,
        cell: float = 0.1,
    ) -> None:
        self.cell, self.radius = cell, radius
        self.x0, self.y0 = bounds[0], bounds[1]
        columns = math.ceil((bounds[2] - bounds[0]) / cell)
        rows = math.ceil((bounds[3] - bounds[1]) / cell)
        x = bounds[0] + (np.arange(columns) + 0.5) * cell
        y = bounds[1] + (np.arange(rows) + 0.5) * cell
        to_side = np.minimum(x - bounds[0], bounds[2] - x)
        to_end = np.minimum(y - bounds[1], bounds[3] - y)
        self.clearance: Float = np.minimum(np.minimum(to_side[None, :], to_end[:, None]), CLEAR_M)
        _approach(self.clearance, _boxes(obstacles), self.x0, self.y0, cell)
        self._costs: dict[tuple[float, float], Float] = {}

    def with_boxes(self, boxes: Float) -> "NavGrid":
        """The same floor with more obstacles on it, (k, 5)."""
        other = object.__new__(NavGrid)
        other.cell, other.radius, other.x0, other.y0 = self.cell, self.radius, self.x0, self.y0
        other.clearance = self.clearance.copy()
        _approach(other.clearance, _boxes(boxes), self.x0, self.y0, self.cell)
        other._costs = {}
        return other

    def lookup(self, field: Float, x: float, y: float) -> float:
        """``field`` in the cell of (x, y); 1e6 outside."""
        i, j = math.floor((y - self.y0) / self.cell), math.floor((x - self.x0) / self.cell)
        inside = 0 <= i < field.shape[0] and 0 <= j < field.shape[1]
        return float(field[i, j]) if inside else _FAR

    def cost_near(self, costs: Float, x: float, y: float) -> float:
        """The least of ``costs`` within a cell of (x, y): a robot may stand where none may go."""
        return float(costs[self.around(x, y)].min(initial=_FAR))

    def around(self, x: float, y: float) -> tuple[slice, slice]:
        """Rows and columns of the cells within one of (x, y); none far outside."""
        i, j = math.floor((y - self.y0) / self.cell), math.floor((x - self.x0) / self.cell)
        return slice(max(0, i - 1), max(0, i + 2)), slice(max(0, j - 1), max(0, j + 2))

    def cost_to(self, goal: Float) -> Float:
        """Cost of the best way to ``goal`` from every cell: metres, dearer close to walls.

        1e6 where there is no way. Computed once per goal.
        """
        key = (float(goal[0]), float(goal[1]))
        if key not in self._costs:
            i = math.floor((key[1] - self.y0) / self.cell)
            j = math.floor((key[0] - self.x0) / self.cell)
            self._costs[key] = _cost_to(self.clearance, self.radius, i, j, self.cell)
        return self._costs[key]


def _boxes(boxes: Float) -> Float:
    return np.array(boxes, dtype=np.float64, order="C").reshape(-1, 5)  # of one type, writable


@njit
def _approach(
    clearance: NDArray[np.float64], boxes: NDArray[np.float64], x0: float, y0: float, cell: float
) -> None:
    """Lower ``clearance`` to the distance to each box, 0 inside."""
    for k in range(boxes.shape[0]):
        cx, cy, hx, hy, yaw = boxes[k]
        c, s = math.cos(yaw), math.sin(yaw)
        reach = math.sqrt(hx * hx + hy * hy) + CLEAR_M
        for i in range(
            max(0, int((cy - reach - y0) / cell)),
            min(clearance.shape[0], int((cy + reach - y0) / cell) + 2),
        ):
            for j in range(
                max(0, int((cx - reach - x0) / cell)),
                min(clearance.shape[1], int((cx + reach - x0) / cell) + 2),
            ):
                dx, dy = x0 + (j + 0.5) * cell - cx, y0 + (i + 0.5) * cell - cy
                u = max(0.0, abs(c * dx + s * dy) - hx)
                v = max(0.0, abs(-s * dx + c * dy) - hy)
                clearance[i, j] = min(clearance[i, j], math.sqrt(u * u + v * v))


@njit
def _cost_to(
    clearance: NDArray[np.float64], radius: float, i0: int, j0: int, cell: float
) -> NDArray[np.float64]:
    """Dijkstra on eight neighbours; a step costs its length times 1 to 3 near walls."""
    rows, columns = clearance.shape
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
                if clearance[a, b] < radius:
                    continue
                tight = max(0.0, 0.7 - clearance[a, b]) / 0.7
                length = cell * (math.sqrt(2.0) if di != 0 and dj != 0 else 1.0)
                there = here + length * (1.0 + 2.0 * tight * tight)
                if there < cost[a, b]:
                    cost[a, b] = there
                    heapq.heappush(queue, (there, a, b))
    return cost
