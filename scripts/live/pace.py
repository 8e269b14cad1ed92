# SPDX-License-Identifier: Apache-2.0
"""The pace of the view: the only place that looks at the clock on the wall."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

LATE_S = 0.25  # behind by more than that it goes on from here instead of running after
SENT_HZ = 40.0  # moments sent a second at most


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
