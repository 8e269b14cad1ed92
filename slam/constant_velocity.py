# SPDX-License-Identifier: Apache-2.0
"""Odometry for a log that has none: the SLAM's own last motion, gone on with.

A scanner carried in the hand, or a drone's, has no wheels. What a SLAM needs instead is a guess of
where it is now; the one that asks for least is that it moves on as it moved between its last two
estimates. It knows nothing of how that will change: its covariance says so.
"""

from collections.abc import Sequence

import numpy as np

from slam import se2
from slam.estimate import Estimate
from slam.frames import NS_PER_S, Float, Frame, Odometry

ACCELERATION = (4.0, 8.0)  # m/s^2, rad/s^2: how fast a walking person's hand changes its motion
LEAST = (0.01, 0.02)  # m, rad: what an estimate is off by
FASTEST = (3.0, 3.0)  # m/s, rad/s; what is faster is an error of the match
LONGEST_S = 1.0  # after a pause, nothing is known of the motion before it
STANDING = (1.5, 1.5)  # m/s, rad/s: of a motion of which nothing is known


def standing(stamp_ns: int, before_ns: int | None) -> Odometry:
    """Odometry of one that does not move, with the covariance of one that may."""
    spread = None
    if before_ns is not None:
        spread = _covariance((stamp_ns - before_ns) / NS_PER_S, known=False)
    return Odometry(
        stamp_ns=stamp_ns, T_odom_robot=np.zeros(3), increment_covariance=spread, twist=np.zeros(3)
    )


def _covariance(elapsed_s: float, *, known: bool) -> Float:
    """(3, 3) of a motion over that time, in the frame before it."""
    rates = [0.5 * a * elapsed_s for a in ACCELERATION] if known else STANDING
    along, turn = (
        least + rate * min(elapsed_s, LONGEST_S) for least, rate in zip(LEAST, rates, strict=True)
    )
    return np.diag([along * along, along * along, turn * turn])


class ConstantVelocity:
    """Gives the frames of one SLAM their odometry. One object a run."""

    def __init__(self) -> None:
        self._T_odom_robot: Float = np.zeros(3)
        self._before_ns: int | None = None
        self._frames, self._back = 0, 1  # so many frames ago the last one's scanner looked before
        self._looked: dict[tuple[float, ...], int] = {}

    def frame(self, frame: Frame, estimates: Sequence[Estimate]) -> Frame:
        """``frame`` with odometry that goes on as ``estimates``, those so far, moved last.

        Between two scans of one scanner: what two say may differ, and they may be moments apart.
        """
        stamp_ns, before_ns = frame.stamp_ns, self._before_ns
        self._before_ns = stamp_ns
        spread, velocity = None, np.zeros(3)
        if before_ns is not None:
            elapsed_s = (stamp_ns - before_ns) / NS_PER_S
            found = _velocity(estimates, self._back) if elapsed_s <= LONGEST_S else None
            velocity = np.zeros(3) if found is None else found
            self._T_odom_robot = se2.compose(self._T_odom_robot, se2.exp(velocity, elapsed_s))
            spread = _covariance(elapsed_s, known=found is not None)
        if frame.scan is not None:
            self._back = self._frames - self._looked.get(frame.scan.spec.mount, self._frames - 1)
            self._looked[frame.scan.spec.mount] = self._frames
        self._frames += 1
        odometry = Odometry(
            stamp_ns=stamp_ns,
            T_odom_robot=self._T_odom_robot,
            increment_covariance=spread,
            twist=velocity,
        )
        return Frame(
            stamp_ns=stamp_ns,
            odometry=odometry,
            scan=frame.scan,
            features=frame.features,
            truth=frame.truth,
            labels=frame.labels,
        )


def _velocity(estimates: Sequence[Estimate], back: int) -> Float | None:
    """(3,) m/s, m/s, rad/s over the last ``back``; None where they do not say."""
    if len(estimates) <= back or not estimates[-1].converged:
        return None
    a, b = estimates[-1 - back], estimates[-1]
    elapsed_s = (b.stamp_ns - a.stamp_ns) / NS_PER_S
    if not 0.0 < elapsed_s <= LONGEST_S:
        return None
    velocity: Float = se2.log(se2.between(a.T_map_robot, b.T_map_robot)) / elapsed_s
    limits = np.array([FASTEST[0], FASTEST[0], FASTEST[1]])
    return velocity if (np.abs(velocity) <= limits).all() else None
