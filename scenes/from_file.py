# SPDX-License-Identifier: Apache-2.0
"""Scenes by file: a plan in MJCF alone, or a recipe in TOML that draws or names one and fills it.

The path of such a file is the name of a scene wherever one is asked for. docs/scenes.md lists the
keys. A file is data: it names no code.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from scenes.assembly import reach_of
from scenes.builder import Builder
from scenes.kinds import KINDS
from scenes.placement import gap_to_boxes
from scenes.plan import Plan, furniture
from scenes.recipe import (
    DOORS,
    MARGIN,
    START_RADIUS,
    Draws,
    choice,
    count,
    finish,
    free_floor,
    hang_doors,
    put_bins,
    scatter,
    seat_chairs,
    switch,
)
from scenes.scene import Pose, Scene
from slam.bounded import check_file, text_of
from slam.errors import InvalidValueError

MAX_BYTES = 1 << 22
MAX_LINES = 5000  # walls, things, doors or pieces of furniture of a file
WALL_M = 0.1  # thickness of a drawn wall
FURNITURE = ("move", "keep", "drop")
KEYS = ("plan", "walls", "wall_m", "floor", "rooms", "goals", "start", "put", "things", "hinges")
OPTIONS = ("furniture", "doors", "seats", "n_chairs", "n_people")
MORE = ("event", "robot")  # read by others (``sim``)


def tables(path: Path) -> dict[str, Any]:
    """What a TOML file of a scene holds; ``InvalidValueError`` names the file and the line."""
    try:
        found = tomllib.loads(text_of(path, MAX_BYTES))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InvalidValueError(f"{path}: no TOML: {error}") from error
    for key in found:
        if key not in (*KEYS, *OPTIONS, *MORE):
            known = ", ".join((*KEYS, *OPTIONS, *MORE))
            raise InvalidValueError(f"{path}: unknown key '{key}', expected one of {known}")
    return found


def recipe(name: str) -> Callable[..., Scene]:
    """The recipe of the scene in a file; ``LogFormatError`` where there is no such file."""
    path = Path(name)
    check_file(path)

    def from_file(  # noqa: PLR0913 (options of a scene)
        seed: int,
        *,
        n_chairs: int | None = None,
        n_people: int | None = None,
        doors: str | None = None,
        furniture: str | None = None,
        seats: bool | None = None,
    ) -> Scene:
        given = dict(
            n_chairs=n_chairs, n_people=n_people, doors=doors, furniture=furniture, seats=seats
        )
        own = tables(path) if path.suffix == ".toml" else {}
        return _Filling(path, own, given).scene(seed)

    return from_file


class _Filling:
    """One file and what was asked for."""

    def __init__(self, path: Path, own: Mapping[str, Any], given: Mapping[str, Any]) -> None:
        self.path, self.own = path, own
        wanted = {key: own.get(key) if given[key] is None else given[key] for key in OPTIONS}
        wanted = {key: value for key, value in wanted.items() if value is not None}
        self.furniture = choice("furniture", wanted.get("furniture", "move"), FURNITURE)
        self.doors = choice("doors", wanted.get("doors", "open"), ("none", *DOORS))
        self.seats = switch("seats", wanted.get("seats", True))
        self.n_chairs = count("n_chairs", wanted.get("n_chairs"), 0)
        self.n_people = count("n_people", wanted.get("n_people"), 0)

    def scene(self, seed: int) -> Scene:
        """The scene of that seed."""
        drawn, movers = _plan(
            str(self.path.resolve()),
            self._stamps(),
            self.furniture,
            self.doors != "none",
            self.seats,
        )
        builder, draws = Builder(drawn), Draws(seed)
        hang_doors(builder, draws.doors, "open" if self.doors == "none" else self.doors)
        put_bins(builder, draws.bins)
        for kind, pose in movers:
            row = KINDS[kind]
            name = "chair" if row.group == "chair" else kind
            n = sum(m.name.rstrip("0123456789") == name for m in builder.movers)
            builder.add(kind, f"{name}{n}", pose)
        floor = free_floor(builder)
        n_own = sum(m.group == "chair" for m in builder.movers)
        seat_chairs(builder, floor, drawn.seats, n_own + self.n_chairs, draws)
        scatter(builder, floor, "person", self.n_people, draws, draws.people)
        options = {"furniture": self.furniture, "doors": self.doors, "seats": self.seats,
                   "n_chairs": self.n_chairs, "n_people": self.n_people}  # fmt: skip
        return finish(builder, self.path.stem, seed, options)

    def _stamps(self) -> tuple[int, ...]:
        """That of the files which the plan is made of, so that an edited one is read again."""
        files = [self.path]
        if "plan" in self.own:
            files.append(_plan_file(self.path, self.own))
        return tuple(v for f in files for v in (f.stat().st_mtime_ns, f.stat().st_size))


@lru_cache(maxsize=16)
def _plan(
    file: str, stamps: tuple[int, ...], kept: str, doors: bool, seats: bool
) -> tuple[Plan, tuple[tuple[str, Pose], ...]]:
    del stamps
    path = Path(file)
    own = tables(path) if path.suffix == ".toml" else {}
    if path.suffix == ".xml" or "plan" in own:
        plan = Plan(str(_plan_file(path, own)))
    else:
        plan = _drawn(path, own)
    if not seats:
        plan.seats = []
    plan.furnish_marks(furniture())
    for part, pose in _put(path, own):
        if part not in KINDS:
            plan.furnish(part, pose)
    if not seats:
        plan.seats = list(plan.find("seat"))
    movers = [(kind, pose) for kind, pose in _put(path, own) if kind in KINDS]
    things = [] if kept == "drop" else _things(path, own)
    standing: list[tuple[float, float, float, float, float]] = []
    for kind, pose, boxes in things:
        if kept == "move" and _has_room(kind, pose, movers, plan):
            movers.append((kind, pose))
        else:
            standing += boxes
    for k, (x, y, a, b, yaw) in enumerate(standing):
        plan.wall(f"thing{k}", (x, y), (a, b), yaw)
    if doors:
        for k, (hand, pose) in enumerate(_hinges(path, own)):
            plan.mark(f"door:{k}:{hand}", pose)
        plan.frame_doors()
    else:
        plan.marks = tuple(mark for mark in plan.marks if mark.words[0] != "door")
    return plan.finish(), tuple(movers)


def _has_room(kind: str, pose: Pose, movers: Sequence[tuple[str, Pose]], plan: Plan) -> bool:
    """Whether a thing may move: it touches neither what stands nor what moves, and not the robot."""
    radius, at = reach_of(kind), pose[:2]
    if gap_to_boxes(np.array([at]), plan.boxes)[0] < radius + MARGIN:
        return False
    if math.dist(at, plan.start[:2]) < START_RADIUS + radius:
        return False
    apart = (math.dist(at, other[:2]) - reach_of(one) for one, other in movers)
    return all(gap >= radius + MARGIN for gap in apart)


def _plan_file(path: Path, own: Mapping[str, Any]) -> Path:
    if path.suffix == ".xml":
        return path
    name = own["plan"]
    if not isinstance(name, str) or not name.endswith(".xml") or "\0" in name:
        raise InvalidValueError(f"{path}: plan must be the name of an .xml file, got {name!r:.200}")
    return path.parent / name


def _drawn(path: Path, own: Mapping[str, Any]) -> Plan:
    """The plan of ``walls`` and what else a TOML file draws."""
    raise NotImplementedError


def _list(path: Path, own: Mapping[str, Any], key: str) -> list[Any]:
    value = own.get(key, [])
    if not isinstance(value, list) or len(value) > MAX_LINES:
        raise InvalidValueError(f"{path}: {key} must be a list of at most {MAX_LINES}")
    return value


def _numbers(path: Path, where: str, value: object, n: int) -> list[float]:
    good = isinstance(value, list) and len(value) == n
    if good and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value):  # type: ignore[union-attr]
        found = [float(v) for v in value]  # type: ignore[union-attr]
        if all(math.isfinite(v) and abs(v) < 1e5 for v in found):
            return found
    raise InvalidValueError(f"{path}: {where} must be {n} finite numbers, got {value!r:.200}")


def _pose(path: Path, where: str, value: object) -> Pose:
    x, y, degrees = _numbers(path, where, value, 3)
    return x, y, math.radians(degrees)


def _put(path: Path, own: Mapping[str, Any]) -> list[tuple[str, Pose]]:
    """``[kind, x, y, degrees]`` each."""
    found = []
    for k, row in enumerate(_list(path, own, "put")):
        where = f"put[{k}]"
        if not isinstance(row, list) or len(row) != 4:
            raise InvalidValueError(
                f"{path}: {where} must be [kind, x, y, degrees], got {row!r:.200}"
            )
        kind = _kind(path, where, row[0], furniture())
        found.append((kind, _pose(path, where, row[1:])))
    return found


def _kind(path: Path, where: str, kind: object, fixed: Sequence[str]) -> str:
    movers = [k for k, row in KINDS.items() if row.group in ("chair", "bin", "load")]
    if kind not in (*movers, *fixed):
        near = ", ".join(sorted((*movers, *fixed)))
        raise InvalidValueError(f"{path}: {where}: unknown kind {kind!r:.80}. There are: {near}")
    return str(kind)


def _things(
    path: Path, own: Mapping[str, Any]
) -> list[tuple[str, Pose, list[tuple[float, float, float, float, float]]]]:
    """Kind and pose of what moves, and the boxes that stand in its place."""
    found = []
    for k, row in enumerate(_list(path, own, "things")):
        where = f"things[{k}]"
        if not isinstance(row, dict) or set(row) != {"kind", "at", "boxes"}:
            raise InvalidValueError(
                f"{path}: {where} must have kind, at and boxes, got {row!r:.200}"
            )
        boxes = []
        for box in row["boxes"] if isinstance(row["boxes"], list) else [None]:
            x, y, long, wide, degrees = _numbers(path, f"{where}.boxes", box, 5)
            if not min(long, wide) > 0.0:
                raise InvalidValueError(f"{path}: {where}.boxes must have sizes > 0, got {box}")
            boxes.append((x, y, 0.5 * long, 0.5 * wide, math.radians(degrees)))
        found.append(
            (_kind(path, where, row["kind"], ()), _pose(path, f"{where}.at", row["at"]), boxes)
        )
    return found


def _hinges(path: Path, own: Mapping[str, Any]) -> list[tuple[str, Pose]]:
    found = []
    for k, row in enumerate(_list(path, own, "hinges")):
        where = f"hinges[{k}]"
        if not isinstance(row, list) or len(row) != 4 or row[3] not in ("left", "right"):
            raise InvalidValueError(
                f'{path}: {where} must be [x, y, degrees, "left" or "right"], got {row!r:.200}'
            )
        found.append((str(row[3]), _pose(path, where, row[:3])))
    return found
