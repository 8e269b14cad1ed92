# SPDX-License-Identifier: Apache-2.0
"""Arithmetic on (3, 3) covariances of (x, y, theta), in a fixed order of operations.

Element by element: whole-array expressions take seconds to compile.
"""

import math

import numpy as np

from slam._jit import inner, njit
from slam.arrays import Float
from slam.frontend.odometry_prior import inverse

WHOLE = np.array([0, 1, 2, 1, 3, 4, 2, 4, 5])  # places in the upper triangle, of all nine


def whole(upper: Float) -> Float:
    """(..., 3, 3) of the upper triangles (..., 6) of symmetric matrices, row by row."""
    out: Float = upper[..., WHOLE].reshape(*upper.shape[:-1], 3, 3)
    return out


@inner
def product(f: Float, p: Float) -> Float:
    """f p of (3, 3) matrices."""
    out = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                out[i, j] += f[i, k] * p[k, j]
    return out


@inner
def _sandwich(f: Float, p: Float, out: Float) -> None:
    """out = f p f' for a symmetric (3, 3) p, exactly symmetric; it may be p itself."""
    half = product(f, p)
    for i in range(3):
        for j in range(i, 3):
            total = 0.0
            for k in range(3):
                total += half[i, k] * f[j, k]
            out[i, j] = out[j, i] = total


@inner
def inverse_of(m: Float) -> Float:
    """``odometry_prior.inverted``."""
    out = np.empty((3, 3))
    inverse(m, out)
    return out


@inner
def plus(a: Float, share: float, b: Float) -> Float:
    """a + share b."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, j] + share * b[i, j]
    return out


@njit
def observable(geometry: Float, feigned: float, noisy: float, out: Float) -> tuple[int, float]:
    """``geometry`` without ``noisy`` times what noise feigns of it (``out``).

    Returns the number of directions of position in which nothing is left, and the angle (rad) of
    the first one. The rest is scaled so that the matrix stays positive semidefinite.
    """
    a, b, d = geometry[0, 0], geometry[0, 1], geometry[1, 1]
    angle = 0.5 * math.atan2(2.0 * b, a - d)  # of the larger eigenvalue
    c, s = math.cos(angle), math.sin(angle)
    mean, radius = 0.5 * (a + d), math.sqrt(0.25 * (a - d) * (a - d) + b * b)
    keep = np.zeros(2)
    lost = 0
    for k in range(2):
        value = mean + radius if k == 0 else mean - radius
        if value > noisy * feigned and value > 0.0:
            keep[k] = math.sqrt(1.0 - noisy * feigned / value)
        else:
            lost += 1
    T = np.zeros((3, 3))
    T[0, 0] = c * c * keep[0] + s * s * keep[1]
    T[0, 1] = T[1, 0] = c * s * (keep[0] - keep[1])
    T[1, 1] = s * s * keep[0] + c * c * keep[1]
    T[2, 2] = 1.0
    _sandwich(T, geometry, out)
    return lost, math.atan2(c, -s)


@inner
def root_share(part: tuple[float, float, float], whole: Float, times: float, out: Float) -> None:
    """``out[:2, :2]``: root of ``times`` the share, at most 1, that ``part`` has of ``whole``.

    Both are symmetric, ``part`` by xx, xy, yy; the share is taken along the axes of ``whole``.
    """
    a, b, d = whole[0, 0], whole[0, 1], whole[1, 1]
    angle = 0.5 * math.atan2(2.0 * b, a - d)
    c, s = math.cos(angle), math.sin(angle)
    xx, xy, yy = part
    most = c * c * xx + 2.0 * c * s * xy + s * s * yy, c * c * a + 2.0 * c * s * b + s * s * d
    least = s * s * xx - 2.0 * c * s * xy + c * c * yy, s * s * a - 2.0 * c * s * b + c * c * d
    one = math.sqrt(min(max(times * most[0] / max(most[1], 1e-12), 0.0), 1.0))
    other = math.sqrt(min(max(times * least[0] / max(least[1], 1e-12), 0.0), 1.0))
    out[0, 0] = c * c * one + s * s * other
    out[0, 1] = out[1, 0] = c * s * (one - other)
    out[1, 1] = s * s * one + c * c * other


@inner
def advance(  # noqa: PLR0913 (kernel)
    drift: Float, blind: Float, shared: Float, newest: Float, motion: Float, prior: Float,
    data: Float, variances: tuple[float, float, float, float], written: Float,
) -> None:  # fmt: skip
    """One frame; all arrays (3, 3) in the map frame, changed in place but the last three.

    ``data``: information of the match, with the weight it was given. ``variances``: per unit of
    information, of the shared error and of what is newly written; frames in which the first stays;
    by how much less (standard deviation) surfaces agree in their error of the heading. ``written``
    (3, 3): root of the share of the map in view that was written lately, by directions; it is off
    by what odometry was off then. What the data take off odometry's error is the map's by as much.
    """
    F, unit, kept = np.zeros((3, 3)), np.zeros((3, 3)), np.empty((3, 3))
    for i in range(3):
        F[i, i] = unit[i, i] = 1.0
    F[0, 2], F[1, 2] = -motion[1], motion[0]
    _sandwich(F, drift, drift)
    # odometry's: what the data leave of it
    moved = np.empty((3, 3))
    _sandwich(F, blind, moved)
    whole = plus(moved, 1.0, prior)
    precision = inverse_of(whole)
    left = product(inverse_of(plus(data, 1.0, precision)), precision)
    _sandwich(left, whole, blind)
    _sandwich(plus(unit, -1.0, left), moved, kept)
    _sandwich(written, kept, kept)
    # the shared error, as far as the data decide over the time that it stays the same
    _sandwich(inverse_of(plus(data, 1.0 / variances[2], inverse_of(prior))), data, moved)
    for i in range(3):
        for j in range(3):
            turns = (variances[3] if i == 2 else 1.0) * (variances[3] if j == 2 else 1.0)
            shared[i, j] = turns * variances[0] * moved[i, j]
            newest[i, j] = turns * variances[1] * moved[i, j] + kept[i, j]
            drift[i, j] += newest[i, j]


@njit
def followed(  # noqa: PLR0913 (kernel)
    drift: Float, blind: Float, shared: Float, newest: Float, motion: Float, prior: Float,
    geometry: Float, written: tuple[float, float, float, float, float],
    matched: tuple[float, float, float, float], variances: tuple[float, float, float, float],
) -> tuple[int, float]:  # fmt: skip
    """One frame: ``root_share`` and ``observable`` of ``geometry``, then ``advance``.

    Returns what ``observable`` does, and (2, 0) where no match was used.

    written  the part of ``root_share``, its times (0: nothing was), and the same share of headings
    matched  strength of the match (0: not used), 1 over the weight of ``geometry``, and the other
             two numbers of ``observable``
    """
    nothing, share, data = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    if written[3] > 0.0:
        root_share((written[0], written[1], written[2]), geometry, written[3], share)
        share[2, 2] = math.sqrt(min(written[3] * written[4], 1.0))
    lost, along = 2, 0.0
    if matched[0] > 0.0:
        view = plus(nothing, matched[1], geometry)
        lost, along = observable(view, matched[2], matched[3], data)
        data = plus(nothing, matched[0], data)
    else:
        for i in range(3):
            for j in range(3):
                blind[i, j] += shared[i, j]
    advance(drift, blind, shared, newest, motion, prior, data, variances, share)
    return lost, along


@njit
def carried(covariance: Float, motion: Float, x: float, y: float, out: Float) -> None:
    """``out``: a pose's covariance (3, 3) after a known ``motion`` (3,), both in the map frame.

    Without the part along the unit vector (x, y); (0, 0): all of it.
    """
    T = np.zeros((3, 3))
    T[0, 0], T[0, 1], T[1, 0], T[1, 1], T[2, 2] = 1.0 - x * x, -x * y, -x * y, 1.0 - y * y, 1.0
    for i in range(2):
        T[i, 2] = T[i, 1] * motion[0] - T[i, 0] * motion[1]
    _sandwich(T, covariance, out)
