# SPDX-License-Identifier: Apache-2.0
"""What happens at stated times: a chair is pushed, a door opened, people enter, the robot carried.

[[event]]
at_s = 12
push = "chair3"
towards_m = [2.0, 1.0]

Each event has ``at_s`` and one of ``push``, ``open``, ``shut``, ``enter`` and ``carry``
(``docs/scenes.md``). It happens before the first scan from then on; the robot is carried, and
people enter, as soon as the place is free.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from scenes.assembly import hull_radius
from scenes.scene_file import changed, tables
from sim.world import hands
from sim.world.populated import VISITOR
from sim.world.requests import Kidnap, MoveDoor, Push, carry_out
from sim.world.robots import robot_of
from sim.world.world import World
from slam.bounded import beside, toml_of
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError
from slam.frames import NS_PER_S
from slam.shaped import Metres, Table, Word, shaped

MOST_EVENTS, MOST_BYTES = 1000, 1 << 18
MOST_ENTER, MOST_VISITORS = 20, 400  # people, of one event and of all
RINGS_M, ROUND = (0.9, 1.3, 1.7, 2.1, 2.5, 2.9), 16  # where people enter around a door or a goal
_Place = tuple[Metres, Metres]  # beside it no ``Word``: msgspec 0.22 then crashes the collector
_Degrees = Annotated[float, Meta(ge=-360.0, le=360.0)]


@dataclass(frozen=True, kw_only=True)
class Enter:
    """``n`` people come in by a door or a goal, or at a place (x m, y m)."""

    n: int
    by: str | tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Cue:
    """A request and its time, s of the world."""

    at_s: float
    request: Push | MoveDoor | Kidnap | Enter


class _Event(Table, frozen=True, kw_only=True):
    at_s: Annotated[float, Meta(ge=0.0, le=1e6)]


class _Push(_Event, frozen=True, kw_only=True):
    push: Word
    towards_m: _Place | None = None
    heading_deg: _Degrees | None = None
    speed_mps: float = 1.0

    def request(self) -> Push:
        if self.towards_m is not None and self.heading_deg is not None:
            raise InvalidValueError("towards_m and heading_deg exclude each other")
        heading = None if self.heading_deg is None else math.radians(self.heading_deg)
        return Push(name=self.push, speed=self.speed_mps, heading=heading, towards=self.towards_m)


class _Door(_Event, frozen=True, kw_only=True):
    open: Word | None = None
    shut: Word | None = None
    for_s: float = 20.0

    def request(self) -> MoveDoor:
        name = self.shut if self.open is None else self.open
        return MoveDoor(opened=self.open is not None, name=name or "", seconds=self.for_s)


class _Carry(_Event, frozen=True, kw_only=True):
    carry: str | _Place
    heading_deg: _Degrees = 0.0

    def request(self) -> Kidnap:
        if isinstance(self.carry, str):
            return Kidnap(goal=self.carry)
        return Kidnap(pose=(*self.carry, math.radians(self.heading_deg)))


class _Enter(_Event, frozen=True, kw_only=True):
    enter: Annotated[int, Meta(ge=1, le=MOST_ENTER)]
    by: str | _Place

    def request(self) -> Enter:
        return Enter(
            n=self.enter, by=shaped("by", self.by, Word) if isinstance(self.by, str) else self.by
        )


_EVENTS = {"push": _Push, "open": _Door, "shut": _Door, "enter": _Enter, "carry": _Carry}


def read_events(path: str | Path) -> list[dict[str, Any]]:
    """The ``[[event]]`` tables of a TOML file, checked.

    Raises ``LogFormatError`` that names the file, the event and its field.
    """
    path = Path(path)
    tables = toml_of(path, MOST_BYTES)
    rows = tables.get("event")
    if set(tables) != {"event"} or not isinstance(rows, list) or not rows:
        raise LogFormatError(
            path, f"expected [[event]] tables alone, got {', '.join(tables)!r:.80}"
        )
    try:
        cues_of(rows)
    except InvalidValueError as error:
        raise LogFormatError(path, str(error)) from error
    return rows


def of_file(scene: object, sha256: str | None = None) -> dict[str, Any]:
    """``events`` and ``robot`` that a scene's own TOML file holds; nothing for other scenes.

    Raises ``LogFormatError`` for a scene whose files have another hash than that, and for what is
    wrong in these.
    """
    if isinstance(scene, str) and (why := changed(scene, sha256)):
        raise LogFormatError(scene, why)
    if not (isinstance(scene, str) and scene.endswith(".toml")):
        return {}
    own = tables(Path(scene))
    found = {new: own[key] for key, new in (("event", "events"), ("robot", "robot")) if key in own}
    if isinstance(own.get("robot"), str) and own["robot"].endswith(".toml"):
        found["robot"] = str(beside(Path(scene), own["robot"]))
    try:
        cues_of(found.get("events", ()))
        if "robot" in found:
            robot_of(found["robot"])
    except (InvalidValueError, UnknownNameError) as error:
        raise LogFormatError(scene, str(error)) from error
    return found


def cues_of(rows: Sequence[Mapping[str, Any]]) -> tuple[Cue, ...]:
    """Events in the order of their times; ``InvalidValueError`` names the event and its field."""
    if not isinstance(rows, list | tuple) or len(rows) > MOST_EVENTS:
        raise InvalidValueError(f"events must be at most {MOST_EVENTS} tables, got {rows!r:.80}")
    cues = [_cue(f"event {k + 1}", row) for k, row in enumerate(rows)]
    if visitors(cues) > MOST_VISITORS:
        raise InvalidValueError(
            f"events: {visitors(cues)} people enter, expected at most {MOST_VISITORS}"
        )
    return tuple(sorted(cues, key=lambda cue: cue.at_s))


def _cue(where: str, row: Mapping[str, Any]) -> Cue:
    does = [key for key in _EVENTS if isinstance(row, Mapping) and key in row]
    if len(does) != 1:
        raise InvalidValueError(f"{where} must have one of {', '.join(_EVENTS)}, got {row!r:.80}")
    event = shaped(where, row, _EVENTS[does[0]])
    try:
        return Cue(at_s=event.at_s, request=event.request())
    except InvalidValueError as error:
        raise InvalidValueError(f"{where}: {error}") from error


def visitors(cues: Sequence[Cue]) -> int:
    """How many people enter."""
    return sum(cue.request.n for cue in cues if isinstance(cue.request, Enter))


class Script:
    """Lets the events of a world happen; ``source``: whose they are, for the errors.

    Raises ``UnknownNameError`` for a thing, door or goal that the world does not have, and
    ``InvalidValueError`` for a robot that would be carried into a wall.
    """

    def __init__(self, cues: Sequence[Cue], world: World, source: str = "") -> None:
        self._cues, self.done = tuple(cues), [False] * len(cues)
        guests = [name for name in world.people.names if name.startswith(VISITOR)]
        self._guests: list[list[str]] = []
        for k, cue in enumerate(cues):
            try:
                _check(cue.request, world)
            except (UnknownNameError, InvalidValueError) as error:
                where = f"{source}: event" if source else "event"
                raise type(error)(f"{where} at {cue.at_s:g} s: {error}") from error
            n, first = visitors([cue]), visitors(cues[:k])
            self._guests.append(guests[first : first + n])

    def happen(self, world: World) -> None:
        """Between two scans: what is due and can be done."""
        for k, cue in enumerate(self._cues):
            if self.done[k] or world.time_ns < round(cue.at_s * NS_PER_S):
                continue
            if isinstance(cue.request, Enter):
                self.done[k] = _enter(world, self._guests[k], cue.request)
                continue
            try:
                carry_out(world, cue.request)
            except InvalidValueError:
                if not isinstance(cue.request, Kidnap):
                    raise
                continue  # somebody stands there: at the next scan
            self.done[k] = True


def _check(request: Push | MoveDoor | Kidnap | Enter, world: World) -> None:
    if isinstance(request, Push):
        _known(request.name, hands.pushable(world), "thing to push")
    elif isinstance(request, MoveDoor):
        _known(request.name, world.doors.names, "door")
    elif isinstance(request, Enter):
        if isinstance(request.by, str):
            _known(request.by, [*world.doors.names, *world.scene.goals], "door or goal")
        if not _free(world, request.by, 1):
            raise InvalidValueError(f"nobody finds room to enter by {request.by}")
    elif request.pose is not None:
        taken = hands.walled(world, *request.pose[:2])
        if taken:
            raise InvalidValueError(f"the robot cannot be carried to {request.pose[:2]}: {taken}")
    else:
        _known(request.goal, list(world.scene.goals), "goal")


def _known(name: str, names: Sequence[str], what: str) -> None:
    if name not in names and (name or not names):
        raise UnknownNameError(
            f"there is no {what} '{name:.80}' here, only: {', '.join(names) or 'none'}"
        )


def _enter(world: World, guests: Sequence[str], request: Enter) -> bool:
    """Put people where they enter; whether there is room for all of them."""
    places = _free(world, request.by, len(guests))
    if len(places) < len(guests):
        return False
    world.admit(guests, np.array(places[: len(guests)]))
    return True


def _free(world: World, by: str | tuple[float, float], n: int) -> list[tuple[float, float, float]]:
    """Up to ``n`` free poses around a door, goal or place, on the robot's side, nearest first."""
    rx, ry, _ = world.robot_pose().tolist()
    if isinstance(by, str) and by in world.doors.names:
        x, y = world.doors.middles[world.doors.names.index(by)].tolist()
    else:
        x, y = world.scene.goals[by] if isinstance(by, str) else by
    radius = hull_radius("person")
    found: list[tuple[float, float, float]] = []
    for ring in RINGS_M:
        for step in range(ROUND):
            angle = math.tau * step / ROUND
            px, py = x + ring * math.cos(angle), y + ring * math.sin(angle)
            facing = (px - x) * (rx - x) + (py - y) * (ry - y) >= 0.0
            apart = all(math.hypot(px - ox, py - oy) > 2.0 * radius + 0.1 for ox, oy, _ in found)
            if facing and apart and not hands.in_the_way(world, px, py, radius):
                found.append((px, py, angle))
            if len(found) == n:
                return found
    return found
