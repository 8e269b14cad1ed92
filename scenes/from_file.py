# SPDX-License-Identifier: Apache-2.0
"""Scenes by file: a plan in MJCF alone, or a TOML file that draws or names one and fills it.

The path of such a file is the name of a scene wherever one is asked for. A file is data: it names
no code.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.assembly import moved, part_marks, reach_of
from scenes.from_map.survey import Cells, survey
from scenes.kinds import KINDS
from scenes.placement import gap_to_boxes
from scenes.plan import Plan, furniture
from scenes.plan_file import check_length, check_span
from scenes.recipe import MARGIN, START_RADIUS, Draws, finish, furnished
from scenes.scene import Pose, Scene
from scenes.scene_file import SceneFile, Thing, Wanted, pose_of, read
from slam.bounded import check_file
from slam.errors import InvalidValueError
from slam.shaped import shaped

CELL_M, RIM_M = 0.05, 0.6  # cells on which the floor inside drawn walls is found, and beyond them
BESIDE_M = 0.3  # a thing that near to a room is on its floor
MOST_MOVING = 800  # things; what is more stands, so that doors and people have room in the scene
FLOOR = "floor_concrete"
Rect5 = tuple[float, float, float, float, float]  # x, y, half sides m, yaw rad


def recipe(name: str) -> Callable[..., Scene]:
    """The recipe of the scene in a file; ``LogFormatError`` where there is no such file."""
    path = Path(name)
    check_file(path)

    def from_file(
        seed: int,
        *,
        n_chairs: int | None = None,
        n_people: int | None = None,
        doors: str | None = None,
        furniture: str | None = None,
        seats: bool | None = None,
    ) -> Scene:
        given = {
            "n_chairs": n_chairs, "n_people": n_people, "doors": doors, "furniture": furniture,
            "seats": seats,
        }  # fmt: skip
        file = read(path)
        asked = {key: value for key, value in given.items() if value is not None}
        said = {key: getattr(file, key) for key in file.given}
        try:
            return _scene(file, shaped("", {**said, **asked}, Wanted), seed)
        except InvalidValueError as error:
            if any(one in str(error) for one in (path.name, file.plan or path.name)):
                raise
            raise InvalidValueError(f"{path}: {error}") from None

    return from_file


def plan_of(file: SceneFile, wanted: Wanted) -> Plan:
    """The plan of a file; made once while the files stay as they are."""
    files = [Path(file.path), *([file.plan_path] if file.plan else [])]
    for path in files:
        check_file(path)
    stamps = [(path.stat().st_mtime_ns, path.stat().st_size) for path in files]
    return _plan(file, str(Path(file.path).resolve()), tuple(stamps), wanted)


def _scene(file: SceneFile, wanted: Wanted, seed: int) -> Scene:
    doors = "open" if wanted.doors == "none" else wanted.doors
    plan = plan_of(file, wanted)
    builder = furnished(plan, Draws(seed), wanted.n_chairs, wanted.n_people, doors)
    options = {key: getattr(wanted, key) for key in Wanted.__struct_fields__}
    return finish(builder, Path(file.path).stem, seed, options)


@lru_cache(maxsize=16)
def _plan(file: SceneFile, _path: str, _stamps: Any, wanted: Wanted) -> Plan:
    plan = Plan(str(file.plan_path)) if file.plan else _drawn(file)
    if wanted.doors == "none":
        plan.marks = tuple(mark for mark in plan.marks if mark.words[0] != "door")
    plan.furnish_marks(furniture())
    for part, pose in file.pieces:
        if part not in KINDS:
            plan.furnish(part, pose)
    if not wanted.seats:
        plan.seats = list(plan.find("seat"))
    plan.put, standing = _movers(file, wanted, plan)
    for k, (x, y, a, b, yaw) in enumerate(standing):
        plan.wall(f"thing{k}", (x, y), (a, b), yaw)
    for k, (x, y, yaw, hand) in enumerate(file.hinges if wanted.doors != "none" else ()):
        plan.mark(f"door:{k}:{hand}", pose_of(x, y, yaw))
    plan.frame_doors()
    return plan.finish()


def _movers(
    file: SceneFile, wanted: Wanted, plan: Plan
) -> tuple[list[tuple[str, Pose]], list[Rect5]]:
    """What moves, and the boxes of things that do not: kept, off the floor, or without room."""
    own = [(kind, pose) for kind, pose in file.pieces if kind in KINDS]
    movers, boxes = [*plan.put, *own], plan.boxes
    standing: list[Rect5] = []
    for thing in file.things if wanted.furniture != "drop" else ():
        on_floor = any(
            a - BESIDE_M <= thing.at[0] <= c + BESIDE_M
            and b - BESIDE_M <= thing.at[1] <= d + BESIDE_M
            for a, b, c, d in (mark.rect for mark in plan.find("room"))
        )
        room = (
            on_floor and len(movers) < MOST_MOVING and _has_room(thing, movers, boxes, plan.start)
        )
        if wanted.furniture == "move" and room:
            movers.append((thing.kind, pose_of(*thing.at)))
        else:
            standing += [(x, y, 0.5 * a, 0.5 * b, math.radians(c)) for x, y, a, b, c in thing.boxes]
    return movers, standing


def _has_room(
    thing: Thing, movers: Sequence[tuple[str, Pose]], boxes: NDArray[np.float64], start: Pose
) -> bool:
    """Whether a thing may move: it touches nothing that stands or moves, nor the robot."""
    radius, at = reach_of(thing.kind) + MARGIN, thing.at[:2]
    if gap_to_boxes(np.array([at]), boxes)[0] < radius:
        return False
    if math.dist(at, start[:2]) < START_RADIUS + radius:
        return False
    return all(math.dist(at, pose[:2]) >= radius + reach_of(one) for one, pose in movers)


def _footprints(file: SceneFile) -> NDArray[np.float64]:
    """(n, 5) boxes of the furniture that a file puts and that stays."""
    rows = [
        [*moved(pose, mark.pose)[:2], *mark.half, moved(pose, mark.pose)[2]]
        for part, pose in file.pieces
        if part not in KINDS
        for mark in part_marks(part)
        if mark.words[0].startswith("footprint")
    ]
    return np.array(rows).reshape(-1, 5)


def _drawn(file: SceneFile) -> Plan:
    """The plan of the walls that a file draws; what it does not say is found on the floor."""
    plan = Plan("blank", floors=(FLOOR,))
    half = 0.5 * file.wall_m
    boxes: list[list[float]] = []
    for line in file.walls:
        for (x, y), (u, v) in pairwise(line):
            length = math.hypot(u - x, v - y)
            middle, yaw = (0.5 * (x + u), 0.5 * (y + v)), math.atan2(v - y, u - x)
            plan.wall(str(len(boxes)), middle, (0.5 * length + half, half), yaw)
            boxes.append([*middle, 0.5 * length + half, half, yaw])
    points = np.array([point for line in file.walls for point in line])
    low, high = points.min(axis=0) - RIM_M, points.max(axis=0) + RIM_M
    check_span(file.path, (*low.tolist(), *high.tolist()))
    check_length(file.path, (2.0 * box[2] for box in boxes))
    shape = np.ceil((high - low) / CELL_M).astype(int)[::-1]
    cells = Cells(tuple(shape.tolist()), CELL_M, np.array([*low, 0.0]))
    corner = [*low, 0.0, 0.0, 0.0]
    local, stands = np.array(boxes) - corner, _footprints(file) - corner
    found = survey(
        cells, np.ones(cells.shape, dtype=bool), local, stands,
        start=None if file.start is None else pose_of(*file.start), source=file.path,
    )  # fmt: skip
    middle, size = 0.5 * (low + high), 0.5 * (high - low)
    plan.spec.stat.extent, plan.spec.stat.center = float(size.max() * 2), [*middle.tolist(), 0.0]
    plan.floor("all", tuple(middle.tolist()), tuple(size.tolist()), FLOOR)
    plan.mark("start:robot", found.start)
    rooms = {f"room{k}": rect for k, rect in enumerate(file.rooms)} or {
        f"{name}.{k}": rect for name, own in found.rooms.items() for k, rect in enumerate(own)
    }
    for name, (a, b, c, d) in rooms.items():
        plan.mark(
            f"room:{name}", (0.5 * (a + c), 0.5 * (b + d), 0.0), (0.5 * (c - a), 0.5 * (d - b))
        )
    for k, (x, y) in enumerate(file.goals or found.goals):
        plan.mark(f"goal:{k}", (x, y, 0.0))
    plan.mark("bounds:all", (*middle.tolist(), 0.0), (float(size[0]), float(size[1])))
    return plan
