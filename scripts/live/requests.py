# SPDX-License-Identifier: Apache-2.0
"""What a page may ask for: bounded and checked, whoever wrote it, and never run."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from scripts.live import FASTEST, SLOWEST
from slam.errors import InvalidValueError

MOST_LETTERS = 100  # of a name
FAR_M = 1e6  # no place of a scene is farther away
MOST_TWIST = 1e3  # m/s and rad/s; the drive clips to what it can do


def _number(low: float, high: float, default: Any = ...) -> Any:
    """A field for a finite number in [low, high]."""
    known = {} if default is ... else {"default": default}
    return field(metadata={"low": low, "high": high}, **known)


def _point(default: Any = ...) -> Any:
    """A field for three numbers that a place may have."""
    known = {} if default is ... else {"default": default}
    return field(metadata={"low": -FAR_M, "high": FAR_M, "three": True}, **known)


@dataclass(frozen=True, kw_only=True)
class Request:
    """Checked at birth: ``InvalidValueError`` names the field, the value and what was expected."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value, what = getattr(self, one.name), f"{type(self).__name__.lower()}: {one.name}"
            if value is None and one.default is None:
                continue
            if one.metadata.get("three"):
                if not isinstance(value, tuple) or len(value) != 3:
                    raise InvalidValueError(f"{what} must be three numbers, got {value!r:.60}")
                for number in value:
                    _check_number(what, number, one.metadata)
            elif "low" in one.metadata:
                _check_number(what, value, one.metadata)
            elif one.type == "bool":
                if not isinstance(value, bool):
                    raise InvalidValueError(f"{what} must be true or false, got {value!r:.60}")
            elif not isinstance(value, str) or len(value) > MOST_LETTERS or not value.isprintable():
                raise InvalidValueError(
                    f"{what} must be a name of up to {MOST_LETTERS} letters, got {value!r:.60}"
                )


def _check_number(what: str, value: Any, limits: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        raise InvalidValueError(f"{what} must be a number, got {value!r:.60}")
    low, high = limits["low"], limits["high"]
    if not low <= value <= high:
        raise InvalidValueError(f"{what} must lie in [{low:g}, {high:g}], got {value!r:.60}")


@dataclass(frozen=True, kw_only=True)
class Drive(Request):
    """Twist for the robot, m/s and rad/s."""

    v: float = _number(-MOST_TWIST, MOST_TWIST)
    omega: float = _number(-MOST_TWIST, MOST_TWIST)


@dataclass(frozen=True, kw_only=True)
class Tour(Request):
    """The built-in driver is to go on."""


@dataclass(frozen=True, kw_only=True)
class Push(Request):
    """Push a thing away from the robot; "" for the nearest."""

    name: str = ""


@dataclass(frozen=True, kw_only=True)
class MoveDoor(Request):
    """Hold a door, "" for the nearest to the robot, open or shut for a while."""

    opened: bool
    name: str = ""


@dataclass(frozen=True, kw_only=True)
class Kidnap(Request):
    """Carry the robot to (x m, y m, heading rad) in the world, or to the farthest goal."""

    pose: tuple[float, float, float] | None = _point(None)


@dataclass(frozen=True, kw_only=True)
class Click(Request):
    """A click on what is shown, as a ray in the world: touch what it hits, or carry the robot."""

    origin: tuple[float, float, float] = _point()
    direction: tuple[float, float, float] = _point()
    carry: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not any(self.direction):
            raise InvalidValueError("click: a ray must have a direction, got zeros")


@dataclass(frozen=True, kw_only=True)
class Run(Request):
    """Play or pause."""

    playing: bool


@dataclass(frozen=True, kw_only=True)
class Step(Request):
    """One scan, then pause."""


@dataclass(frozen=True, kw_only=True)
class Seek(Request):
    """Show the moment that is ``back_s`` before the present, or the one kept nearest to that."""

    back_s: float = _number(0.0, 1e9)


@dataclass(frozen=True, kw_only=True)
class Speed(Request):
    """How fast the view goes, 1 is real time."""

    factor: float = _number(SLOWEST, FASTEST)


@dataclass(frozen=True, kw_only=True)
class Anew(Request):
    """A new world from the same seed, or the log from its start, with another SLAM or more motion.

    slam, crowd  by name;   motion, change  0 to 1; None: as it was
    """

    slam: str | None = None
    motion: float | None = _number(0.0, 1.0, None)
    change: float | None = _number(0.0, 1.0, None)
    crowd: str | None = None


OnWorld = Drive | Tour | Push | MoveDoor | Kidnap | Click
OnView = Run | Step | Seek | Speed
