# SPDX-License-Identifier: Apache-2.0
"""Play, pause, step and seek: what is kept of the last minute, and which moment is shown.

Nothing here knows what time it is: ``scripts.live.pace`` does.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from scripts.live import FASTEST, SLOWEST
from scripts.live.requests import OnView, Run, Seek, Speed, Step
from sim.view.moment import Shown
from slam.errors import InvalidValueError, MobiliaError

KEPT_S = 60.0  # of the run, to look back


class Playback:
    """Moments of a run, one after the other, the last minute of them to look back on.

    playing, speed  as the clients have asked
    ended           there is nothing after the last moment;   why  a failure, "" for the end
    """

    def __init__(
        self, source: Iterator[Shown], *, playing: bool = True, speed: float = 1.0
    ) -> None:
        if not SLOWEST <= speed <= FASTEST:
            raise InvalidValueError(f"speed must lie in [{SLOWEST:g}, {FASTEST:g}], got {speed}")
        self.playing, self.speed, self.ended, self.why = playing, speed, False, ""
        self._source = source
        self._kept: deque[Shown] = deque()
        self._at = -1
        self._steps = 0  # scans to go before it pauses again

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
        return (not self.playing and self._steps == 0) or (self.ended and not self.looks_back)

    def advance(self) -> Shown | None:
        """The next moment, kept or new; None at the end of the run."""
        if not self.looks_back and not self._take():
            self._steps = 0
            return None
        self._at += 1
        self._steps = max(0, self._steps - 1)
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

    def do(self, request: OnView) -> str:
        """Do as a client asks; what was done, in words. ``InvalidValueError`` where it cannot."""
        if isinstance(request, Run):
            self.playing, self._steps = request.playing, 0
            return "playing" if request.playing else "paused"
        if isinstance(request, Step):
            self.playing, self._steps = False, request.scans
            return f"{request.scans} scans on, then paused"
        if isinstance(request, Speed):
            if not SLOWEST <= request.factor <= FASTEST:
                raise InvalidValueError(
                    f"speed must lie in [{SLOWEST:g}, {FASTEST:g}], got {request.factor:g}"
                )
            self.speed = request.factor
            return f"{request.factor:g} times real time"
        return self._seek(request)

    def _seek(self, request: Seek) -> str:
        if not self._kept:
            raise InvalidValueError("seek: nothing has been shown yet")
        first, last = self._kept[0].seconds, self._kept[-1].seconds
        wanted = last - (request.back_s or 0.0) if request.time_s is None else request.time_s
        if not first - 1e-6 <= wanted <= last + 1e-6 and not request.nearest:
            raise InvalidValueError(
                f"seek: {wanted:.2f} s is not kept, only {first:.2f} to {last:.2f} s"
            )
        self._at = next(
            (k for k, moment in enumerate(self._kept) if moment.seconds >= wanted - 1e-6),
            len(self._kept) - 1,
        )
        self._steps = 0
        return f"{self._kept[self._at].seconds:.2f} s is shown, the present is {last:.2f} s"
