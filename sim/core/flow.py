# SPDX-License-Identifier: Apache-2.0
"""Ways for walkers: exact clearance of a floor plan, and for each goal the direction to go.

The travel time to a goal solves the eikonal equation |grad T| = slowness by fast sweeping (Zhao
2005, "A fast sweeping method for eikonal equations"); walkers go down its gradient. Slowness rises
towards walls, so ways keep off them, and stays finite (but high) in the margin where a walker does
not fit, so that one who was pushed there is led out again. ``sim.driving.navgrid`` is the robot's
plainer
sibling: a walker needs a smooth direction anywhere, a planner whether a cell may be entered.
"""

import math
from typing import NamedTuple

import numpy as np

from slam._jit import inner, njit, uncounted
from slam.frames import Float

FAR = 1e6  # s/(m/s), travel time of a node with no way to the goal
WALL = 0.06  # m, nodes nearer than this to a box are solid; twice this is more than a cell


@uncounted
def box_clearance(x: float, y: float, boxes: Float) -> float:
    """m from (x, y) to the nearest box (cx, cy, half x, half y, yaw); negative inside one."""
    nearest = math.inf
    for k in range(boxes.shape[0]):
        dx, dy, yaw = x - boxes[k, 0], y - boxes[k, 1], boxes[k, 4]
        c, s = math.cos(yaw), math.sin(yaw)
        u = abs(c * dx + s * dy) - boxes[k, 2]
        v = abs(c * dy - s * dx) - boxes[k, 3]
        outside = math.sqrt(max(u, 0.0) ** 2 + max(v, 0.0) ** 2)
        nearest = min(nearest, outside if outside > 0.0 else max(u, v))
    return nearest


@njit
def clearance_field(
    boxes: Float, bounds: tuple[float, float, float, float], cell: float, reach: float
) -> Float:
    """Clearance at the nodes (x0 + j cell, y0 + i cell), m, up to ``reach`` from each box."""
    x0, y0, x1, y1 = bounds
    rows = math.ceil((y1 - y0) / cell) + 1
    columns = math.ceil((x1 - x0) / cell) + 1
    field = np.empty((rows, columns))
    for i in range(rows):
        for j in range(columns):
            x, y = x0 + j * cell, y0 + i * cell
            field[i, j] = min(x - x0, x1 - x, y - y0, y1 - y, reach)
    for k in range(boxes.shape[0]):
        box = boxes[k : k + 1]
        size = math.sqrt(box[0, 2] ** 2 + box[0, 3] ** 2) + reach
        for i in range(
            max(0, math.floor((box[0, 1] - size - y0) / cell)),
            min(rows, math.ceil((box[0, 1] + size - y0) / cell) + 1),
        ):
            for j in range(
                max(0, math.floor((box[0, 0] - size - x0) / cell)),
                min(columns, math.ceil((box[0, 0] + size - x0) / cell) + 1),
            ):
                here = box_clearance(x0 + j * cell, y0 + i * cell, box)
                field[i, j] = min(field[i, j], here)
    return field


@njit
def slowness(clearance: Float, radius: float) -> Float:
    """Time to walk a metre at each node, relative to open floor: 1, to 3 at walls, 15 in them."""
    out = np.empty_like(clearance)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            c = clearance[i, j]
            if c < WALL:
                out[i, j] = FAR
            elif c < radius:
                out[i, j] = 15.0
            else:
                tight = max(0.0, 0.6 - c) / 0.6
                out[i, j] = 1.0 + 4.0 * tight * tight
    return out


@inner
def _node_time(a: float, b: float, step: float) -> float:
    """Upwind solution at a node whose least neighbours along the axes are ``a`` and ``b``."""
    if a > b:
        a, b = b, a
    if b - a >= step:
        return a + step
    return 0.5 * (a + b + math.sqrt(2.0 * step * step - (a - b) ** 2))


@njit
def travel_time(slow: Float, cell: float, gi: float, gj: float) -> Float:  # noqa: C901 (kernel)
    """T at each node for the goal at node coordinates (gi, gj); ``FAR`` where there is no way."""
    rows, columns = slow.shape
    T = np.full((rows, columns), FAR)
    for i in range(max(0, int(gi)), min(rows, int(gi) + 2)):
        for j in range(max(0, int(gj)), min(columns, int(gj) + 2)):
            if slow[i, j] < FAR:
                T[i, j] = math.sqrt((i - gi) ** 2 + (j - gj) ** 2) * cell * slow[i, j]
    for sweep in range(400):
        changed = False
        for ii in range(rows):
            i = ii if sweep & 1 == 0 else rows - 1 - ii
            for jj in range(columns):
                j = jj if sweep & 2 == 0 else columns - 1 - jj
                if slow[i, j] >= FAR:
                    continue
                a = min(T[i - 1, j] if i > 0 else FAR, T[i + 1, j] if i + 1 < rows else FAR)
                b = min(T[i, j - 1] if j > 0 else FAR, T[i, j + 1] if j + 1 < columns else FAR)
                if min(a, b) >= T[i, j]:
                    continue
                new = _node_time(a, b, slow[i, j] * cell)
                if new < T[i, j] - 1e-9:
                    T[i, j] = new
                    changed = True
        if not changed and sweep >= 3:
            break
    return T


@inner
def _slope(before: float, here: float, after: float) -> float:
    """Upwind difference: towards the lower neighbour, 0 at a minimum."""
    if before >= here and after >= here:
        return 0.0
    return here - before if before < after else after - here


@njit
def directions(T: Float, clearance: Float) -> Float:  # noqa: C901 (kernel)
    """(rows, columns, 2) unit vectors down T, averaged over 3 x 3 nodes; off walls inside them."""
    rows, columns = T.shape
    raw = np.zeros((rows, columns, 2))
    for i in range(rows):
        for j in range(columns):
            up, down = min(i + 1, rows - 1), max(i - 1, 0)
            right, left = min(j + 1, columns - 1), max(j - 1, 0)
            if T[i, j] < FAR:
                gx = -_slope(T[i, left], T[i, j], T[i, right])
                gy = -_slope(T[down, j], T[i, j], T[up, j])
            else:
                gx = clearance[i, right] - clearance[i, left]
                gy = clearance[up, j] - clearance[down, j]
            norm = math.sqrt(gx * gx + gy * gy)
            if norm > 0.0:
                raw[i, j, 0], raw[i, j, 1] = gx / norm, gy / norm
    out = np.zeros((rows, columns, 2))
    for i in range(rows):
        for j in range(columns):
            sx, sy = 0.0, 0.0
            for a in range(max(i - 1, 0), min(i + 2, rows)):
                for b in range(max(j - 1, 0), min(j + 2, columns)):
                    if (T[a, b] < FAR) == (T[i, j] < FAR):
                        sx += raw[a, b, 0]
                        sy += raw[a, b, 1]
            norm = math.sqrt(sx * sx + sy * sy)
            if norm > 1e-9:
                out[i, j, 0], out[i, j, 1] = sx / norm, sy / norm
    return out


class Field(NamedTuple):
    """Arrays of a ``FlowMap``: clearance (h, w), time (g, h, w), way (g, h, w, 2), grid."""

    clearance: Float
    times: Float
    ways: Float
    x0: float
    y0: float
    cell: float


def nowhere() -> Field:
    """The field of a floor without goals."""
    return Field(np.zeros((0, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0, 0, 0)), 0.0, 0.0, 1.0)


@uncounted
def clearance_at(field: Field, x: float, y: float) -> float:
    """Clearance by bilinear interpolation, m; outside the floor -1."""
    clearance, cell = field.clearance, field.cell
    u, v = (x - field.x0) / cell, (y - field.y0) / cell
    i, j = math.floor(v), math.floor(u)
    if i < 0 or j < 0 or i + 1 >= clearance.shape[0] or j + 1 >= clearance.shape[1]:
        return -1.0
    a, b = v - i, u - j
    low = clearance[i, j] * (1.0 - b) + clearance[i, j + 1] * b
    high = clearance[i + 1, j] * (1.0 - b) + clearance[i + 1, j + 1] * b
    return float(low * (1.0 - a) + high * a)


@uncounted
def time_at(field: Field, goal: int, x: float, y: float) -> float:
    """Travel time to a goal (s at 1 m/s), the least of the four nodes around plus the way there."""
    times, cell = field.times, field.cell
    u, v = (x - field.x0) / cell, (y - field.y0) / cell
    least = FAR
    for i in range(math.floor(v), math.floor(v) + 2):
        for j in range(math.floor(u), math.floor(u) + 2):
            if 0 <= i < times.shape[1] and 0 <= j < times.shape[2]:
                way = cell * math.sqrt((v - i) ** 2 + (u - j) ** 2)
                least = min(least, times[goal, i, j] + way)
    return least


@uncounted
def way_at(field: Field, goal: int, x: float, y: float) -> tuple[float, float]:
    """Unit direction to walk in, (0, 0) outside the floor."""
    ways, cell = field.ways, field.cell
    u, v = (x - field.x0) / cell, (y - field.y0) / cell
    i, j = math.floor(v), math.floor(u)
    if i < 0 or j < 0 or i + 1 >= ways.shape[1] or j + 1 >= ways.shape[2]:
        return 0.0, 0.0
    a, b = v - i, u - j
    dx, dy = 0.0, 0.0
    for k in range(4):
        p, q = k // 2, k % 2
        weight = (a if p == 1 else 1.0 - a) * (b if q == 1 else 1.0 - b)
        dx += weight * ways[goal, i + p, j + q, 0]
        dy += weight * ways[goal, i + p, j + q, 1]
    norm = math.sqrt(dx * dx + dy * dy)
    if norm < 1e-9:
        return 0.0, 0.0
    return dx / norm, dy / norm


WALKER_M = 0.27  # m, that a walker needs around its centre


class FlowMap:
    """Clearance of a floor and the ways to a set of goals.

    bounds     xmin, ymin, xmax, ymax, m; outside is wall
    obstacles  (n, 5) boxes: centre x, y, half sizes m, yaw rad
    goals      (k, 2) m
    leaves     (m, 5) boxes that ways go around but that are no wall: doors that stand open
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        obstacles: Float,
        goals: Float,
        *,
        cell: float = 0.1,
        leaves: Float | None = None,
    ) -> None:
        boxes = np.ascontiguousarray(obstacles, dtype=np.float64).reshape(-1, 5)
        xmin, ymin, xmax, ymax = (float(b) for b in bounds)
        floor = (xmin, ymin, xmax, ymax)
        self.clearance: Float = clearance_field(boxes, floor, cell, 1.0)
        slow = slowness(self.clearance, WALKER_M)
        if leaves is not None and len(leaves) > 0:
            beside = clearance_field(np.ascontiguousarray(leaves), floor, cell, 1.0)
            slow = np.where(
                slow < FAR, np.maximum(slow, slowness(np.maximum(beside, WALL), WALKER_M)), slow
            )
        shape = (len(goals), *self.clearance.shape)
        self.time: Float = np.zeros(shape)
        self.direction: Float = np.zeros((*shape, 2))
        for k, (x, y) in enumerate(np.asarray(goals, dtype=np.float64).tolist()):
            gi, gj = (y - ymin) / cell, (x - xmin) / cell
            self.time[k] = travel_time(slow, cell, gi, gj)
            self.direction[k] = directions(self.time[k], self.clearance)
        self.field = Field(self.clearance, self.time, self.direction, xmin, ymin, cell)
