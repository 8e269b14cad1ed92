# SPDX-License-Identifier: Apache-2.0
"""Random rooms: another floor plan for each seed, every room of it within reach.

The seed cuts a rectangle into rooms (``scenes.partition``), gives each a purpose, and furnishes it;
furniture that would part a room's doors or its middle from one another is not put there.
"""

import math
from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.assembly import moved, part_marks
from scenes.builder import Builder
from scenes.partition import OPENING, Cut, Opening, Rect, partition
from scenes.placement import gap_to_boxes
from scenes.plan import Plan
from scenes.recipe import Draws, count, finish, free_floor, hang_doors, scatter, seat_chairs
from scenes.registry import register
from scenes.scene import Pose, Scene
from slam._jit import njit
from slam.shaped import within

DEPTH = 0.7  # of the width
WALL_HALF, OUTER_HALF = 0.06, 0.08
# purpose -> floor, parts along walls, parts anywhere (each part once, in this order, from the left)
PURPOSES: dict[str, tuple[str, Sequence[str], Sequence[str]]] = {
    "office": ("floor_carpet", ("desk", "desk", "cabinet", "bookshelf", "plant"), ()),
    "meeting": ("floor_felt", ("cabinet", "plant", "plant"), ("table", "dining")),
    "lounge": ("floor_planks", ("sofa", "tv", "plant", "bookshelf"), ("bistro",)),
    "copy": ("floor_vinyl", ("printer", "cabinet", "cabinet", "bookshelf"), ()),
    "study": ("floor_lino", ("desk", "bookshelf", "plant"), ("school_desk",) * 4),
    "bedroom": ("floor_planks", ("bed", "wardrobe", "cabinet", "plant"), ()),
    "kitchen": ("floor_tiles", ("kitchen", "cabinet"), ("dining",)),
}
FLOORS = tuple(sorted({floor for floor, _, _ in PURPOSES.values()}))
DOOR_CLEAR, GOAL_CLEAR = 1.15, 0.65  # m kept free around a doorway's and a room's middle
PASSAGE = 0.36  # m, radius of what must get from each door to all others
OVERHANG = {"plant": 0.26}  # m by which a part is wider than its footprint, above the scan plane
TRIES = 12  # places tried for a piece of furniture
GRID_M = 0.1


@register("random-rooms")
def random_rooms(  # noqa: PLR0913 (options of a scene)
    seed: int,
    *,
    size_m: float = 14.0,
    n_rooms: int | None = None,
    clutter: float = 0.6,
    n_chairs: int | None = None,
    n_people: int | None = None,
    doors: str = "open",
) -> Scene:
    """A new floor plan per seed: ``size_m`` (14) wide, ``n_rooms`` (6), ``clutter`` (0.6) in 0..1.

    It is 0.7 ``size_m`` deep. ``clutter`` is the share of each room's furniture that is tried, and
    sets ``n_chairs`` (2 + 3 per room at 1) and the bins. ``n_people`` (3). ``doors``: how they
    rest, "open", "ajar", "closed" or "mixed".
    """
    size_m = within("size_m", size_m, 5.0, 40.0)
    clutter = within("clutter", clutter, 0.0, 1.0)
    n_rooms = max(1, count("n_rooms", n_rooms, 6))
    n_chairs = count("n_chairs", n_chairs, 2 + round(3.0 * clutter * n_rooms))
    n_people = count("n_people", n_people, 3)
    draws = Draws(seed)
    plan = _plan(size_m, n_rooms, clutter, draws.rooms)
    builder = Builder(plan)
    hang_doors(builder, draws.doors, doors)
    floor = free_floor(builder)
    scatter(builder, floor, "bin", round(0.7 * clutter * n_rooms), draws, draws.bins)
    seat_chairs(builder, floor, plan.seats, n_chairs, draws)
    scatter(builder, floor, "person", n_people, draws, draws.people)
    options = {
        "size_m": size_m,
        "n_rooms": n_rooms,
        "clutter": clutter,
        "n_chairs": n_chairs,
        "n_people": n_people,
        "doors": doors,
    }
    return finish(builder, "random-rooms", seed, options)


def _plan(size_m: float, n_rooms: int, clutter: float, rng: np.random.Generator) -> Plan:
    plan = Plan("blank", floors=FLOORS)
    width, depth = round(size_m, 2), round(DEPTH * size_m, 2)
    plan.spec.stat.extent = 1.05 * width
    rooms, cuts, openings = partition(width, depth, n_rooms, rng)
    _wall_in(plan, width, depth)
    for index, cut in enumerate(cuts):
        _build(plan, index, cut, [o.low for o in openings if o.cut == cut])
    for index, opening in enumerate(openings):
        if opening.hinge is None:
            plan.mark(f"opening:{index}", (*opening.middle, 0.0))
        else:
            hand = "right" if opening.clockwise else "left"
            plan.mark(f"door:{index}:{hand}", opening.hinge)
    plan.frame_doors()
    purposes = rng.permutation(np.tile(sorted(PURPOSES), 1 + n_rooms // len(PURPOSES)))
    for index, (room, purpose) in enumerate(zip(rooms, purposes, strict=False)):
        name = f"{purpose}_{index}"
        _lay_floor(plan, name, room, PURPOSES[purpose][0])
        _Room(plan, room, openings).furnish(str(purpose), clutter, rng)
    start = rooms[int(rng.integers(len(rooms)))]
    plan.mark("start:robot", (*_middle(start), float(rng.uniform(-math.pi, math.pi))))
    return plan.finish()


def _wall_in(plan: Plan, width: float, depth: float) -> None:
    x, y, t = 0.5 * width + OUTER_HALF, 0.5 * depth + OUTER_HALF, OUTER_HALF
    for name, sign in (("north", 1.0), ("south", -1.0)):
        plan.wall(name, (0.0, sign * y), (x + t - 0.005, t))
    for name, sign in (("east", 1.0), ("west", -1.0)):
        plan.wall(name, (sign * x, 0.0), (t, y + t - 0.005))


def _build(plan: Plan, index: int, cut: Cut, gaps: Sequence[float]) -> None:
    """The pieces of an inner wall between its openings."""
    edges = [cut.low - 0.01, *(e for g in sorted(gaps) for e in (g, g + OPENING)), cut.high + 0.01]
    for piece, (low, high) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        half = 0.5 * (high - low)
        size = (WALL_HALF, half) if cut.axis == 0 else (half, WALL_HALF)
        plan.wall(f"{index}_{piece}", cut.point(low + half), size)


def _lay_floor(plan: Plan, name: str, room: Rect, material: str) -> None:
    half = (0.5 * (room[2] - room[0]), 0.5 * (room[3] - room[1]))
    plan.floor(name, _middle(room), half, material)
    inner = (half[0] - WALL_HALF, half[1] - WALL_HALF)
    plan.mark(f"room:{name}", (*_middle(room), 0.0), inner)
    plan.mark(f"goal:{name}", (*_middle(room), 0.0))


def _middle(rect: Rect) -> tuple[float, float]:
    return 0.5 * (rect[0] + rect[2]), 0.5 * (rect[1] + rect[3])


class _Room:
    """One room while it is furnished."""

    def __init__(self, plan: Plan, rect: Rect, openings: Sequence[Opening]) -> None:
        self._plan = plan
        x, y = _middle(rect)
        self._half = (0.5 * (rect[2] - rect[0]) - WALL_HALF, 0.5 * (rect[3] - rect[1]) - WALL_HALF)
        self._centre = (x, y)
        # seen from the middle of the room
        self._doors = [
            (o.middle[0] - x, o.middle[1] - y)
            for o in openings
            if abs(o.middle[0] - x) <= self._half[0] + 2 * WALL_HALF
            and abs(o.middle[1] - y) <= self._half[1] + 2 * WALL_HALF
        ]
        self._boxes = np.empty((0, 5))

    def furnish(self, purpose: str, clutter: float, rng: np.random.Generator) -> None:
        """Try each part of the purpose with the chance ``clutter``."""
        _, along, free = PURPOSES[purpose]
        for index, part in enumerate((*free, *along)):
            wanted = rng.random() < clutter
            places = rng.random((TRIES, 3))
            if not wanted:
                continue
            for u, v, w in places.tolist():
                pose = self._anywhere(u, v, w) if index < len(free) else self._wall(part, u, v)
                if pose is not None and self._accept(part, pose):
                    break

    def _anywhere(self, u: float, v: float, w: float) -> Pose:
        (a, b), turn = self._half, 0.5 * math.pi * math.floor(4.0 * w)
        return (2.0 * u - 1.0) * a, (2.0 * v - 1.0) * b, turn

    def _wall(self, part: str, u: float, v: float) -> Pose | None:
        """Back (+y) to one of the four walls."""
        side = math.floor(4.0 * u)
        yaw = 0.5 * math.pi * side
        length, reach = (self._half[0], self._half[1])[:: 1 if side % 2 == 0 else -1]
        half, back = _extent(part)
        over = OVERHANG.get(part, 0.0)
        half, back = half + over, back + over
        if half > length:
            return None
        along = (2.0 * v - 1.0) * (length - half)
        return moved((0.0, 0.0, yaw), (along, reach - back - 0.02, 0.0))

    def _accept(self, part: str, pose: Pose) -> bool:
        """Put the part there unless it is in the way."""
        boxes = _footprint(_prints(part), pose)
        if not self._inside(boxes):
            return False
        keep = np.array([(0.0, 0.0), *self._doors])
        radius = np.array([GOAL_CLEAR, *(DOOR_CLEAR for _ in self._doors)])
        if (gap_to_boxes(keep, boxes) < radius).any():
            return False
        corners = _outline(boxes)
        if len(self._boxes) and (gap_to_boxes(corners, self._boxes) < 0.04).any():
            return False
        if len(self._boxes) and (gap_to_boxes(_outline(self._boxes), boxes) < 0.04).any():
            return False
        together = np.vstack([self._boxes, boxes])
        if not self._passable(together):
            return False
        self._boxes = together
        x, y, yaw = moved((*self._centre, 0.0), pose)
        self._plan.furnish(part, (x, y, yaw))
        return True

    def _inside(self, boxes: NDArray[np.float64]) -> bool:
        corners = np.abs(_outline(boxes))
        return bool((corners <= np.array(self._half) - 0.005).all())

    def _passable(self, boxes: NDArray[np.float64]) -> bool:
        """Whether a disc still gets from the middle to each doorway."""
        a, b = self._half
        n_x, n_y = math.ceil(2.0 * a / GRID_M), math.ceil(2.0 * b / GRID_M)
        x, y = np.meshgrid((np.arange(n_x) + 0.5) * GRID_M - a, (np.arange(n_y) + 0.5) * GRID_M - b)
        points = np.stack([x.ravel(), y.ravel()], axis=1)
        walls = np.minimum(a - np.abs(points[:, 0]), b - np.abs(points[:, 1]))
        free = np.minimum(walls, gap_to_boxes(points, boxes)) > PASSAGE
        _, labels = cv2.connectedComponents(free.reshape(n_y, n_x).astype(np.uint8))

        def label(px: float, py: float) -> int:
            """Of the place nearest to that point where the disc is clear of the walls."""
            px, py = (max(min(v, h - 0.5), 0.5 - h) for v, h in ((px, a), (py, b)))
            return int(labels[int((py + b) / GRID_M), int((px + a) / GRID_M)])

        home = label(0.0, 0.0)
        return home != 0 and all(label(*door) == home for door in self._doors)


@cache
def _prints(part: str) -> NDArray[np.float64]:
    """(n, 5) boxes of a part in its own frame: cx, cy, half x, half y m, yaw rad."""
    marks = [mark for mark in part_marks(part) if mark.words[0].startswith("footprint")]
    return np.array([[*mark.pose[:2], *mark.half, mark.pose[2]] for mark in marks])


@cache
def _extent(part: str) -> tuple[float, float]:
    """Half its width, and how far its back lies from its origin, m."""
    boxes = _prints(part)
    return float((abs(boxes[:, 0]) + boxes[:, 2]).max()), float((boxes[:, 1] + boxes[:, 3]).max())


@njit
def _footprint(prints: NDArray[np.float64], pose: Pose) -> NDArray[np.float64]:
    """(n, 5) boxes of a part that stands at ``pose``."""
    x, y, yaw = pose
    boxes, cos, sin = prints.copy(), math.cos(yaw), math.sin(yaw)
    for k in range(len(boxes)):
        boxes[k, 0] = x + cos * prints[k, 0] - sin * prints[k, 1]
        boxes[k, 1] = y + sin * prints[k, 0] + cos * prints[k, 1]
        boxes[k, 4] = yaw + prints[k, 4]
    return boxes


@njit
def _outline(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """(9 n, 2) corners, middles of sides and centres; furniture is no longer than thrice a gap."""
    points = np.empty((9 * len(boxes), 2))
    for k in range(len(boxes)):
        cos, sin = math.cos(boxes[k, 4]), math.sin(boxes[k, 4])
        for i in range(9):
            u, v = (i // 3 - 1) * boxes[k, 2], (i % 3 - 1) * boxes[k, 3]
            points[9 * k + i, 0] = boxes[k, 0] + cos * u - sin * v
            points[9 * k + i, 1] = boxes[k, 1] + sin * u + cos * v
    return points
