# SPDX-License-Identifier: Apache-2.0
"""What never moves: walls, floors and furniture of a scene.

A plan is the same for all seeds of most scenes, so it is made once per process and the things that
move are added to copies of it (``scenes.builder``).
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import product
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes import look
from scenes.assembly import (
    Assembly,
    check_materials,
    file_of,
    length_of,
    moved,
    ours,
    parsed,
    part_marks,
    quaternion,
)
from scenes.kinds import KINDS, PUSHED
from scenes.marks import Mark, check_marks, check_written, marks, yaw_of
from scenes.plan_file import check_length, check_span
from scenes.scene import Pose, compiled
from slam.errors import InvalidValueError

Bounds = tuple[float, float, float, float]

ASPECT = 16 / 9
HEIGHT = 1.1  # m, of what is to be in the picture
RIM_M = 0.35  # m of ground shown around the floor, outer walls included
PITCH_DEG, FOV_DEG = 56.0, 36.0
MAX_FOVY = 179.0  # m high is the most that MuJoCo lets a picture from above show (below 180)
MARGIN = 1.01
ROUNDS = 40  # of moving the camera; each halves the error at least


def add_cameras(spec: mujoco.MjSpec, bounds: Bounds) -> None:
    """Add "top" and "persp" if they are missing, so that a 16:9 picture shows all of ``bounds``."""
    known = {camera.name for camera in spec.cameras}
    xmin, ymin, xmax, ymax = bounds
    if "top" not in known:
        wide, high = xmax - xmin + 2 * RIM_M, ymax - ymin + 2 * RIM_M
        camera = spec.worldbody.add_camera(
            name="top", pos=[0.5 * (xmin + xmax), 0.5 * (ymin + ymax), 14.0]
        )
        camera.proj = mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC
        camera.fovy = min(max(high, wide / ASPECT), MAX_FOVY)
    if "persp" not in known:
        pitch = math.radians(PITCH_DEG)
        camera = spec.worldbody.add_camera(name="persp", pos=_stand_back(bounds), fovy=FOV_DEG)
        half = 0.5 * (0.5 * math.pi - pitch)  # the camera looks along its -z: level is a quarter up
        camera.quat = [math.cos(half), math.sin(half), 0.0, 0.0]


def _stand_back(bounds: Bounds) -> list[float]:
    """Where a camera that looks north and down by the pitch sees all corners, none closer."""
    xmin, ymin, xmax, ymax = bounds
    xmin, ymin, xmax, ymax = xmin - RIM_M, ymin - RIM_M, xmax + RIM_M, ymax + RIM_M
    corners = list(product((xmin, xmax), (ymin, ymax), (0.0, HEIGHT)))
    cos, sin = math.cos(math.radians(PITCH_DEG)), math.sin(math.radians(PITCH_DEG))
    reach = math.tan(math.radians(0.5 * FOV_DEG)) / MARGIN
    x, y = 0.5 * (xmin + xmax), 0.5 * (ymin + ymax)  # what it looks at on the floor
    distance = xmax - xmin + ymax - ymin
    for _ in range(ROUNDS):
        seen = []
        for cx, cy, cz in corners:
            depth = distance + (cy - y) * cos - cz * sin
            seen.append(((cx - x) / depth, ((cy - y) * sin + cz * cos) / depth))
        low, high = min(v for _, v in seen), max(v for _, v in seen)
        width = max(abs(u) for u, _ in seen)
        y += 0.5 * (low + high) * distance / sin
        distance *= 0.5 + 0.5 * max(width / (reach * ASPECT), 0.5 * (high - low) / reach)
    return [x, y - distance * cos, distance * sin]


JAMB_OFFSET = 0.04  # m from the plane of a hinge to the middle of its wall, away from the swing
WALL_HEIGHT = 1.1  # m, walls are cut there
GLASS_HALF = 0.012  # m, half thickness of a pane
HIDDEN = 3  # group of what collides and is seen by neither rays nor cameras
APRON_HALF = 0.3  # m, to the height of the hulls' middle
APRON = (
    64  # contact bit of outlines of tables and racks, for chairs and loads: see parts/common.xml
)


class Plan:
    """A plan in the making: ``furnish`` it, then ``finish`` it, then only read it."""

    spec: mujoco.MjSpec

    def __init__(self, source: str, *, floors: Sequence[str] = ()) -> None:
        """``source``: name of one of our plans or path of an MJCF file; ``floors``: materials that
        will be used beside those of the file."""
        path = file_of("plans", source)
        written = path.stat().st_mtime_ns
        spec, self.marks = _parsed(source, tuple(floors), written)
        self.spec = spec.copy()
        self._source, self._file = Path(source).name, source if source.endswith(".xml") else ""
        self.file = self._file or path.name
        self.seats: list[Mark] = list(self.find("seat"))
        self.put: list[tuple[str, Pose]] = []
        self._furniture: list[list[float]] = []
        self._boxes: NDArray[np.float64] | None = None
        self._counts: Counter[str] = Counter()
        self._parts = Assembly()
        self._kinds: set[str] = set()

    def find(self, first: str) -> Iterator[Mark]:
        """Marks whose name starts with that word."""
        return (mark for mark in self.marks if mark.words[0] == first)

    def mark(self, name: str, pose: Pose, half: tuple[float, float] = (0.0, 0.0)) -> None:
        """Add a mark to those of the file."""
        self.marks = (*self.marks, Mark(words=tuple(name.split(":")), pose=pose, half=half))

    @property
    def start(self) -> Pose:
        """Where the robot starts."""
        return next(self.find("start")).pose

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of all rooms, m; or of the mark ``bounds:NAME``, where one is."""
        return _around([*self.find("bounds")] or [*self.find("room")])

    @property
    def boxes(self) -> NDArray[np.float64]:
        """(n, 5) walls and furniture so far: cx, cy, half_x, half_y m, yaw rad; read-only."""
        if self._boxes is not None:
            return self._boxes
        walls = [
            [geom.pos[0], geom.pos[1], geom.size[0], geom.size[1], yaw_of(geom)]
            for geom in self.spec.geoms
            if geom.name.partition(":")[0] in look.WALLS
        ]
        boxes = np.array(walls + self._furniture, dtype=np.float64).reshape(-1, 5)
        boxes.setflags(write=False)
        return boxes

    def furnish(self, part: str, pose: Pose) -> None:
        """Put a static part, named by its kind and number ("desk0", "desk1", ...).

        Its ``seat:...`` marks become seats of the plan.
        """
        kind = Path(part).stem
        self._parts.put(part, f"{kind}{self._counts[kind]}", pose)
        self._counts[kind] += 1
        for mark in part_marks(part):
            place = moved(pose, mark.pose)
            if mark.words[0].startswith("footprint"):
                self._furniture.append([place[0], place[1], *mark.half, place[2]])
                if mark.words[0] == "footprint_top":
                    self._add_apron(place, mark.half)
            elif mark.words[0] == "seat":
                self.seats.append(Mark(words=mark.words, pose=place, half=mark.half))

    def _add_apron(self, place: Pose, half: tuple[float, float]) -> None:
        """Keep chairs out from under a top, which their backs would stick through."""
        self.spec.worldbody.add_geom(
            name=f"apron:{len(self._furniture)}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[place[0], place[1], APRON_HALF],
            size=[*half, APRON_HALF],
            quat=quaternion(place[2]),
            contype=APRON,
            conaffinity=0,
            group=HIDDEN,
        )

    def furnish_marks(self, parts: Sequence[str]) -> None:
        """Put each of these parts wherever a mark starts with its name, or says ``put`` and it.

        What can move, and is put so, becomes part of ``put``: a kind and its pose.
        """
        stands = {Path(part).stem: part for part in parts}
        self._kinds |= set(stands)
        for kind, part in stands.items():
            for mark in self.find(kind):
                self.furnish(part, mark.pose)
        moves = [kind for kind, row in KINDS.items() if row.group in PUSHED]
        for mark in self.find("put"):
            if mark.words[1] in stands:
                self.furnish(stands[mark.words[1]], mark.pose)
            elif mark.words[1] in moves:
                self.put.append((mark.words[1], mark.pose))
            else:
                raise InvalidValueError(
                    f"plan '{self._source}': mark '{':'.join(mark.words)}' has the unknown kind "
                    f"'{mark.words[1]}'. There are: {', '.join(sorted((*stands, *moves)))}"
                )

    def frame_doors(self) -> None:
        """Jambs and threshold at each ``door:ROOM:left|right`` mark."""
        for mark in self.find("door"):
            side = JAMB_OFFSET if mark.words[2] == "right" else -JAMB_OFFSET
            self.furnish("door_frame", moved(mark.pose, (0.0, side, 0.0)))

    def wall(
        self, name: str, pos: tuple[float, float], half: tuple[float, float], yaw: float = 0.0
    ) -> None:
        """A wall of its usual height."""
        self.spec.worldbody.add_geom(
            name=f"wall:{name}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[*pos, 0.5 * WALL_HEIGHT],
            size=[*half, 0.5 * WALL_HEIGHT],
            quat=quaternion(yaw),
            material="wall",
            contype=1,
            conaffinity=0,
            group=0,
        )

    def floor(
        self, name: str, pos: tuple[float, float], half: tuple[float, float], material: str
    ) -> None:
        """A floor, which must be among the plan's or ``floors`` to be painted."""
        self.spec.worldbody.add_geom(
            name=f"floor:{name}",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            pos=[*pos, 0.0],
            size=[*half, 0.1],
            material=material,
            contype=0,
            conaffinity=0,
            group=0,
            castshadow=False,
        )

    def glaze(self, name: str) -> None:
        """Make a wall or parapet one pane of glass from the floor up."""
        for kind in ("wall", "parapet"):
            geom = self.spec.geom(f"{kind}:{name}")
            if geom is None:
                continue
            thin = 0 if geom.size[0] < geom.size[1] else 1
            size = [float(v) for v in geom.size]
            size[thin], size[2] = GLASS_HALF, 0.5 * WALL_HEIGHT
            geom.name, geom.material, geom.castshadow = f"glass:{name}", "glass", False
            geom.size, geom.pos = size, [geom.pos[0], geom.pos[1], 0.5 * WALL_HEIGHT]
            return
        raise InvalidValueError(f"the plan has no wall or parapet '{name}' to glaze")

    def hide_walls(self) -> None:
        """Keep walls for what rolls against them, but out of sight of rays and cameras."""
        for geom in self.spec.geoms:
            if geom.name.partition(":")[0] in look.WALLS:
                geom.group = HIDDEN

    def finish(self) -> "Plan":
        """Put the parts in, dress the walls, add cameras where none are.

        Raises ``InvalidValueError`` for marks and materials that there are not, and rooms too wide.
        """
        what = f"plan '{self._source}'"
        check_marks(self._source, self.marks, {*furniture(), *self._kinds})
        check_length(what, map(length_of, self.spec.geoms))
        boxes, goals = [*self.find("bounds"), *self.find("room")], len([*self.find("goal")])
        check_span(what, _around(boxes), goals)
        check_materials(self.spec, self.spec.geoms, what)
        if self._file:  # what MuJoCo refuses of it is told with its line
            compiled(self.spec.copy(), self._file)
        self._parts.into(self.spec)
        self._boxes = self.boxes
        look.trim_walls(self.spec)
        add_cameras(self.spec, self.bounds)
        return self


def _around(boxes: Sequence[Mark]) -> Bounds:
    low = [min(mark.rect[i] for mark in boxes) for i in (0, 1)]
    high = [max(mark.rect[i] for mark in boxes) for i in (2, 3)]
    return low[0], low[1], high[0], high[1]


@cache
def furniture() -> tuple[str, ...]:
    """Names of our parts that a mark can put: neither movers nor what comes with a door."""
    placed_by_recipes = {*KINDS, "door_frame"}
    return tuple(name for name in ours("parts") if name not in placed_by_recipes)


@cache
def _parsed(
    source: str, floors: tuple[str, ...], _written: int
) -> tuple[mujoco.MjSpec, tuple[Mark, ...]]:
    """The file without its marks, floors painted, all clothes in the wardrobe; copy before use."""
    spec = parsed("plans", source)
    found = marks(spec)
    check_written(Path(source).name, found)
    for site in list(spec.sites):
        spec.delete(site)
    look.paint_floors(spec, floors)
    look.fill_wardrobe(spec)
    return spec, found
