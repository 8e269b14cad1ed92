# SPDX-License-Identifier: Apache-2.0
"""Small dense matrices in a fixed order of operations, which BLAS does not keep."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit

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
        for k in range(i):
            for j in range(m):
                b[i, j] -= L[i, k] * b[k, j]
        for j in range(m):
            b[i, j] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            for j in range(m):
                b[i, j] -= L[k, i] * b[k, j]
        for j in range(m):
            b[i, j] /= L[i, i]


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
def mirror(P: Float, size: int) -> None:
    """Copy the lower triangle of P's first ``size`` rows into the upper, in place."""
    for i in range(size):
        for j in range(i):
            P[j, i] = P[i, j]
