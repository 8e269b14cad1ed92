# SPDX-License-Identifier: Apache-2.0
"""What a page may ask for, and play, pause, step and seek: which moment is shown."""

import math
import queue
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from scripts.live import FASTEST, SLOWEST
from sim.view.moment import Shown
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import InvalidValueError, MobiliaError
from slam.shaped import Point, Share, Word, check

MOST_WAITING = 64  # requests; a client that sends more is told so
MOST_TWIST = 1e3  # m/s and rad/s; the drive clips to what it can do


Twist = Annotated[float, Meta(ge=-MOST_TWIST, le=MOST_TWIST)]


class _Checked:
    """Checked at birth: ``InvalidValueError`` names the field, the value and what was expected."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, kw_only=True)
class Drive(_Checked):
    """Twist for the robot, m/s, rad/s, and m/s to the left."""

    v: Twist
    omega: Twist
    side: Twist = 0.0


@dataclass(frozen=True, kw_only=True)
class Tour(_Checked):
    """The built-in driver is to go on."""


@dataclass(frozen=True, kw_only=True)
class Click(_Checked):
    """A click on what is shown, as a ray in the world: touch what it hits, or carry the robot."""

    origin: Point
    direction: Point
    carry: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not any(self.direction):
            raise InvalidValueError("Click.direction must not be three zeros")


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

    back_s: Annotated[float, Meta(ge=0.0, le=1e9)]


@dataclass(frozen=True, kw_only=True)
class Speed(_Checked):
    """How fast the view goes, 1 is real time."""

    factor: Annotated[float, Meta(ge=SLOWEST, le=FASTEST)]


@dataclass(frozen=True, kw_only=True)
class Anew(_Checked):
    """A new world from the same seed, or the log from its start, with another SLAM or more motion.

    slam, crowd  by name;   motion, change  0 to 1; None: as it was
    """

    slam: Word | None = None
    motion: Share | None = None
    change: Share | None = None
    crowd: Word | None = None


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

    def refuse(self, why: object) -> None:
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


KEPT_S = 60.0  # of the run, to look back
LATE_S = 0.25  # behind by more than that it goes on from here instead of running after
SENT_HZ = 40.0  # moments sent a second at most


class Playback:
    """Moments of a run, one after the other, the last minute of them to look back on.

    playing, speed  as the clients have asked
    ended           there is nothing after the last moment;   why  a failure, "" for the end
    """

    def __init__(
        self, source: Iterator[Shown], *, playing: bool = True, speed: float = 1.0
    ) -> None:
        self.playing, self.speed, self.ended, self.why = playing, speed, False, ""
        self._source = source
        self._kept: deque[Shown] = deque()
        self._at = -1
        self._stepping = False

    @property
    def shown(self) -> Shown | None:
        """The moment that is shown; None before the first."""
        return self._kept[self._at] if self._kept else None

    @property
    def present(self) -> Shown | None:
        """The last moment there is."""
        return self._kept[-1] if self._kept else None

    @property
    def looks_back(self) -> bool:
        """Whether an earlier moment than the present is shown."""
        return self._at < len(self._kept) - 1

    @property
    def resting(self) -> bool:
        """Whether the moment shown stays."""
        return (not self.playing and not self._stepping) or (self.ended and not self.looks_back)

    def advance(self) -> Shown | None:
        """The next moment, kept or new; None at the end of the run."""
        self._stepping = False
        if not self.looks_back and not self._take():
            return None
        self._at += 1
        return self._kept[self._at]

    def _take(self) -> bool:
        """Make one more moment and forget those that are older than is kept."""
        if self.ended:
            return False
        try:
            self._kept.append(next(self._source))
        except StopIteration:
            self.ended = True
            return False
        except MobiliaError as error:  # of a SLAM, or of a log: what was shown stays
            self.ended, self.why = True, str(error)
            return False
        while self._kept[-1].seconds - self._kept[0].seconds > KEPT_S:
            self._kept.popleft()
            self._at -= 1
        return True

    def do(self, request: OnView) -> None:
        """Do as a client asks."""
        self._stepping = isinstance(request, Step)
        if isinstance(request, Run):
            self.playing = request.playing
        elif isinstance(request, Step):
            self.playing = False
        elif isinstance(request, Speed):
            self.speed = request.factor
        elif self._kept:
            wanted = self._kept[-1].seconds - request.back_s - 1e-6
            later = (k for k, moment in enumerate(self._kept) if moment.seconds >= wanted)
            self._at = next(later)


class Pace:
    """When the next moment is due, and whether it is to be sent.

    clock  s, steady
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._wall_s = self._run_s = math.nan
        self._speed = 1.0
        self._sent_s = -math.inf

    def restart(self) -> None:
        """The next moment is due now."""
        self._wall_s = math.nan

    def wait_s(self, run_s: float, speed: float) -> float:
        """s until the moment at ``run_s`` is due."""
        now = self._clock()
        if math.isnan(self._wall_s) or speed != self._speed or run_s < self._run_s:
            self._wall_s, self._run_s, self._speed = now, run_s, speed
            return 0.0
        due = self._wall_s + (run_s - self._run_s) / speed
        if now - due > LATE_S:
            self._wall_s, self._run_s = now, run_s
        return max(0.0, due - now)

    def to_send(self) -> bool:
        """Whether so much time has passed that a moment is to be sent again; then it has been."""
        now = self._clock()
        if now - self._sent_s < 1.0 / SENT_HZ - 0.002:
            return False
        self._sent_s = now
        return True
