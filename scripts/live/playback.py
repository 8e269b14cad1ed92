# SPDX-License-Identifier: Apache-2.0
"""Play, pause, step and seek: what is kept of the last minute, and which moment is shown.

``Pace`` alone looks at the clock on the wall.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator

from scripts.live.requests import OnView, Run, Speed, Step
from sim.view.moment import Shown
from slam.errors import MobiliaError

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
