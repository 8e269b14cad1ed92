# SPDX-License-Identifier: Apache-2.0
"""Where the robot should be by its odometry, and how sure of that one may be."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam._jit import njit
from slam.frames import Float, Odometry

WIDEN = 2.5  # times the odometry's own standard deviation: a too tight prior lets the map slip
FLOOR_M, FLOOR_RAD = 0.004, 0.003  # standard deviation per sqrt(0.2 s): skew, quantisation, slip
# Without a covariance: a worn robot on a log, see ``assumed_covariance``.
ASSUMED_SHARE, ASSUMED_TURN_M, ASSUMED_RAD_PER_SQRT_M, ASSUMED_TURN = 0.10, 0.10, 0.08, 0.15


@njit
def turned(covariance: NDArray[np.float64], theta: float) -> NDArray[np.float64]:
    """A (3, 3) covariance of a motion in axes turned by -theta; products in a fixed order."""
    c, s = math.cos(theta), math.sin(theta)
    a, b, d = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    e, f = covariance[0, 2], covariance[1, 2]
    out = np.empty((3, 3))
    out[0, 0] = c * c * a - 2.0 * c * s * b + s * s * d
    out[0, 1] = out[1, 0] = c * s * (a - d) + (c * c - s * s) * b
    out[1, 1] = s * s * a + 2.0 * c * s * b + c * c * d
    out[0, 2] = out[2, 0] = c * e - s * f
    out[1, 2] = out[2, 1] = s * e + c * f
    out[2, 2] = covariance[2, 2]
    return out


@njit
def inverted(m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a symmetric positive definite (3, 3) matrix, in a fixed order of operations."""
    out = np.empty((3, 3))
    out[0, 0] = m[1, 1] * m[2, 2] - m[1, 2] * m[1, 2]
    out[0, 1] = m[0, 2] * m[1, 2] - m[0, 1] * m[2, 2]
    out[0, 2] = m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]
    out[1, 1] = m[0, 0] * m[2, 2] - m[0, 2] * m[0, 2]
    out[1, 2] = m[0, 1] * m[0, 2] - m[0, 0] * m[1, 2]
    out[2, 2] = m[0, 0] * m[1, 1] - m[0, 1] * m[0, 1]
    det = m[0, 0] * out[0, 0] + m[0, 1] * out[0, 1] + m[0, 2] * out[0, 2]
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]
    for row in range(3):
        for column in range(3):
            out[row, column] /= det
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Prior of one frame.

    T_map_robot  (3,) predicted pose
    increment    (3,) T_before_now by odometry
    covariance   (3, 3) of the increment, in the map frame, widened and floored
    twist        (3,) body velocity for de-skewing
    elapsed      s since the previous frame
    """

    T_map_robot: Float
    increment: Float
    covariance: Float
    twist: Float
    elapsed: float


def assumed_covariance(increment: Float) -> Float:
    """Covariance (3, 3) of an increment whose log says nothing, in the previous robot frame."""
    distance = math.hypot(float(increment[0]), float(increment[1]))
    turn = abs(float(increment[2]))
    sd_xy = ASSUMED_SHARE * distance + ASSUMED_TURN_M * turn
    sd_theta = ASSUMED_RAD_PER_SQRT_M * math.sqrt(distance) + ASSUMED_TURN * turn
    return np.diag([sd_xy**2, sd_xy**2, sd_theta**2])


def predict(T_map_before: Float, before: Odometry, now: Odometry) -> Prediction:
    """Chain the odometry increment on the last pose; covariance from the frame's own."""
    increment = se2.between(before.T_odom_robot, now.T_odom_robot)
    elapsed = (now.stamp_ns - before.stamp_ns) * 1e-9
    given = now.increment_covariance
    if given is None:
        in_robot = assumed_covariance(increment)
    else:
        in_robot = WIDEN**2 * np.asarray(given)
    share = min(max(elapsed, 1e-3), 1.0) / 0.2
    in_robot = in_robot + share * np.diag([FLOOR_M**2, FLOOR_M**2, FLOOR_RAD**2])
    if now.twist is not None:
        twist = np.asarray(now.twist)
    elif 0.0 < elapsed < 0.5:
        twist = se2.log(increment) / elapsed
    else:
        twist = np.zeros(3)
    return Prediction(
        T_map_robot=se2.compose(T_map_before, increment),
        increment=increment,
        covariance=turned(in_robot, float(T_map_before[2])),
        twist=twist,
        elapsed=elapsed,
    )
