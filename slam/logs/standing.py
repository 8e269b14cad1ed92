# SPDX-License-Identifier: Apache-2.0
"""Odometry that stands still while scans move: of a robot without encoders, or an idle driver."""

import math
from collections.abc import Sequence

import numpy as np

from slam.arrays import Float, Float32

STILL = 0.01  # m, rad; less, over a whole log, is none
FAR_M, FAR_SHARE = 0.1, 0.02  # by which a range has changed: noise, and that of far ones
CHANGED = 0.4  # share of the beams; people that walk by change fewer
MOVED = 0.05  # share of the scans that are such, and at least
LEAST_SCANS = 3
LEAST_SEEN = 0.2  # share of the beams with a return in both scans


class Standing:
    """Takes the poses and scans of a log, each in their order."""

    def __init__(self) -> None:
        self._low, self._high = [math.inf] * 3, [-math.inf] * 3
        self._first: Float32 | Float | None = None
        self._scans = self._moved = 0

    def pose(self, pose: Sequence[float]) -> None:
        """x m, y m, theta rad."""
        for k, value in enumerate(pose):
            if math.isnan(value):  # which no comparison would notice
                self._low[k], self._high[k] = -math.inf, math.inf
            self._low[k] = min(self._low[k], value)
            self._high[k] = max(self._high[k], value)

    @property
    def still(self) -> bool:
        """Whether the odometry so far has not moved at all."""
        return all(b - a < STILL for a, b in zip(self._low, self._high, strict=True))

    def scan(self, ranges: Float32 | Float) -> None:
        """(n,) m; scans of other numbers of beams are compared by the part of their view."""
        if not self.still:
            return
        self._scans += 1
        if self._first is None:
            if len(ranges) and float((np.isfinite(ranges) & (ranges > 0.0)).mean()) > LEAST_SEEN:
                self._first = ranges
            return
        first = self._first
        if len(ranges) == 0:
            return
        now = ranges[np.arange(len(first)) * len(ranges) // len(first)]
        both = np.isfinite(first) & (first > 0.0) & np.isfinite(now) & (now > 0.0)
        if float(both.mean()) > LEAST_SEEN:
            a, b = first[both], now[both]
            changed = np.abs(a - b) > FAR_M + FAR_SHARE * np.maximum(a, b)
            self._moved += float(changed.mean()) > CHANGED

    @property
    def stands(self) -> bool:
        """Whether the odometry stands still while scans move."""
        return self.still and self._moved >= max(LEAST_SCANS, MOVED * self._scans)
