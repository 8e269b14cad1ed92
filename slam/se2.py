# SPDX-License-Identifier: Apache-2.0
"""Rigid motions of the plane.

A pose is a ``(3,)`` float64 array ``(x m, y m, theta rad)``. ``T_a_b`` maps coordinates in frame
b to coordinates in frame a, so neighbouring names match and cancel:
``T_a_c = compose(T_a_b, T_b_c)``.

Sines and cosines come from ``math`` (libm) and products are written out, because NumPy's own
``sin``, ``exp`` and ``matmul`` change their last bit with the CPU's vector unit and poses are
recorded values.
"""

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


def rotation(theta: float) -> Array:
    """(2, 2) rotation by ``theta`` rad."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


def fit(points_b: ArrayLike, points_a: ArrayLike) -> Array:
    """``T_a_b`` with least sum |points_a - T_a_b points_b|^2; points (n, 2) m, pair by pair.

    (Umeyama 1991 without scale; in the plane the rotation is an arctangent.) The rotation is zero
    where the points do not determine one.
    """
    b = np.asarray(points_b, dtype=np.float64)
    a = np.asarray(points_a, dtype=np.float64)
    mean_b, mean_a = b.mean(axis=0), a.mean(axis=0)
    db, da = b - mean_b, a - mean_a
    cosine = float((db * da).sum())
    sine = float((db[:, 0] * da[:, 1] - db[:, 1] * da[:, 0]).sum())
    theta = math.atan2(sine, cosine)
    x, y = mean_a - transform([0.0, 0.0, theta], mean_b)
    return np.array([x, y, theta])


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
    (p00, p01, p02), (p10, p11, p12), (p20, p21, p22) = np.asarray(
        covariance_a_b, dtype=np.float64
    ).tolist()
    (q00, q01, q02), (q10, q11, q12), (q20, q21, q22) = np.asarray(
        covariance_b_c, dtype=np.float64
    ).tolist()
    # F P and G Q; their last rows are those of P and Q
    a00, a01, a02 = p00 + f * p20, p01 + f * p21, p02 + f * p22
    a10, a11, a12 = p10 + g * p20, p11 + g * p21, p12 + g * p22
    b00, b01, b02 = c * q00 - s * q10, c * q01 - s * q11, c * q02 - s * q12
    b10, b11, b12 = s * q00 + c * q10, s * q01 + c * q11, s * q02 + c * q12
    xx = a00 + f * a02 + c * b00 - s * b01
    xy, yx = a01 + g * a02 + s * b00 + c * b01, a10 + f * a12 + c * b10 - s * b11
    yy = a11 + g * a12 + s * b10 + c * b11
    xt, tx = a02 + b02, p20 + f * p22 + c * q20 - s * q21
    yt, ty = a12 + b12, p21 + g * p22 + s * q20 + c * q21
    xy, xt, yt = 0.5 * (xy + yx), 0.5 * (xt + tx), 0.5 * (yt + ty)
    return np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, p22 + q22]])
