# SPDX-License-Identifier: Apache-2.0
"""From frame to frame: the motion by odometry, and what can be none."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, Frame, Odometry

MOST_STEP_M = 1000.0  # between two frames: farther, the stream is broken or of another run
MOST_POSE = 1e9  # m and rad from the origin: there a double still resolves 0.1 micrometres
MOST_STD = 1e4  # m and rad, of an increment; with more, rounding would eat what is known beside
HUGE = 1.0  # m^2 or rad^2: from there on,
MOST_CORRELATION = 1.0 - 1e-6  # exact correlations would leave nothing of what is known beside
LEAST_SHARE = 1e-12  # of the larger variance of position that the smaller one must have


def known(covariance: Float, most_m: float = MOST_STD, most_rad: float = MOST_STD) -> Float:
    """A copy of an increment's covariance (3, 3) with standard deviations lowered to at most
    these, the correlations kept: beyond, they mean "not known"."""
    out = np.array(covariance, dtype=np.float64)
    most = zip(out.diagonal().tolist(), (most_m, most_m, most_rad), strict=True)
    scale = [min(1.0, limit / math.sqrt(v)) if v > 0.0 else 1.0 for v, limit in most]
    if min(scale) < 1.0:
        out *= np.outer(scale, scale)
    return out


def invertible(covariance: Float) -> Float:
    """``known``, and such that its inverse can be computed: the very numbers, unless a variance is
    ``HUGE``."""
    out = known(covariance)
    xx, yy, tt = out.diagonal().tolist()
    if max(xx, yy, tt) > HUGE:
        out *= MOST_CORRELATION
        least = LEAST_SHARE * max(xx, yy)
        np.fill_diagonal(out, [max(xx, least), max(yy, least), max(tt, 0.0)])
    return out


def increment(before: Odometry, now: Odometry) -> Float:
    """(3,) ``T_before_now``. Raises ``InvalidValueError`` for a step that no robot makes."""
    x, y, _ = before.T_odom_robot.tolist()
    x_now, y_now, _ = now.T_odom_robot.tolist()
    distance = math.hypot(x_now - x, y_now - y)
    if not distance <= MOST_STEP_M:
        raise InvalidValueError(
            f"Odometry.T_odom_robot must move by at most {MOST_STEP_M:g} m from frame to frame, "
            f"got {distance:g} m from {before.stamp_ns} ns to {now.stamp_ns} ns"
        )
    for odometry in (before, now):
        farthest = max(map(abs, odometry.T_odom_robot.tolist()))
        if farthest > MOST_POSE:
            raise InvalidValueError(
                f"Odometry.T_odom_robot must lie within {MOST_POSE:g} m and rad, got {farthest:g} "
                f"at {odometry.stamp_ns} ns"
            )
    return se2.between(before.T_odom_robot, now.T_odom_robot)


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
