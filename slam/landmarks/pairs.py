# SPDX-License-Identifier: Apache-2.0
"""Compiled tests of single pairs, point and landmark: what association does most of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam._jit import inner, njit
from slam.landmarks.kernels import ITERATIONS, SETTLED, look

Float = NDArray[np.float64]


@njit
def distances(  # noqa: C901, PLR0913 (kernel)
    pose: Float,
    landmarks: Float,
    P: Float,
    z: Float,
    R: Float,
    wanted: NDArray[np.bool_],
    gate: float,
    limit: float,
) -> Float:
    """(k, n) posterior cost of each ``wanted`` (k, n) pair of a point and a landmark.

    inf where not wanted, beyond ``gate``, beyond ``limit`` or singular. Costs are those of
    ``kernels.linearise`` for one pair: O(1) each, whatever the size of the state. Pairs far beyond
    the gate even with a bound on the curvature of h are not iterated.
    """
    out = np.full(wanted.shape, np.inf)
    h, H, start = np.zeros(2), np.zeros((2, 5)), np.zeros(5)
    M, place = np.zeros((5, 5)), np.zeros(5, dtype=np.int64)
    place[1], place[2] = 1, 2
    for j in range(wanted.shape[1]):
        any_wanted = False
        for k in range(len(z)):
            any_wanted |= wanted[k, j]
        if not any_wanted:
            continue
        place[3], place[4] = 3 + 2 * j, 4 + 2 * j
        for a in range(5):
            for b in range(5):
                M[a, b] = P[place[a], place[b]]
        start[:] = 0.0
        look(pose, landmarks[j], start, 3, h, H)
        x, y = h[0], h[1]
        p00, p01, p11 = spread(M, H)
        for k in range(len(z)):
            if not wanted[k, j]:
                continue
            u, v = z[k, 0] - x, z[k, 1] - y
            bend = 2.0 * M[2, 2] * (u * u + v * v)
            s00, s11, s01 = p00 + R[k, 0, 0] + bend, p11 + R[k, 1, 1] + bend, p01 + R[k, 0, 1]
            determinant = s00 * s11 - s01 * s01
            if not determinant > 0.0:
                continue
            rough = (s11 * u * u - 2.0 * s01 * u * v + s00 * v * v) / determinant
            if rough > 2.0 * gate:
                continue
            cost = pair_cost(pose, landmarks[j], M, z[k], R[k])
            if 0.0 <= cost <= min(gate, limit):
                out[k, j] = cost
    return out


@njit
def spread(M: Float, H: Float) -> tuple[float, float, float]:
    """Elements 00, 01 and 11 of H M H' with M (5, 5) and H (2, 5)."""
    p00 = p01 = p11 = 0.0
    for a in range(5):
        left, right = 0.0, 0.0
        for b in range(5):
            left += M[a, b] * H[0, b]
            right += M[a, b] * H[1, b]
        p00 += H[0, a] * left
        p01 += H[0, a] * right
        p11 += H[1, a] * right
    return p00, p01, p11


@inner
def pair_cost(pose: Float, landmark: Float, M: Float, z: Float, R: Float) -> float:
    """The cost of ``kernels.linearise`` for one pair, M (5, 5) being pose's and landmark's part.

    Negative where the innovation's covariance is singular.
    """
    xi, h, H = np.zeros(5), np.zeros(2), np.zeros((2, 5))
    cost = -1.0
    for _ in range(ITERATIONS):
        look(pose, landmark, xi, 3, h, H)
        u, v = z[0] - h[0], z[1] - h[1]
        for a in range(5):
            u += H[0, a] * xi[a]
            v += H[1, a] * xi[a]
        p00, p01, p11 = spread(M, H)
        s00, s01, s11 = p00 + R[0, 0], p01 + R[0, 1], p11 + R[1, 1]
        determinant = s00 * s11 - s01 * s01
        if not (s00 > 0.0 and determinant > 0.0):
            return -1.0
        wu, wv = (s11 * u - s01 * v) / determinant, (s00 * v - s01 * u) / determinant
        cost = u * wu + v * wv
        moved = 0.0
        for a in range(5):
            step = 0.0
            for b in range(5):
                step += M[a, b] * (H[0, b] * wu + H[1, b] * wv)
            moved += (step - xi[a]) ** 2
            xi[a] = step
        if moved < SETTLED:
            break
    return cost
