# SPDX-License-Identifier: Apache-2.0
"""What odometry said between the frames that a listener gets, where it gets only some of them."""

from collections.abc import Sequence
from dataclasses import replace

from slam.arrays import Float
from slam.frames import Frame, Odometry


class MotionSum:
    """Sums the increments' covariances between the frames that a listener gets.

    Where a step states none, the whole states none: a missing part would read as exact. The first
    step of a stream moves nothing, so it may state none.
    """

    def __init__(self) -> None:
        self._sum: Float | None = None
        self._unstated, self._begun = False, False

    def add(self, odometry: Odometry) -> None:
        """One more step."""
        part = odometry.increment_covariance
        if part is None:
            self._unstated |= self._begun
        else:
            self._sum = part if self._sum is None else self._sum + part
        self._begun = True

    def passed_on(self, frame: Frame) -> Frame:
        """``frame`` with the covariance (3, 3) of all the motion since the last one passed on."""
        whole = None if self._unstated else self._sum
        self._sum, self._unstated = None, False
        return replace(frame, odometry=replace(frame.odometry, increment_covariance=whole))


def thinned(frames: Sequence[Frame], stride: int) -> list[Frame]:
    """Every ``stride``-th frame without labels, with the covariance of all the motion between."""
    out, motion = [], MotionSum()
    for k, frame in enumerate(frames):
        motion.add(frame.odometry)
        if k % stride == 0:
            out.append(replace(motion.passed_on(frame), labels=None))
    return out
