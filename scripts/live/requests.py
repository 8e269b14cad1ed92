# SPDX-License-Identifier: Apache-2.0
"""What a page may ask for: bounded and checked, whoever wrote it, and never run.

With the queue in which it waits for the thread that owns the world.
"""

from __future__ import annotations

import queue
from dataclasses import dataclass, field, fields
from typing import Any

from scripts.live import FASTEST, SLOWEST
from sim.core.checks import FAR_M, three, within, word
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import InvalidValueError, MobiliaError

MOST_WAITING = 64  # requests; a client that sends more is told so
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
class _Checked:
    """Checked at birth: ``InvalidValueError`` names the field, the value and what was expected."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value, what = getattr(self, one.name), f"{type(self).__name__.lower()}: {one.name}"
            if value is None and one.default is None:
                continue
            if one.metadata.get("three"):
                three(what, value)
            elif "low" in one.metadata:
                within(what, value, one.metadata["low"], one.metadata["high"])
            elif one.type != "bool":
                word(what, value)
            elif not isinstance(value, bool):
                raise InvalidValueError(f"{what} must be true or false, got {value!r:.60}")


@dataclass(frozen=True, kw_only=True)
class Drive(_Checked):
    """Twist for the robot, m/s, rad/s, and m/s to the left."""

    v: float = _number(-MOST_TWIST, MOST_TWIST)
    omega: float = _number(-MOST_TWIST, MOST_TWIST)
    side: float = _number(-MOST_TWIST, MOST_TWIST, 0.0)


@dataclass(frozen=True, kw_only=True)
class Tour(_Checked):
    """The built-in driver is to go on."""


@dataclass(frozen=True, kw_only=True)
class Click(_Checked):
    """A click on what is shown, as a ray in the world: touch what it hits, or carry the robot."""

    origin: tuple[float, float, float] = _point()
    direction: tuple[float, float, float] = _point()
    carry: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not any(self.direction):
            raise InvalidValueError("click: a ray must have a direction, got zeros")


@dataclass(frozen=True, kw_only=True)
class Run(_Checked):
    """Play or pause."""

    playing: bool


@dataclass(frozen=True, kw_only=True)
class Step(_Checked):
    """One scan, then pause."""


@dataclass(frozen=True, kw_only=True)
class Seek(_Checked):
    """Show the moment that is ``back_s`` before the present, or the one kept nearest to that."""

    back_s: float = _number(0.0, 1e9)


@dataclass(frozen=True, kw_only=True)
class Speed(_Checked):
    """How fast the view goes, 1 is real time."""

    factor: float = _number(SLOWEST, FASTEST)


@dataclass(frozen=True, kw_only=True)
class Anew(_Checked):
    """A new world from the same seed, or the log from its start, with another SLAM or more motion.

    slam, crowd  by name;   motion, change  0 to 1; None: as it was
    """

    slam: str | None = None
    motion: float | None = _number(0.0, 1.0, None)
    change: float | None = _number(0.0, 1.0, None)
    crowd: str | None = None


OnWorld = Drive | Tour | Push | MoveDoor | Kidnap | Click
OnView = Run | Step | Seek | Speed
Request = OnWorld | OnView | Anew


class Inbox:
    """A queue of limited length. ``refused`` keeps the last thing that was wrong, to be told."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Request] = queue.Queue(MOST_WAITING)
        self._refused: str | None = None

    def put(self, request: Request) -> None:
        """Hand a request over; ``InvalidValueError`` where too many wait. From any thread."""
        try:
            self._queue.put_nowait(request)
        except queue.Full:
            raise InvalidValueError(
                f"{MOST_WAITING} requests wait already: this one is dropped"
            ) from None

    def refuse(self, why: MobiliaError) -> None:
        """Keep this to be told to the clients, in place of what was kept before."""
        self._refused = str(why)[:300]

    def refused(self) -> str | None:
        """What is to be told, once."""
        said, self._refused = self._refused, None
        return said

    def get(self, timeout_s: float) -> Request | None:
        """The next request, None where none comes in that time."""
        try:
            return self._queue.get(timeout_s > 0.0, max(timeout_s, 0.0))
        except queue.Empty:
            return None
