# SPDX-License-Identifier: Apache-2.0
"""Rigid motions of the plane.

A pose is a ``(3,)`` float64 array ``(x m, y m, theta rad)``. ``T_a_b`` maps coordinates in frame
b to coordinates in frame a, so neighbouring names match and cancel:
``T_a_c = compose(T_a_b, T_b_c)``.

Sines and cosines come from ``math`` (libm) and products are written out, because NumPy's own
``sin``, ``exp`` and ``matmul`` change their last bit with the CPU's vector unit and poses are
recorded values.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

IDENTITY: Array = np.zeros(3)
IDENTITY.setflags(write=False)


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi] rad."""
    return math.remainder(angle, math.tau)


def wrap_array(angles: ArrayLike) -> Array:
    """``wrap`` for an array of any shape, rad."""
    values = np.asarray(angles, dtype=np.float64)
    return values - math.tau * np.round(values / math.tau)


def compose(T_a_b: ArrayLike, T_b_c: ArrayLike) -> Array:
    """``T_a_c``: first the motion from c to b, then from b to a. Heading wrapped to [-pi, pi]."""
    ax, ay, at = np.asarray(T_a_b, dtype=np.float64).tolist()
    bx, by, bt = np.asarray(T_b_c, dtype=np.float64).tolist()
    c, s = math.cos(at), math.sin(at)
    return np.array([ax + c * bx - s * by, ay + s * bx + c * by, wrap(at + bt)])


def inverse(T_a_b: ArrayLike) -> Array:
    """``T_b_a``."""
    x, y, theta = np.asarray(T_a_b, dtype=np.float64).tolist()
    c, s = math.cos(theta), math.sin(theta)
    return np.array([-c * x - s * y, s * x - c * y, wrap(-theta)])


def between(T_a_b: ArrayLike, T_a_c: ArrayLike) -> Array:
    """``T_b_c``: pose c as seen from pose b."""
    return compose(inverse(T_a_b), T_a_c)


def transform(T_a_b: ArrayLike, points_b: ArrayLike) -> Array:
    """``points_a`` (n, 2) m from ``points_b`` (n, 2) m."""
    points = np.asarray(points_b, dtype=np.float64)
    x, y, theta = np.asarray(T_a_b, dtype=np.float64).tolist()
    c, s = math.cos(theta), math.sin(theta)
    px, py = points[..., 0], points[..., 1]
    out = np.empty_like(points)
    out[..., 0] = c * px - s * py + x
    out[..., 1] = s * px + c * py + y
    return out


def exp(twist: ArrayLike, duration: float = 1.0) -> Array:
    """Pose reached after ``duration`` s of constant body twist ``(vx m/s, vy m/s, omega rad/s)``.

    The exponential map of SE(2): exact on an arc, series below 1e-6 rad where sin(t)/t cancels.
    """
    vx, vy, omega = np.asarray(twist, dtype=np.float64).tolist()
    theta = omega * duration
    if abs(theta) < 1e-6:
        sinc, cosc = 1.0 - theta * theta / 6.0, theta / 2.0
    else:
        half_sine = math.sin(theta / 2.0)  # 1 - cos cancels for small angles, 2 sin^2 does not
        sinc, cosc = math.sin(theta) / theta, 2.0 * half_sine * half_sine / theta
    dx, dy = vx * duration, vy * duration
    return np.array([sinc * dx - cosc * dy, cosc * dx + sinc * dy, wrap(theta)])


def log(T_a_b: ArrayLike) -> Array:
    """Constant body twist that reaches ``T_a_b`` from the identity in 1 s; inverse of ``exp``."""
    x, y, theta = np.asarray(T_a_b, dtype=np.float64).tolist()
    theta = wrap(theta)
    half = theta / 2.0
    if abs(theta) < 1e-6:
        k = 1.0 - theta * theta / 12.0
    else:
        k = half * math.cos(half) / math.sin(half)
    return np.array([k * x + half * y, -half * x + k * y, theta])


def interpolate(T_a_b: ArrayLike, T_a_c: ArrayLike, fraction: float) -> Array:
    """Pose on the arc from b (fraction 0) to c (fraction 1); extrapolates outside [0, 1]."""
    return compose(T_a_b, exp(log(between(T_a_b, T_a_c)), fraction))


def adjoint(T_a_b: ArrayLike) -> Array:
    """(3, 3) matrix that carries a small motion ``(dx, dy, dtheta)`` of frame b into frame a.

    ``compose(T_a_b, d_b)`` equals ``compose(d_a, T_a_b)`` to first order with
    ``d_a = adjoint(T_a_b) @ d_b``.
    """
    x, y, theta = np.asarray(T_a_b, dtype=np.float64).tolist()
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, y], [s, c, -x], [0.0, 0.0, 1.0]])


def rotation(theta: float) -> Array:
    """(2, 2) rotation by ``theta`` rad."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


def propagate(
    covariance_a_b: ArrayLike, T_a_b: ArrayLike, T_b_c: ArrayLike, covariance_b_c: ArrayLike
) -> Array:
    """Covariance (3, 3) of ``compose(T_a_b, T_b_c)`` to first order: F P F' + G Q G'.

    (Thrun, Burgard, Fox 2005, section 3.3.) F and G are the Jacobians of ``compose`` by its two
    arguments, both in plain ``(x, y, theta)`` coordinates.
    """
    theta = float(np.asarray(T_a_b, dtype=np.float64)[2])
    bx, by, _ = np.asarray(T_b_c, dtype=np.float64).tolist()
    c, s = math.cos(theta), math.sin(theta)
    f, g = -s * bx - c * by, c * bx - s * by  # last column of F
    P0, P1, P2 = np.asarray(covariance_a_b, dtype=np.float64).tolist()
    Q0, Q1, Q2 = np.asarray(covariance_b_c, dtype=np.float64).tolist()
    FP = [[a + f * e for a, e in zip(P0, P2, strict=True)]]
    FP += [[b + g * e for b, e in zip(P1, P2, strict=True)], P2]
    GQ = [[c * a - s * b for a, b in zip(Q0, Q1, strict=True)]]
    GQ += [[s * a + c * b for a, b in zip(Q0, Q1, strict=True)], Q2]
    out = np.array(
        [
            [
                p[0] + f * p[2] + c * q[0] - s * q[1],
                p[1] + g * p[2] + s * q[0] + c * q[1],
                p[2] + q[2],
            ]
            for p, q in zip(FP, GQ, strict=True)
        ]
    )
    return np.asarray(0.5 * (out + out.T), dtype=np.float64)
