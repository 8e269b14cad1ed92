# SPDX-License-Identifier: Apache-2.0
"""What a page may ask for: bounded and checked, whoever wrote it, and never run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from sim.world.hands import MOST_HOLD_S, MOST_SPEED
from slam.errors import InvalidValueError

MOST_LETTERS = 100  # of a name
FAR_M = 1e6  # no place of a scene is farther away
MOST_TWIST = 1e3  # m/s and rad/s; the drive clips to what it can do
MOST_SCANS = 1000  # of a step


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Twist for the robot, m/s and rad/s."""

    v: float
    omega: float

    def __post_init__(self) -> None:
        within("drive: v", self.v, -MOST_TWIST, MOST_TWIST)
        within("drive: omega", self.omega, -MOST_TWIST, MOST_TWIST)


@dataclass(frozen=True, kw_only=True)
class Tour:
    """The built-in driver is to go on."""


@dataclass(frozen=True, kw_only=True)
class Push:
    """Push a thing; "" for the nearest to the robot. ``heading`` rad, None: away from the robot."""

    name: str = ""
    speed: float = 1.0
    heading: float | None = None

    def __post_init__(self) -> None:
        word("push: name", self.name)
        within("push: speed", self.speed, 0.05, MOST_SPEED)
        within("push: heading", self.heading or 0.0, -100.0, 100.0)


@dataclass(frozen=True, kw_only=True)
class MoveDoor:
    """Hold a door, "" for the nearest to the robot, open or shut for so long, s."""

    opened: bool
    name: str = ""
    seconds: float = 20.0

    def __post_init__(self) -> None:
        word("door: name", self.name)
        within("door: seconds", self.seconds, 0.1, MOST_HOLD_S)


@dataclass(frozen=True, kw_only=True)
class Touch:
    """A click at (x, y) m in the world: push the thing there away from the robot, open the door.

    name  of what was hit, "" for what is nearest to the place
    """

    x: float
    y: float
    name: str = ""

    def __post_init__(self) -> None:
        word("touch: name", self.name)
        for axis, value in (("x", self.x), ("y", self.y)):
            within(f"touch: {axis}", value, -FAR_M, FAR_M)


@dataclass(frozen=True, kw_only=True)
class Kidnap:
    """Carry the robot to a pose (m, m, rad) in the world, to a goal, or to the farthest goal."""

    pose: tuple[float, float, float] | None = None
    goal: str = ""

    def __post_init__(self) -> None:
        word("kidnap: goal", self.goal)
        if self.pose is not None:
            three("kidnap: pose", self.pose)


@dataclass(frozen=True, kw_only=True)
class Click:
    """A click on what is shown, as a ray in the world: touch what it hits, or carry the robot."""

    origin: tuple[float, float, float]
    direction: tuple[float, float, float]
    carry: bool = False

    def __post_init__(self) -> None:
        for name in ("origin", "direction"):
            three(f"click: {name}", getattr(self, name))
        if not any(self.direction):
            raise InvalidValueError("click: a ray must have a direction, got zeros")


@dataclass(frozen=True, kw_only=True)
class Run:
    """Play or pause."""

    playing: bool


@dataclass(frozen=True, kw_only=True)
class Step:
    """So many scans, then pause."""

    scans: int = 1

    def __post_init__(self) -> None:
        within("step: scans", self.scans, 1, MOST_SCANS)


@dataclass(frozen=True, kw_only=True)
class Seek:
    """Show the moment that is ``time_s`` since the start, or ``back_s`` before the present.

    nearest  take the nearest moment that is kept where that one is not
    """

    time_s: float | None = None
    back_s: float | None = None
    nearest: bool = False

    def __post_init__(self) -> None:
        if (self.time_s is None) == (self.back_s is None):
            raise InvalidValueError("seek takes one of time_s and back_s")
        within("seek", self.time_s if self.back_s is None else self.back_s, 0.0, 1e9)


@dataclass(frozen=True, kw_only=True)
class Speed:
    """How fast the view goes, 1 is real time."""

    factor: float


@dataclass(frozen=True, kw_only=True)
class Anew:
    """A new world from the same seed, or the log from its start, with another SLAM or more motion.

    slam, crowd  by name;   motion, change  0 to 1; None: as it was
    """

    slam: str | None = None
    motion: float | None = None
    change: float | None = None
    crowd: str | None = None

    def __post_init__(self) -> None:
        for name in ("slam", "crowd"):
            word(f"world: {name}", getattr(self, name) or "")
        for name in ("motion", "change"):
            within(f"world: {name}", getattr(self, name) or 0.0, 0.0, 1.0)


OnWorld = Drive | Tour | Push | MoveDoor | Touch | Kidnap
OnView = Run | Step | Seek | Speed
Request = OnWorld | OnView | Click | Anew


def word(what: str, value: Any) -> str:
    """A name; ``InvalidValueError`` for anything else."""
    if not isinstance(value, str) or len(value) > MOST_LETTERS or not value.isprintable():
        raise InvalidValueError(
            f"{what} must be a name of up to {MOST_LETTERS} letters, got {value!r:.60}"
        )
    return value


def three(what: str, value: Any) -> None:
    """Three finite numbers that a place may have; ``InvalidValueError`` for anything else."""
    if not isinstance(value, tuple) or len(value) != 3:
        raise InvalidValueError(f"{what} must be three numbers, got {value!r:.60}")
    for number in value:
        within(what, number, -FAR_M, FAR_M)


def within(what: str, value: Any, low: float, high: float) -> float:
    """A finite number in [low, high]; ``InvalidValueError`` for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        raise InvalidValueError(f"{what} must be a number, got {value!r:.60}")
    if not low <= value <= high:
        raise InvalidValueError(f"{what} must lie in [{low:g}, {high:g}], got {value!r:.60}")
    return float(value)
