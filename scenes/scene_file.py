# SPDX-License-Identifier: Apache-2.0
"""What a TOML file of a scene says, checked before anything is built (docs/scenes.md)."""

from __future__ import annotations

import hashlib
import math
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenes import is_file
from scenes.kinds import KINDS, PUSHED
from scenes.plan import furniture
from scenes.recipe import DOORS, choice, count, switch
from scenes.scene import Pose
from slam.bounded import bytes_of, text_of
from slam.errors import InvalidValueError

Box = tuple[float, float, float, float, float]
Point = tuple[float, float]

MAX_BYTES, MAX_PLAN_BYTES = 1 << 22, 1 << 26
MAX_ROWS = 5000  # walls, things, doors or pieces of furniture
FURNITURE = ("move", "keep", "drop")
LISTS = ("walls", "rooms", "goals", "put", "things", "hinges")
OPTIONS = ("furniture", "doors", "seats", "n_chairs", "n_people")
MORE = ("event", "robot")  # read by others (``sim``)
KEYS = ("plan", "wall_m", "start", *LISTS, *OPTIONS, *MORE)


@dataclass(frozen=True, kw_only=True)
class Thing:
    """What moves, and the boxes (x, y, half length, half width m, yaw rad) that it is when not."""

    kind: str
    at: Pose
    boxes: tuple[Box, ...]


@dataclass(frozen=True, kw_only=True)
class SceneFile:
    """One file; ``read`` makes it.

    plan     the MJCF file of walls and marks; None where ``walls`` are drawn
    walls    polylines, (x, y) m each          wall_m  their thickness
    start    None: the first free place        rooms   xmin, ymin, xmax, ymax m; () for all floor
    put      kind and pose of furniture        hinges  "left" or "right", and the pose of a door's
    options  what the scene has unless it is asked for otherwise
    """

    path: Path
    plan: Path | None = None
    walls: tuple[tuple[Point, ...], ...] = ()
    wall_m: float = 0.1
    start: Pose | None = None
    rooms: tuple[tuple[float, float, float, float], ...] = ()
    goals: tuple[Point, ...] = ()
    put: tuple[tuple[str, Pose], ...] = ()
    things: tuple[Thing, ...] = ()
    hinges: tuple[tuple[str, Pose], ...] = ()
    options: tuple[tuple[str, Any], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """The options of a scene in a file, validated at birth.

    furniture  "move": things can be pushed, "keep": they stand, "drop": they are not there
    doors      "none", or how they rest          seats  whether tables bring chairs' places
    """

    furniture: str = "move"
    doors: str = "open"
    seats: bool = True
    n_chairs: int = 0
    n_people: int = 0

    def __post_init__(self) -> None:
        choice("furniture", self.furniture, FURNITURE)
        choice("doors", self.doors, ("none", *DOORS))
        switch("seats", self.seats)
        count("n_chairs", self.n_chairs, 0)
        count("n_people", self.n_people, 0)


def tables(path: Path) -> dict[str, Any]:
    """The keys of a TOML file; ``InvalidValueError`` names the file and what is wrong."""
    try:
        found = tomllib.loads(text_of(path, MAX_BYTES))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InvalidValueError(f"{path}: no TOML: {error}") from error
    for key in found:
        if key not in KEYS:
            raise InvalidValueError(
                f"{path}: unknown key '{key:.80}', expected one of {', '.join(KEYS)}"
            )
    return found


def read(path: Path) -> SceneFile:
    """What a file says: TOML, or MJCF alone. ``InvalidValueError`` names the file and the line."""
    if path.suffix == ".xml":
        return SceneFile(path=path, plan=path)
    return _Reading(path, tables(path)).made()


def files(path: Path) -> tuple[Path, ...]:
    """A scene's file, and those beside it that it names: its plan and its robot."""
    own = tables(path) if path.suffix == ".toml" else {}
    named = [name for name in (own.get("plan"), own.get("robot")) if isinstance(name, str)]
    return path, *(path.parent / name for name in named if is_file(name))


def sha256_of(scene: str) -> str | None:
    """Of all ``files`` of a scene by its file; None for another."""
    if not is_file(scene):
        return None
    each = [hashlib.sha256(bytes_of(f, MAX_PLAN_BYTES)).digest() for f in files(Path(scene))]
    return hashlib.sha256(b"".join(each)).hexdigest()


def changed(scene: str, sha256: str | None) -> str:
    """What says that a scene's files are others than those with that hash; "" where they are not,
    or where no hash is known."""
    now = sha256_of(scene) if sha256 is not None else None
    if now == sha256:
        return ""
    return f"is not what was recorded, it or its plan or robot: SHA-256 then {sha256}, now {now}"


class _Reading:
    """One file on its way to a ``SceneFile``."""

    def __init__(self, path: Path, own: dict[str, Any]) -> None:
        self.path, self.own = path, own

    def made(self) -> SceneFile:
        drawn, named = "walls" in self.own, "plan" in self.own
        if drawn == named:
            raise self._wrong("plan or walls", "one of the two", "both" if drawn else "neither")
        if named and {"rooms", "goals", "start"} & set(self.own):
            raise self._wrong("rooms, goals and start", "marks of the plan", "keys beside plan")
        options = {key: self.own[key] for key in OPTIONS if key in self.own}
        try:
            Wanted(**options)
        except InvalidValueError as error:
            raise InvalidValueError(f"{self.path}: {error}") from None
        return SceneFile(
            path=self.path,
            plan=self._plan() if named else None,
            walls=tuple(self._line(where, row) for where, row in self._rows("walls")),
            wall_m=self._numbers("wall_m", [self.own.get("wall_m", 0.1)], 1, least=0.01)[0],
            start=self._pose("start", self.own["start"]) if "start" in self.own else None,
            rooms=tuple(self._room(where, row) for where, row in self._rows("rooms")),
            goals=tuple(self._point(where, row) for where, row in self._rows("goals")),
            put=tuple(self._put(where, row) for where, row in self._rows("put")),
            things=tuple(self._thing(where, row) for where, row in self._rows("things")),
            hinges=tuple(self._hinge(where, row) for where, row in self._rows("hinges")),
            options=tuple(options.items()),
        )

    def _wrong(self, where: str, expected: str, got: object) -> InvalidValueError:
        return InvalidValueError(f"{self.path}: {where} must be {expected}, got {got!r:.200}")

    def _rows(self, key: str) -> Iterator[tuple[str, Any]]:
        rows = self.own.get(key, [])
        if not isinstance(rows, list) or len(rows) > MAX_ROWS:
            raise self._wrong(key, f"a list of at most {MAX_ROWS}", rows)
        return ((f"{key}[{k}]", row) for k, row in enumerate(rows))

    def _numbers(self, where: str, value: object, n: int, least: float = -1e4) -> tuple[float, ...]:
        if isinstance(value, list) and len(value) == n:
            numbers = [v for v in value if isinstance(v, int | float) and not isinstance(v, bool)]
            if len(numbers) == n and all(least <= v <= 1e4 for v in numbers):
                return tuple(float(v) for v in numbers)
        raise self._wrong(where, f"{n} numbers from {least:g} to 10000", value)

    def _point(self, where: str, value: object) -> Point:
        x, y = self._numbers(where, value, 2)
        return x, y

    def _pose(self, where: str, value: object) -> Pose:
        x, y, degrees = self._numbers(where, value, 3)
        return x, y, math.radians(degrees)

    def _plan(self) -> Path:
        name = self.own["plan"]
        if not isinstance(name, str) or not name.endswith(".xml") or "\0" in name:
            raise self._wrong("plan", "the name of an .xml file", name)
        return self.path.parent / name

    def _line(self, where: str, row: object) -> tuple[Point, ...]:
        if not isinstance(row, list) or not 2 <= len(row) <= MAX_ROWS:
            raise self._wrong(where, "two or more points [x, y]", row)
        return tuple(self._point(f"{where}[{k}]", point) for k, point in enumerate(row))

    def _room(self, where: str, row: object) -> tuple[float, float, float, float]:
        a, b, c, d = self._numbers(where, row, 4)
        if not (a < c and b < d):
            raise self._wrong(where, "[xmin, ymin, xmax, ymax]", row)
        return a, b, c, d

    def _kind(self, where: str, kind: object, fixed: tuple[str, ...]) -> str:
        known = sorted((*fixed, *(k for k, row in KINDS.items() if row.group in PUSHED)))
        if kind not in known:
            raise self._wrong(where, f"a kind that there is ({', '.join(known)})", kind)
        return str(kind)

    def _put(self, where: str, row: object) -> tuple[str, Pose]:
        if not isinstance(row, list) or len(row) != 4:
            raise self._wrong(where, "[kind, x, y, degrees]", row)
        return self._kind(where, row[0], furniture()), self._pose(where, row[1:])

    def _thing(self, where: str, row: object) -> Thing:
        if not isinstance(row, dict) or set(row) != {"kind", "at", "boxes"}:
            raise self._wrong(where, "a table of kind, at and boxes", row)
        if not isinstance(row["boxes"], list) or not 0 < len(row["boxes"]) <= 100:
            raise self._wrong(f"{where}.boxes", "1 to 100 boxes", row["boxes"])
        boxes = []
        for box in row["boxes"]:
            x, y, long, wide, degrees = self._numbers(f"{where}.boxes", box, 5)
            if min(long, wide) <= 0.0:
                raise self._wrong(f"{where}.boxes", "of length and width > 0", box)
            boxes.append((x, y, 0.5 * long, 0.5 * wide, math.radians(degrees)))
        kind = self._kind(f"{where}.kind", row["kind"], ())
        return Thing(kind=kind, at=self._pose(f"{where}.at", row["at"]), boxes=tuple(boxes))

    def _hinge(self, where: str, row: object) -> tuple[str, Pose]:
        if not isinstance(row, list) or len(row) != 4 or row[3] not in ("left", "right"):
            raise self._wrong(where, '[x, y, degrees, "left" or "right"]', row)
        return str(row[3]), self._pose(where, row[:3])
