# SPDX-License-Identifier: Apache-2.0
"""Small dense matrices in a fixed order of operations, which BLAS does not keep."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import inner, njit

Float = NDArray[np.float64]


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
