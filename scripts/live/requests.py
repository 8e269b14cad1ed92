# SPDX-License-Identifier: Apache-2.0
"""What a page may ask for: bounded and checked, whoever wrote it, and never run."""

from __future__ import annotations

from dataclasses import dataclass

from sim.core.checks import FAR_M, three, within, word
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import InvalidValueError

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
