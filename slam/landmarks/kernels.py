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

import math

import numpy as np

from slam._jit import inner, njit
from slam.arrays import Float, Ints


@njit
def cholesky(S: Float) -> bool:
    """Lower Cholesky factor of S (n, n) in place; False where S is not positive definite."""
    n = len(S)
    for j in range(n):
        for k in range(j):
            S[j, j] -= S[j, k] * S[j, k]
        if not S[j, j] > 0.0:
            return False
        S[j, j] = math.sqrt(S[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                S[i, j] -= S[i, k] * S[j, k]
            S[i, j] /= S[j, j]
    return True


@njit
def solve(L: Float, b: Float) -> None:
    """(L L')^-1 b in place, b (n, m) with n rows."""
    n, m = b.shape
    for i in range(n):
        subtract_rows(b[i], L[i, :i], b[:i])
        for j in range(m):
            b[i, j] /= L[i, i]
    for i in range(n - 1, -1, -1):
        subtract_rows(b[i], L[i + 1 :, i], b[i + 1 :])
        for j in range(m):
            b[i, j] /= L[i, i]


@inner
def subtract_rows(out: Float, weights: Float, rows: Float) -> None:
    """out (m,) - weights (n,) times rows (n, m), in place, four rows in one pass over ``out``."""
    n = len(weights)
    whole = n - n % 4
    for k in range(0, whole, 4):
        a, b, c, d = weights[k], weights[k + 1], weights[k + 2], weights[k + 3]
        for j in range(len(out)):
            out[j] -= (a * rows[k, j] + b * rows[k + 1, j]) + (
                c * rows[k + 2, j] + d * rows[k + 3, j]
            )
    for k in range(whole, n):
        a = weights[k]
        for j in range(len(out)):
            out[j] -= a * rows[k, j]


@njit
def times(A: Float, B: Float) -> Float:
    """A B in a fixed order of summation, zeros of A skipped."""
    out = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            if A[i, k] != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += A[i, k] * B[k, j]
    return out


@njit
def times_transposed(A: Float, B: Float) -> Float:
    """A B' in a fixed order of summation, zeros of B skipped."""
    out = np.zeros((A.shape[0], B.shape[0]))
    for j in range(B.shape[0]):
        for k in range(B.shape[1]):
            if B[j, k] != 0.0:
                for i in range(A.shape[0]):
                    out[i, j] += A[i, k] * B[j, k]
    return out


@njit
def subtract_products(P: Float, size: int, At: Float, Bt: Float) -> None:
    """P - A B' of P's first ``size`` rows and columns in place, where the result is symmetric.

    ``At`` and ``Bt`` (4 k, size). Only the lower triangle is computed, four rows of P and four
    terms of each sum in one pass; the upper one is its mirror image.
    """
    few = size % 4
    for i in range(few):
        for j in range(i + 1):
            for k in range(len(At)):
                P[i, j] -= At[k, i] * Bt[k, j]
    for i in range(few, size, 4):
        p, q, r, s = P[i], P[i + 1], P[i + 2], P[i + 3]
        for k in range(0, len(At), 4):
            a, b, c, d = At[k], At[k + 1], At[k + 2], At[k + 3]
            a0, b0, c0, d0 = a[i], b[i], c[i], d[i]
            a1, b1, c1, d1 = a[i + 1], b[i + 1], c[i + 1], d[i + 1]
            a2, b2, c2, d2 = a[i + 2], b[i + 2], c[i + 2], d[i + 2]
            a3, b3, c3, d3 = a[i + 3], b[i + 3], c[i + 3], d[i + 3]
            for j in range(i + 4):  # what lies above the diagonal is overwritten by mirror()
                t, u, v, w = Bt[k, j], Bt[k + 1, j], Bt[k + 2, j], Bt[k + 3, j]
                p[j] -= (a0 * t + b0 * u) + (c0 * v + d0 * w)
                q[j] -= (a1 * t + b1 * u) + (c1 * v + d1 * w)
                r[j] -= (a2 * t + b2 * u) + (c2 * v + d2 * w)
                s[j] -= (a3 * t + b3 * u) + (c3 * v + d3 * w)
    mirror(P, size)


@njit
def mirror(P: Float, size: int) -> None:
    """Copy the lower triangle of P's first ``size`` rows into the upper, in place."""
    for i in range(size):
        for j in range(i):
            P[j, i] = P[i, j]


ITERATIONS = 6
SETTLED = 1e-10  # squared step of xi (m^2, rad^2) below which iterating stops


@inner
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
    Gt = np.zeros((4, size))  # the fourth row is empty: subtract_products takes four at a time
    Gt[0, 0], Gt[1, 0], Gt[2, 0] = cos, -sin, pose[1]
    Gt[0, 1], Gt[1, 1], Gt[2, 1] = sin, cos, -pose[0]
    Gt[2, 2] = 1.0
    for i in range(n):
        Gt[2, 3 + 2 * i], Gt[2, 4 + 2 * i] = landmarks[i, 1], -landmarks[i, 0]
    minus_QGt = np.zeros((4, size))
    for k in range(3):
        subtract_rows(minus_QGt[k], Q[k], Gt[:3])
    subtract_products(P, size, minus_QGt, Gt)


@njit
def linearise(  # noqa: C901, PLR0912 (kernel)
    pose: Float, landmarks: Float, P: Float, matched: Ints, z: Float, R: Float
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
                for k in range(3):
                    H[2 * i + r, k] = block[r, k]
                H[2 * i + r, 3 + 2 * i], H[2 * i + r, 4 + 2 * i] = block[r, 3], block[r, 4]
                innovation[2 * i + r, 0] = z[i, r] - h[r]
                for k in range(size):
                    innovation[2 * i + r, 0] += H[2 * i + r, k] * xi[k]
        PHt = times_transposed(marginal, H)
        S = times(H, PHt)
        for i in range(m):
            for r in range(2):
                for k in range(2):
                    S[2 * i + r, 2 * i + k] += R[i, r, k]
        L = S.copy()
        if not cholesky(L):
            return H, innovation, S, -1.0
        for i in range(2 * m):
            weights[i, 0] = innovation[i, 0]
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
def gather(P: Float, chosen: Ints) -> Float:
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
def absorb(  # noqa: PLR0913 (kernel)
    pose: Float,
    landmarks: Float,
    n: int,
    P: Float,
    matched: Ints,
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
    L = S.copy()
    cholesky(L)
    # Rows of (A | B)': the gain K beside P H', and P H' - K S (rounding, where the gain is the best
    # one) beside K. P - A B' is Joseph's (I - K H) P (I - K H)' + K R K' multiplied out.
    At, Bt = np.empty((4 * m, size)), np.empty((4 * m, size))
    PHt, Kt = Bt[: 2 * m], Bt[2 * m :]
    _times_sparse(P, matched, H, PHt)
    _copy(PHt, Kt)
    solve(L, Kt)
    _copy(Kt, At[: 2 * m])
    _copy(PHt, At[2 * m :])
    xi = np.zeros(size)
    for k in range(2 * m):
        subtract_rows(At[2 * m + k], S[k], Kt)
    subtract_rows(xi, -innovation[:, 0], Kt)
    subtract_products(P, size, At, Bt)
    retract(pose, landmarks, n, xi)
    return cost


@inner
def _copy(source: Float, target: Float) -> None:
    """Into rows of the same shape; an assignment would compile its error messages, for seconds."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@inner
def _times_sparse(P: Float, matched: Ints, H: Float, out: Float) -> None:
    """(P H')' in ``out`` (2 m, size), H's columns being the pose and the matched landmarks."""
    for row in range(len(out)):
        k = row // 2
        a = 3 + 2 * matched[k]
        x, y, turn, u, v = H[row, 0], H[row, 1], H[row, 2], H[row, 3 + 2 * k], H[row, 4 + 2 * k]
        for i in range(out.shape[1]):
            total = P[0, i] * x + P[1, i] * y + P[2, i] * turn
            out[row, i] = total + (P[a, i] * u + P[a + 1, i] * v)
