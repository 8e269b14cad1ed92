# SPDX-License-Identifier: Apache-2.0
"""What a client may ask for, and how its words are read: bounded, checked, never run.

Each service takes one flat JSON object. ``SERVICES`` says which fields; the same table makes the
schemas that the server announces.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from sim.world.hands import MOST_HOLD_S, MOST_SPEED
from slam.errors import InvalidValueError

MOST_BYTES = 1 << 14  # of a message from a client; a stamped twist has about 300
MOST_LETTERS = 100  # of a name
FAR_M = 1e6  # no place of a scene is farther away
MOST_TWIST = 1e3  # m/s and rad/s; the drive clips to what it can do
MOST_SCANS = 1000  # of a step


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Twist for the robot, m/s and rad/s."""

    v: float
    omega: float


@dataclass(frozen=True, kw_only=True)
class Tour:
    """The built-in driver is to go on."""


@dataclass(frozen=True, kw_only=True)
class Push:
    """Push a thing; "" for the nearest to the robot. ``heading`` rad, None: away from the robot."""

    name: str = ""
    speed: float = 1.0
    heading: float | None = None


@dataclass(frozen=True, kw_only=True)
class MoveDoor:
    """Hold a door, "" for the nearest to the robot, open or shut for so long, s."""

    opened: bool
    name: str = ""
    seconds: float = 20.0


@dataclass(frozen=True, kw_only=True)
class Touch:
    """A click at (x, y) m in ``frame``: push the thing there away from the robot, open the door."""

    x: float
    y: float
    frame: str = ""


@dataclass(frozen=True, kw_only=True)
class Kidnap:
    """Carry the robot to a pose (m, m, rad) in ``frame``, to a goal, or to the farthest goal."""

    pose: tuple[float, float, float] | None = None
    goal: str = ""
    frame: str = ""


@dataclass(frozen=True, kw_only=True)
class Run:
    """Play or pause."""

    playing: bool


@dataclass(frozen=True, kw_only=True)
class Step:
    """So many scans, then pause."""

    scans: int = 1


@dataclass(frozen=True, kw_only=True)
class Seek:
    """Show the moment that is ``time_s`` since the start, or ``back_s`` before the present.

    nearest  take the nearest moment that is kept where that one is not
    """

    time_s: float | None = None
    back_s: float | None = None
    nearest: bool = False


@dataclass(frozen=True, kw_only=True)
class Speed:
    """How fast the view goes, 1 is real time."""

    factor: float


OnWorld = Drive | Tour | Push | MoveDoor | Touch | Kidnap
OnView = Run | Step | Seek | Speed
Request = OnWorld | OnView


@dataclass(frozen=True, kw_only=True)
class Number:
    """A field that is a finite number in [low, high]."""

    low: float
    high: float
    says: str
    whole: bool = False


@dataclass(frozen=True, kw_only=True)
class Word:
    """A field that is a name."""

    says: str


@dataclass(frozen=True, kw_only=True)
class Service:
    """A service: what it does, its fields, none of which must be given, and how it is read."""

    says: str
    make: Callable[[dict[str, Any]], Request]
    fields: Mapping[str, Number | Word]

    def read(self, name: str, data: bytes) -> Request:
        """The request in a message; ``InvalidValueError`` for one that is none."""
        return self.make(_checked(name, json_object(name, data) if data else {}, self.fields))

    def schema(self, name: str) -> bytes:
        """JSON schema of its request."""
        properties: dict[str, Any] = {}
        for key, field in self.fields.items():
            if isinstance(field, Word):
                properties[key] = {"type": "string", "description": field.says}
                continue
            properties[key] = {
                "type": "integer" if field.whole else "number", "description": field.says,
                "minimum": field.low, "maximum": field.high,
            }  # fmt: skip
        whole = {"title": name, "description": self.says, "type": "object"}
        return json.dumps({**whole, "properties": properties}).encode()


_NAME = Word(says="name in the scene; default the nearest to the robot")
_HEADING = Number(low=-3600.0, high=3600.0, says="deg in the world")
_FOR = Number(low=0.1, high=MOST_HOLD_S, says="s that it is held so; default 20")


def _push(given: dict[str, Any]) -> Push:
    heading = given.get("heading_deg")
    return Push(
        name=given.get("name", ""),
        speed=given.get("speed_mps", 1.0),
        heading=None if heading is None else math.radians(heading),
    )


def _door(opened: bool) -> Callable[[dict[str, Any]], MoveDoor]:
    def make(given: dict[str, Any]) -> MoveDoor:
        return MoveDoor(
            opened=opened, name=given.get("name", ""), seconds=given.get("seconds", 20.0)
        )

    return make


def _kidnap(given: dict[str, Any]) -> Kidnap:
    if "goal" in given:
        if len(given) > 1:
            raise InvalidValueError("kidnap takes a goal or a pose, got both")
        return Kidnap(goal=given["goal"])
    if not given:
        return Kidnap()
    if not {"x_m", "y_m"} <= given.keys():
        raise InvalidValueError("kidnap takes x_m and y_m together")
    return Kidnap(pose=(given["x_m"], given["y_m"], math.radians(given.get("heading_deg", 0.0))))


def _seek(given: dict[str, Any]) -> Seek:
    if len(given) != 1:
        raise InvalidValueError("seek takes one of time_s and back_s")
    return Seek(**given)


SERVICES: dict[str, Service] = {
    "play": Service(says="Let the view run", make=lambda _: Run(playing=True), fields={}),
    "pause": Service(says="Stop the view", make=lambda _: Run(playing=False), fields={}),
    "step": Service(
        says="Go on by some scans, then pause", make=lambda given: Step(**given),
        fields={"scans": Number(low=1, high=MOST_SCANS, says="how many, default 1", whole=True)},
    ),
    "seek": Service(
        says="Show a moment of the last minute; back_s 0 is the present", make=_seek,
        fields={
            "time_s": Number(low=0.0, high=1e9, says="s since the start"),
            "back_s": Number(low=0.0, high=1e9, says="s before the present"),
        },
    ),
    "push": Service(
        says="Push a chair, a bin or a load", make=_push,
        fields={
            "name": _NAME,
            "speed_mps": Number(low=0.05, high=MOST_SPEED, says="default 1 m/s"),
            "heading_deg": _HEADING,
        },
    ),
    "open_door": Service(
        says="Hold a door open", make=_door(True), fields={"name": _NAME, "seconds": _FOR}
    ),
    "close_door": Service(
        says="Hold a door shut", make=_door(False), fields={"name": _NAME, "seconds": _FOR}
    ),
    "kidnap": Service(
        says="Carry the robot elsewhere; default to the farthest goal", make=_kidnap,
        fields={
            "x_m": Number(low=-FAR_M, high=FAR_M, says="m in the world"),
            "y_m": Number(low=-FAR_M, high=FAR_M, says="m in the world"),
            "heading_deg": _HEADING,
            "goal": Word(says="instead: a goal of the scene"),
        },
    ),
    "tour": Service(says="Let the built-in driver go on", make=lambda _: Tour(), fields={}),
}  # fmt: skip


def json_object(what: str, data: bytes) -> dict[str, Any]:
    """The JSON object in a message of at most ``MOST_BYTES``; ``InvalidValueError`` for none."""
    if len(data) > MOST_BYTES:
        raise InvalidValueError(f"{what}: at most {MOST_BYTES} bytes, got {len(data)}")
    try:
        found = json.loads(data, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise InvalidValueError(f"{what}: no JSON: {error!s:.100}") from error
    if not isinstance(found, dict):
        raise InvalidValueError(f"{what}: expected a JSON object, got {type(found).__name__}")
    return found


def _no_number(word: str) -> float:
    raise InvalidValueError(f"{word} is no number of JSON")


def _checked(
    what: str, given: Mapping[str, Any], fields: Mapping[str, Number | Word]
) -> dict[str, Any]:
    checked: dict[str, Any] = {}
    for key, value in given.items():
        field = fields.get(key)
        if field is None:
            known = ", ".join(fields) or "none"
            raise InvalidValueError(f"{what}: no field '{key:.40}', fields: {known}")
        checked[key] = _of_field(f"{what}.{key}", value, field)
    return checked


def _of_field(what: str, value: Any, field: Number | Word) -> Any:
    if isinstance(field, Word):
        if not isinstance(value, str) or len(value) > MOST_LETTERS or not value.isprintable():
            raise InvalidValueError(
                f"{what} must be a name of up to {MOST_LETTERS} letters, got {value!r:.60}"
            )
        return value
    number = within(what, value, field.low, field.high)
    if not field.whole:
        return number
    if number != round(number):
        raise InvalidValueError(f"{what} must be a whole number, got {number}")
    return round(number)


def within(what: str, value: Any, low: float, high: float) -> float:
    """A finite number in [low, high]; ``InvalidValueError`` for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidValueError(f"{what} must be a number, got {value!r:.60}")
    if not low <= value <= high:
        raise InvalidValueError(f"{what} must lie in [{low:g}, {high:g}], got {value!r:.60}")
    return float(value)
