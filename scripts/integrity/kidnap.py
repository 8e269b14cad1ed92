# SPDX-License-Identifier: Apache-2.0
"""A robot that is carried off unawares, or whose SLAM is pushed: the frames and the displacement.

The robot is put, between two scans, to where it stands at some moment of another tour through the
same building: at least 3 m or 90 degrees away, near a place that it has mapped. The odometry knows
nothing of it.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from slam import se2
from slam.frames import Float, Frame

FAR_M, FAR_RAD = 3.0, math.pi / 2.0
KNOWN_M, KNOWN_RAD = 1.0, 1.0  # the new place is that near to one of the mapping tour
RIGHT_M, RIGHT_RAD = 0.3, 0.2
AFTER_S = 10.0
LEAST_AFTER = 40  # scans followed at least
PUSH_M, PUSH_DEG = 0.3, 5.0
BACK_M, BACK_DEG = 0.05, 1.0  # of the run without the push: it is back
KINDS = ("m", "deg")  # of pushes


def push(kind: str, rng: np.random.Generator) -> Float:
    """(3,) m, m, rad: one of ``KINDS``, in a random direction."""
    if kind == "deg":
        return np.array([0.0, 0.0, math.radians(PUSH_DEG) * rng.choice([-1.0, 1.0])])
    way = rng.uniform(0.0, math.tau)
    return np.array([PUSH_M * math.cos(way), PUSH_M * math.sin(way), 0.0])


def targets(mapped: list[Frame], later: list[Frame], scans: int, count: int) -> Iterator[int]:
    """Moments of ``later`` to be put to."""
    tour = np.array([frame.truth for frame in mapped])

    def fits(k: int) -> bool:
        """Far from the end of the tour, and near a place of it."""
        place = later[k].truth
        assert place is not None
        jump = place - tour[-1]
        far = math.hypot(jump[0], jump[1]) >= FAR_M or abs(se2.wrap(float(jump[2]))) >= FAR_RAD
        near = ((tour[:, :2] - place[:2]) ** 2).sum(axis=1) < KNOWN_M**2
        return far and bool(
            (near & (np.abs(se2.wrap_array(tour[:, 2] - place[2])) < KNOWN_RAD)).any()
        )

    drawn = np.random.default_rng(len(later)).permutation(np.arange(1, len(later) - scans))
    return islice(filter(fits, drawn.tolist()), count)


def kidnapped(mapped: list[Frame], later: list[Frame], start: int, scans: int) -> Iterator[Frame]:
    """Frames of ``later`` from ``start`` on as they follow the last of ``mapped`` unawares."""
    T_odom_robot: Float = mapped[-1].odometry.T_odom_robot
    stamp_ns, period_ns = mapped[-1].stamp_ns, mapped[1].stamp_ns - mapped[0].stamp_ns
    for before, now in zip(later[start - 1 :], later[start : start + scans], strict=False):
        increment = se2.between(before.odometry.T_odom_robot, now.odometry.T_odom_robot)
        T_odom_robot = se2.compose(T_odom_robot, increment)
        stamp_ns += period_ns
        assert now.scan is not None
        yield replace(
            now,
            stamp_ns=stamp_ns,
            odometry=replace(now.odometry, stamp_ns=stamp_ns, T_odom_robot=T_odom_robot),
            scan=replace(now.scan, stamp_ns=stamp_ns),
        )


def scans_after(mapped: list[Frame]) -> int:
    """So many scans follow a kidnap: those of ``AFTER_S``, and ``LEAST_AFTER`` at least."""
    period_ns = float(np.median(np.diff([frame.stamp_ns for frame in mapped])))
    return max(round(AFTER_S * 1e9 / period_ns), LEAST_AFTER)
