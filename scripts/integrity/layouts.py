# SPDX-License-Identifier: Apache-2.0
"""Buildings of the plane: walls, pillars, rooms to put things into, and ways to drive.

A way is an edge between two nodes; the robot drives along edges only, and they keep
``CLEAR_M`` from every wall (a test holds that).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.frames import Float

CLEAR_M = 0.4
Box = tuple[float, float, float, float]  # x0, y0, x1, y1
Wall = tuple[float, float, float, float]  # from x0, y0 to x1, y1
Edge = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Layout:
    """One building.

    walls    (n, 4) x0, y0, x1, y1, m
    pillars  (k, 3) x, y, radius, m
    rooms    (r, 4) x0, y0, x1, y1 of free boxes, m
    nodes    (w, 2) m; ``edges`` (e, 2) pairs of them
    """

    walls: Float
    pillars: Float
    rooms: Float
    nodes: Float
    edges: NDArray[np.int64]


class _Plan:
    """A building being drawn."""

    def __init__(self) -> None:
        self.walls: list[Wall] = []
        self.pillars: list[tuple[float, float, float]] = []
        self.rooms: list[Box] = []
        self.nodes: list[tuple[float, float]] = []
        self.edges: list[Edge] = []

    def box(self, x0: float, y0: float, x1: float, y1: float) -> None:
        self.walls += [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]

    def node(self, x: float, y: float, *to: int) -> int:
        self.nodes.append((x, y))
        self.edges += [(other, len(self.nodes) - 1) for other in to]
        return len(self.nodes) - 1

    def ring(self, box: Box, inset: float) -> list[int]:
        """Four nodes along the walls of a box, counter-clockwise from the lower left."""
        x0, y0, x1, y1 = box[0] + inset, box[1] + inset, box[2] - inset, box[3] - inset
        first = self.node(x0, y0)
        second = self.node(x1, y0, first)
        third = self.node(x1, y1, second)
        return [first, second, third, self.node(x0, y1, third, first)]

    def done(self) -> Layout:
        widths = {"walls": 4, "pillars": 3, "rooms": 4, "nodes": 2}
        drawn = {n: np.array(getattr(self, n), float).reshape(-1, w) for n, w in widths.items()}
        return Layout(**drawn, edges=np.array(self.edges, dtype=np.int64))


def _along(rng: np.random.Generator, length: float, depth: float, up: int, down: int) -> Layout:
    """Rooms on both sides of a bare corridor along x; its middle is y = 0."""
    plan, half = _Plan(), float(rng.uniform(0.85, 1.05))
    doors: list[tuple[float, int]] = []
    for side, count in ((1.0, up), (-1.0, down)):
        deep = depth * float(rng.uniform(0.9, 1.1))
        if count == 0:
            plan.walls.append((0.0, side * half, length, side * half))
            continue
        cuts = np.linspace(0.0, length, count + 1)
        cuts[1:-1] += rng.uniform(-0.4, 0.4, count - 1)
        for x0, x1 in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
            doors.append(_side_room(plan, rng, (x0, side * half, x1, side * (half + deep))))
    for end in (0.0, length):
        plan.walls.append((end, -half, end, half))
    plan.rooms.append((0.0, -half, length, half))
    before = plan.node(1.0, 0.0)
    for x, inside in [*sorted(doors), (length - 1.0, -1)]:
        last = plan.nodes[before][0]
        if x - last > 0.15:
            before = plan.node(x, 0.0, before)
        if inside >= 0:
            plan.edges.append((before, inside))
    return plan.done()


def _side_room(plan: _Plan, rng: np.random.Generator, box: Box) -> tuple[float, int]:
    """A room whose second number is the corridor's side; x of its door, and the node behind it."""
    x0, near, x1, far = box
    sign = 1.0 if far > near else -1.0
    width = float(rng.uniform(1.05, 1.25))
    door = float(rng.uniform(x0 + 1.3, x1 - 1.3))
    plan.walls += [
        (x0, near, door - width / 2.0, near), (door + width / 2.0, near, x1, near),
        (x0, near, x0, far), (x1, near, x1, far), (x0, far, x1, far),
    ]  # fmt: skip
    plan.rooms.append((x0, min(near, far), x1, max(near, far)))
    wide, deep = float(rng.uniform(0.7, 1.6)), float(rng.uniform(0.3, 0.55))
    left = float(rng.uniform(x0, x1 - wide))
    plan.box(left, far - sign * deep, left + wide, far)  # a cupboard
    ring = plan.ring((x0, min(near, far), x1, max(near, far)), 1.05)
    inside = plan.node(door, near + sign * 0.75)
    front = ring[:2] if sign > 0 else ring[2:]
    plan.edges += [(inside, other) for other in front]
    return door, inside


def flat(rng: np.random.Generator) -> Layout:
    """Four rooms and a bare corridor between them, about 12 x 10 m."""
    return _along(rng, float(rng.uniform(10.5, 13.0)), float(rng.uniform(3.8, 4.4)), 2, 2)


def corridor(rng: np.random.Generator) -> Layout:
    """A long corridor with seven rooms at its sides."""
    return _along(rng, float(rng.uniform(17.0, 20.0)), float(rng.uniform(3.4, 4.2)), 4, 3)


def bare(rng: np.random.Generator) -> Layout:
    """A corridor of 20 m and nothing in it."""
    return _along(rng, float(rng.uniform(19.0, 21.0)), 0.0, 0, 0)


def halfturn(rng: np.random.Generator) -> Layout:
    """Two rooms that are exactly the same after half a turn about the origin."""
    plan = _Plan()
    w, h = float(rng.uniform(5.0, 6.5)), float(rng.uniform(3.6, 4.4))
    gap = float(rng.uniform(0.6, 0.8))
    plan.walls += [(0.0, -h, w, -h), (w, -h, w, h), (0.0, h, w, h), (0.0, gap, 0.0, h)]
    x, y = float(rng.uniform(0.42, 0.55)) * w, float(rng.uniform(-0.35, 0.35)) * h
    a, b = float(rng.uniform(0.2, 0.6)), float(rng.uniform(0.2, 0.6))
    plan.box(x - a, y - b, x + a, y + b)
    wide = float(rng.uniform(0.8, 1.5))
    plan.box(w - 0.4, 0.1 * h, w, 0.1 * h + wide)
    plan.pillars.append((w - 0.35, float(rng.uniform(-0.6, -0.4)) * h, 0.12))
    plan.rooms.append((0.0, -h, w, h))
    ring = plan.ring((0.0, -h, w, h), 1.05)
    plan.node(0.8, 0.0, ring[0], ring[3])
    count, walls = len(plan.nodes), list(plan.walls)
    plan.walls += [(-x0, -y0, -x1, -y1) for x0, y0, x1, y1 in walls]
    plan.pillars += [(-px, -py, r) for px, py, r in plan.pillars]
    plan.rooms.append((-w, -h, 0.0, h))
    plan.nodes += [(-nx, -ny) for nx, ny in plan.nodes]
    plan.edges += [(i + count, j + count) for i, j in plan.edges]
    plan.edges.append((count - 1, 2 * count - 1))
    return plan.done()


def hall(rng: np.random.Generator) -> Layout:
    """One hall of 12 to 16 m with pillars, round and square."""
    plan, n = _Plan(), 4
    w, h = float(rng.uniform(12.0, 16.0)), float(rng.uniform(10.0, 14.0))
    plan.box(0.0, 0.0, w, h)
    plan.rooms.append((0.0, 0.0, w, h))
    for i in range(1, n):
        for j in range(1, n):
            if rng.random() < 0.25:
                continue
            x = i * w / n + float(rng.uniform(-0.5, 0.5))
            y = j * h / n + float(rng.uniform(-0.4, 0.4))
            size = float(rng.uniform(0.12, 0.35))
            if rng.random() < 0.5:
                plan.pillars.append((x, y, size))
            else:
                plan.box(x - size, y - size, x + size, y + size)
    for i in range(n):
        for j in range(n):
            to = ([i * n + j - 1] if j else []) + ([(i - 1) * n + j] if i else [])
            plan.node((i + 0.5) * w / n, (j + 0.5) * h / n, *to)
    return plan.done()


def office(rng: np.random.Generator) -> Layout:
    """Two wings at a right angle with bays between partitions."""
    plan = _Plan()
    a, b = float(rng.uniform(4.6, 5.4)), float(rng.uniform(4.6, 5.4))
    l1, l2 = float(rng.uniform(12.5, 15.0)), float(rng.uniform(11.0, 13.0))
    plan.walls += [
        (0.0, 0.0, l1, 0.0), (l1, 0.0, l1, a), (l1, a, b, a),
        (b, a, b, l2), (b, l2, 0.0, l2), (0.0, l2, 0.0, 0.0),
    ]  # fmt: skip
    plan.rooms += [(0.0, 0.0, l1, a), (0.0, a, b, l2)]
    corner = plan.node(0.62 * b, 0.62 * a)
    for turned, (long, wide, start) in enumerate(((l1, a, b), (l2, b, a))):
        before, at = corner, start + float(rng.uniform(0.2, 0.6))
        while at + 2.0 < long:
            deep, next_at = float(rng.uniform(0.36, 0.5)) * wide, at + float(rng.uniform(1.9, 2.5))
            plan.walls.append((0.0, at, deep, at) if turned else (at, 0.0, at, deep))
            middle = min((at + next_at) / 2.0, long - 0.7)
            lane, bay = (middle, 0.72 * wide), (middle, 0.24 * wide)
            before = plan.node(*(lane[::-1] if turned else lane), before)
            plan.node(*(bay[::-1] if turned else bay), before)
            at = next_at
    return plan.done()


_MAKERS = {one.__name__: one for one in (flat, halfturn, corridor, hall, office, bare)}


def layout(name: str, rng: np.random.Generator) -> Layout:
    """A building by its name (``kinds.Building``)."""
    return _MAKERS[name](rng)
