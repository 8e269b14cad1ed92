# SPDX-License-Identifier: Apache-2.0
"""Motions of one frame as kernels, bit for bit those of ``se2``: one call where Python needs many
for a few numbers each.
"""

import math

from slam._jit import inner, uncounted
from slam.arrays import Float

Triple = tuple[float, float, float]


@inner
def wrapped(angle: float) -> float:
    """``se2.wrap``, by the steps of Python's ``math.remainder``."""
    size = abs(angle)
    rest = size % math.tau
    over = math.tau - rest
    if rest > over:
        rest = -over
    elif rest == over:  # half a turn: to the even number of turns
        rest -= 2.0 * (0.5 * (size - rest) % math.tau)
    return math.copysign(1.0, angle) * rest


@inner
def _composed(a: Triple, b: Triple) -> Triple:
    c, s = math.cos(a[2]), math.sin(a[2])
    return a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrapped(a[2] + b[2])


@inner
def _three(pose: Float) -> Triple:
    return pose[0], pose[1], pose[2]


@inner
def _between(before: Triple, now: Triple) -> Triple:
    x, y, c, s = before[0], before[1], math.cos(before[2]), math.sin(before[2])
    return _composed((-c * x - s * y, s * x - c * y, wrapped(-before[2])), now)


@uncounted
def chained(
    before: Triple, now: Triple, T_map_before: Float, biases: tuple[float, float],
    increment: Float, T_map_robot: Float,
) -> None:  # fmt: skip
    """Fill the ``increment`` from pose to pose of an odometry with those heading biases (rad/m,
    rad/rad), and where it leads in the map."""
    x, y, turn = _between(before, now)
    turn = turn * (1.0 - biases[1]) - x * biases[0]
    increment[0], increment[1], increment[2] = x, y, turn
    x, y, turn = _composed(_three(T_map_before), (x, y, turn))
    T_map_robot[0], T_map_robot[1], T_map_robot[2] = x, y, turn


@uncounted
def extended(step: Float, covariance: Float, motion: Float, more: Float) -> None:
    """``step`` (3,) goes on by ``motion``, and its ``covariance`` by ``more`` as
    ``se2.propagate`` has it; both are changed."""
    bx, by, p, q = motion[0], motion[1], covariance, more
    c, s = math.cos(step[2]), math.sin(step[2])
    f, g = -s * bx - c * by, c * bx - s * by  # last column of F
    # F P and G Q; their last rows are those of P and Q
    a00, a01, a02 = p[0, 0] + f * p[2, 0], p[0, 1] + f * p[2, 1], p[0, 2] + f * p[2, 2]
    a10, a11, a12 = p[1, 0] + g * p[2, 0], p[1, 1] + g * p[2, 1], p[1, 2] + g * p[2, 2]
    b00, b01, b02 = c * q[0, 0] - s * q[1, 0], c * q[0, 1] - s * q[1, 1], c * q[0, 2] - s * q[1, 2]
    b10, b11, b12 = s * q[0, 0] + c * q[1, 0], s * q[0, 1] + c * q[1, 1], s * q[0, 2] + c * q[1, 2]
    xx = a00 + f * a02 + c * b00 - s * b01
    xy, yx = a01 + g * a02 + s * b00 + c * b01, a10 + f * a12 + c * b10 - s * b11
    yy = a11 + g * a12 + s * b10 + c * b11
    xt, tx = a02 + b02, p[2, 0] + f * p[2, 2] + c * q[2, 0] - s * q[2, 1]
    yt, ty = a12 + b12, p[2, 1] + g * p[2, 2] + s * q[2, 0] + c * q[2, 1]
    tt = p[2, 2] + q[2, 2]
    p[0, 0], p[1, 1], p[2, 2] = xx, yy, tt
    p[0, 1] = p[1, 0] = 0.5 * (xy + yx)
    p[0, 2] = p[2, 0] = 0.5 * (xt + tx)
    p[1, 2] = p[2, 1] = 0.5 * (yt + ty)
    step[0], step[1], step[2] = _composed(_three(step), _three(motion))
