# SPDX-License-Identifier: Apache-2.0
"""Poses of a bag brought to the stamps of its scans."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from slam import se2
from slam.checked import possible
from slam.frames import Float


@dataclass(slots=True)
class Stamped:
    """A pose at a time, with what an odometry message also says."""

    stamp_ns: int
    pose: Float
    twist: Float | None = None
    covariance: Float | None = None


class PoseTrack:
    """The last poses of a topic; forgets what lies before the last time that was asked for."""

    def __init__(self) -> None:
        self._poses: deque[Stamped] = deque()

    def add(self, now: Stamped) -> None:
        """Append; a pose that is not later than the one before is left out."""
        if not self._poses or now.stamp_ns > self._poses[-1].stamp_ns:
            self._poses.append(now)

    def reaches(self, stamp_ns: int) -> bool:
        """Whether ``at`` knows that time, as far as the end is concerned."""
        return bool(self._poses) and self._poses[-1].stamp_ns >= stamp_ns

    def at(self, stamp_ns: int) -> Stamped | None:
        """The pose at that time: as recorded, or on the arc between its neighbours."""
        poses = self._poses
        while len(poses) > 1 and poses[1].stamp_ns <= stamp_ns:
            poses.popleft()
        if not poses or poses[0].stamp_ns > stamp_ns:
            return None
        before = poses[0]
        if before.stamp_ns == stamp_ns:
            return before
        if len(poses) == 1:
            return None
        after = poses[1]
        part = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
        return Stamped(
            stamp_ns=stamp_ns,
            pose=se2.interpolate(before.pose, after.pose, part),
            twist=_between(before.twist, after.twist, part),
            covariance=_between(before.covariance, after.covariance, part),
        )


def _between(before: Float | None, after: Float | None, part: float) -> Float | None:
    if before is None or after is None:
        return None
    return before + part * (after - before)


def increment_covariance(before: Stamped | None, now: Stamped) -> Float | None:
    """(3, 3) of the motion between two poses, from covariances that accumulate along the way.

    nav_msgs/Odometry states P, the covariance of the pose in the odom frame. With the Jacobians F
    and G of composing a pose with a motion, P_now = F P_before F' + G Q G' defines Q, the
    covariance of the motion in the frame of the robot before it. Many drivers publish one constant
    instead of an accumulated covariance: where P does not change, nothing is known (None).
    Rounding can leave variances below zero: they are set to zero, and so are covariances that are
    then too large, and those with the heading where not all three can be.
    """
    if before is None or before.covariance is None or now.covariance is None:
        return None
    P, P_now = before.covariance, now.covariance
    if not (np.isfinite(P).all() and np.isfinite(P_now).all()) or np.array_equal(P, P_now):
        return None
    theta = float(before.pose[2])
    dx, dy = (now.pose[:2] - before.pose[:2]).tolist()
    carry = [[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]]
    c, s = math.cos(theta), math.sin(theta)
    turn = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
    left = P_now - _sandwich(carry, P)
    return _possible(_sandwich(turn, 0.5 * (left + left.T)))


def _sandwich(A: list[list[float]], P: Float) -> Float:
    """A P A' by hand: NumPy's matmul changes its last bit with the CPU."""
    rows, inner = range(3), P.tolist()
    AP = [[sum(A[i][k] * inner[k][j] for k in rows) for j in rows] for i in rows]
    return np.array([[sum(AP[i][k] * A[j][k] for k in rows) for j in rows] for i in rows])


def _possible(Q: Float) -> Float:
    out = 0.5 * (Q + Q.T)
    for i in range(3):
        out[i, i] = max(out[i, i], 0.0)
    for i in range(3):
        for j in range(i):
            limit = math.sqrt(float(out[i, i])) * math.sqrt(float(out[j, j]))
            out[i, j] = out[j, i] = min(max(out[i, j], -limit), limit)
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = out.tolist()
    if not possible(xx, xy, yy, xt, yt, tt):  # three correlations that cannot be at once
        out[:2, 2] = out[2, :2] = 0.0
    return out
