# SPDX-License-Identifier: Apache-2.0
"""Compiled arithmetic of the EKF: landmarks seen from a pose, in right-invariant errors.

The state is one element of the group SE_n(2): heading R(theta), position p, landmarks l_1..l_n. Its
error xi = (xi_p, dtheta, xi_1, ..., xi_n) acts from the left (the right-invariant error of Barrau
and Bonnabel 2015):

    R = E R^,   p = E p^ + V xi_p,   l = E l^ + V xi_l
    E = exp(dtheta),   V = integral of exp(s dtheta) over s from 0 to 1

so that a turn of everything about any point is a straight line in xi. Seen from the robot

    h = R'(l - p) = R^'(l^ - p^) + R^' V(-dtheta) (xi_l - xi_p)

whose Jacobian at xi = 0 does not depend on the heading error at all: the filter cannot gain heading
that was never measured, the classic inconsistency of EKF-SLAM (Julier and Uhlmann 2001).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.ekf.algebra import cholesky, mirror, solve, times, times_transposed

Float = NDArray[np.float64]

ITERATIONS = 6
SETTLED = 1e-10  # squared step of xi (m^2, rad^2) below which iterating stops


@njit
def arc(angle: float) -> tuple[float, float, float, float]:
    """(s, c, ds, dc) with s = sin(a)/a, c = (1 - cos(a))/a and their derivatives by a."""
    if abs(angle) < 1e-4:
        return 1.0 - angle * angle / 6.0, angle / 2.0, -angle / 3.0, 0.5 - angle * angle / 8.0
    s, c = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle
    return s, c, (math.cos(angle) - s) / angle, s - c / angle


@njit
def look(pose: Float, landmark: Float, xi: Float, j: int, h: Float, H: Float) -> None:
    """Predicted point h (2,) in the robot frame and its Jacobian H (2, 5), at the error xi.

    Columns of H: xi_p (2), dtheta, xi_l (2); ``j`` is the place of xi_l in xi.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = landmark[0] - pose[0], landmark[1] - pose[1]
    ex, ey = xi[j] - xi[0], xi[j + 1] - xi[1]
    s, c, ds, dc = arc(xi[2])
    # V(-a) = [[s, c], [-c, s]]; everything is then turned by R^'.
    wx, wy = dx + s * ex + c * ey, dy - c * ex + s * ey
    h[0], h[1] = cos * wx + sin * wy, -sin * wx + cos * wy
    tx, ty = ds * ex + dc * ey, -dc * ex + ds * ey
    H[0, 2], H[1, 2] = cos * tx + sin * ty, -sin * tx + cos * ty
    H[0, 3], H[0, 4] = cos * s - sin * c, cos * c + sin * s
    H[1, 3], H[1, 4] = -sin * s - cos * c, -sin * c + cos * s
    for r in range(2):
        H[r, 0], H[r, 1] = -H[r, 3], -H[r, 4]


@njit
def retract(pose: Float, landmarks: Float, n: int, xi: Float) -> None:
    """Move pose (3,) and the first n landmarks (n, 2) by the error xi (3 + 2 n,), in place."""
    cos, sin = math.cos(xi[2]), math.sin(xi[2])
    s, c, _, _ = arc(xi[2])
    x, y = pose[0], pose[1]
    pose[0] = cos * x - sin * y + s * xi[0] - c * xi[1]
    pose[1] = sin * x + cos * y + c * xi[0] + s * xi[1]
    turned = pose[2] + xi[2]
    pose[2] = turned - 2.0 * math.pi * round(turned / (2.0 * math.pi))
    for i in range(n):
        x, y, k = landmarks[i, 0], landmarks[i, 1], 3 + 2 * i
        landmarks[i, 0] = cos * x - sin * y + s * xi[k] - c * xi[k + 1]
        landmarks[i, 1] = sin * x + cos * y + c * xi[k] + s * xi[k + 1]


@njit
def disturb(P: Float, pose: Float, landmarks: Float, n: int, heading: float, Q: Float) -> None:
    """P + G Q G' of a motion that ended at ``pose``, in place.

    Q (3, 3) is the covariance of the increment (x, y, theta) in the previous robot frame, whose
    heading was ``heading``. With w its error, xi_p changes by R w_xy - J p w_theta, dtheta by
    w_theta and, because the landmarks did not turn along, each xi_l by -J l w_theta.
    """
    size = 3 + 2 * n
    cos, sin = math.cos(heading), math.sin(heading)
    G = np.zeros((size, 3))
    G[0, 0], G[0, 1], G[0, 2] = cos, -sin, pose[1]
    G[1, 0], G[1, 1], G[1, 2] = sin, cos, -pose[0]
    G[2, 2] = 1.0
    for i in range(n):
        G[3 + 2 * i, 2], G[4 + 2 * i, 2] = landmarks[i, 1], -landmarks[i, 0]
    GQ = np.zeros((size, 3))
    for i in range(size):
        for k in range(3):
            for m in range(3):
                GQ[i, k] += G[i, m] * Q[m, k]
    for i in range(size):
        for k in range(3):
            if GQ[i, k] != 0.0:
                for j in range(i + 1):
                    P[i, j] += GQ[i, k] * G[j, k]
    mirror(P, size)


@njit
def linearise(
    pose: Float, landmarks: Float, P: Float, matched: NDArray[np.int64], z: Float, R: Float
) -> tuple[Float, Float, Float, float]:
    """Gauss-Newton on the m matched landmarks and the pose alone, which is exact: P is Gaussian.

    z (m, 2), R (m, 2, 2) in the robot frame. Returns H (2 m, 3 + 2 m) and the innovation (2 m, 1)
    at the maximum of the posterior, the innovation's covariance S, and the cost there, which for a
    linear h is the squared joint Mahalanobis distance (chi-square with 2 m degrees of freedom);
    negative where S is singular.
    """
    m = len(matched)
    size = 3 + 2 * m
    marginal = gather(P, matched)
    xi, step = np.zeros(size), np.zeros((size, 1))
    H, innovation = np.zeros((2 * m, size)), np.zeros((2 * m, 1))
    S = np.zeros((2 * m, 2 * m))
    h, block, weights = np.zeros(2), np.zeros((2, 5)), np.zeros((2 * m, 1))
    cost = -1.0
    for _ in range(ITERATIONS):
        for i in range(m):
            look(pose, landmarks[matched[i]], xi, 3 + 2 * i, h, block)
            for r in range(2):
                H[2 * i + r, :3] = block[r, :3]
                H[2 * i + r, 3 + 2 * i : 5 + 2 * i] = block[r, 3:]
                innovation[2 * i + r, 0] = z[i, r] - h[r]
                for k in range(size):
                    innovation[2 * i + r, 0] += H[2 * i + r, k] * xi[k]
        PHt = times_transposed(marginal, H)
        S = times(H, PHt)
        for i in range(m):
            S[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += R[i]
        L = S.copy()
        if not cholesky(L):
            return H, innovation, S, -1.0
        weights[:] = innovation
        solve(L, weights)
        cost = 0.0
        for i in range(2 * m):
            cost += innovation[i, 0] * weights[i, 0]
        step = times(PHt, weights)
        moved = 0.0
        for k in range(size):
            moved += (step[k, 0] - xi[k]) ** 2
            xi[k] = step[k, 0]
        if moved < SETTLED:
            break
    return H, innovation, S, cost


@njit
def gather(P: Float, chosen: NDArray[np.int64]) -> Float:
    """The marginal (3 + 2 m, 3 + 2 m) of the pose and the chosen landmarks."""
    m = len(chosen)
    index = np.empty(3 + 2 * m, dtype=np.int64)
    index[0], index[1], index[2] = 0, 1, 2
    for i in range(m):
        index[3 + 2 * i], index[4 + 2 * i] = 3 + 2 * chosen[i], 4 + 2 * chosen[i]
    out = np.empty((len(index), len(index)))
    for i in range(len(index)):
        for j in range(len(index)):
            out[i, j] = P[index[i], index[j]]
    return out


@njit
def absorb(
    pose: Float,
    landmarks: Float,
    n: int,
    P: Float,
    matched: NDArray[np.int64],
    z: Float,
    R: Float,
) -> float:
    """Iterated update of the whole state with m matched points, covariance in Joseph form.

    Returns the cost of ``linearise``; negative: singular, nothing was changed.
    """
    m, size = len(matched), 3 + 2 * n
    H, innovation, S, cost = linearise(pose, landmarks, P, matched, z, R)
    if cost < 0.0:
        return cost
    W = _times_sparse(P, size, matched, H)
    L = S.copy()
    cholesky(L)
    Kt = np.ascontiguousarray(W.T)
    solve(L, Kt)
    K = np.ascontiguousarray(Kt.T)
    Wt = np.ascontiguousarray(W.T)
    # Joseph: (I - K H) P (I - K H)' + K R K' = A - (A H' - K R) K' with A = P - K H P.
    _subtract_outer(P, size, K, Wt)
    U = _times_sparse(P, size, matched, H)
    for i in range(size):
        for k in range(m):
            for r in range(2):
                U[i, 2 * k + r] -= K[i, 2 * k] * R[k, 0, r] + K[i, 2 * k + 1] * R[k, 1, r]
    _subtract_outer(P, size, U, Kt)
    xi = np.zeros(size)
    for i in range(size):
        for k in range(2 * m):
            xi[i] += K[i, k] * innovation[k, 0]
    retract(pose, landmarks, n, xi)
    return cost


@njit
def _subtract_outer(P: Float, size: int, A: Float, Bt: Float) -> None:
    """P - A B' in place, from the lower half: the product is symmetric but for rounding."""
    for i in range(size):
        for k in range(A.shape[1]):
            a = A[i, k]
            for j in range(i + 1):
                P[i, j] -= a * Bt[k, j]
    mirror(P, size)


@njit
def _times_sparse(P: Float, size: int, matched: NDArray[np.int64], H: Float) -> Float:
    """P H' (size, 2 m), H's columns being the pose and the matched landmarks."""
    m = len(matched)
    out = np.zeros((size, 2 * m))
    for i in range(size):
        for k in range(m):
            a = 3 + 2 * matched[k]
            for r in range(2):
                row = 2 * k + r
                total = P[i, 0] * H[row, 0] + P[i, 1] * H[row, 1] + P[i, 2] * H[row, 2]
                total += P[i, a] * H[row, 3 + 2 * k] + P[i, a + 1] * H[row, 4 + 2 * k]
                out[i, row] = total
    return out


@njit
def distances(
    pose: Float, landmarks: Float, P: Float, n: int, z: Float, R: Float, gate: float
) -> Float:
    """(k, n) posterior cost of each single pair (point k, landmark n); inf where beyond ``gate``.

    Costs are those of ``linearise`` for one pair: O(1) each, whatever the size of the state. Pairs
    far beyond the gate even with a bound on the curvature of h are not iterated.
    """
    out = np.full((len(z), n), np.inf)
    h, H, xi, one = np.zeros(2), np.zeros((2, 5)), np.zeros(3 + 2 * n), np.zeros(1, dtype=np.int64)
    S, place = np.zeros((2, 2)), np.zeros(5, dtype=np.int64)
    place[1], place[2] = 1, 2
    for j in range(n):
        look(pose, landmarks[j], xi, 3 + 2 * j, h, H)
        place[3], place[4] = 3 + 2 * j, 4 + 2 * j
        S[:] = 0.0
        for a in range(5):
            for b in range(5):
                value = P[place[a], place[b]]
                S[0, 0] += H[0, a] * value * H[0, b]
                S[0, 1] += H[0, a] * value * H[1, b]
                S[1, 1] += H[1, a] * value * H[1, b]
        one[0] = j
        for k in range(len(z)):
            u, v = z[k, 0] - h[0], z[k, 1] - h[1]
            bend = 2.0 * P[2, 2] * (u * u + v * v)
            s00, s11 = S[0, 0] + R[k, 0, 0] + bend, S[1, 1] + R[k, 1, 1] + bend
            s01 = S[0, 1] + R[k, 0, 1]
            rough = (s11 * u * u - 2.0 * s01 * u * v + s00 * v * v) / (s00 * s11 - s01 * s01)
            if rough > 2.0 * gate:
                continue
            cost = linearise(pose, landmarks, P, one, z[k : k + 1], R[k : k + 1])[3]
            if 0.0 <= cost <= gate:
                out[k, j] = cost
    return out
