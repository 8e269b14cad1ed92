# SPDX-License-Identifier: Apache-2.0
"""Sparse symmetric equations of 3 x 3 blocks, as a pose graph has them: L L^T x = r.

Where the numbers of L lie is worked out once for a graph, by SciPy's solver, which eliminates poses
by least degree: that leaves the factor of a map's graph sparse. Each solution is then one kernel.
SciPy's own, which knows of no blocks and no symmetry, takes several times as long.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from slam._jit import inner, uncounted
from slam.arrays import Float, Ints

_SYMMETRIC: Any = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
LEAST = 1e-9  # 1/m^2, 1/rad^2: added to the diagonal, for poses that nothing holds; set by hand
LEAK = 1e-6  # edges: the same for the Laplacian, whose pattern alone is used; set by hand


class Pattern:
    """Of the lower factor, for poses 1..n-1 that pairs of ends (m, 2) join; pose 0 is held fast.

    place   (n,) of each pose in the order of elimination, -1 for the one that is held
    starts  (n,) of the blocks of each column, its diagonal first; ``rows`` of all blocks, rising
    blocks  (m,) of each pair's own block, -1 where one end is held
    """

    def __init__(self, n: int, ends: Ints) -> None:
        both = np.append(ends, ends[:, ::-1], axis=0).T
        ones = sparse.csc_matrix((np.ones(both.shape[1]), (both[0], both[1])), shape=(n, n))
        # the graph's Laplacian: no block of its factor is 0 by chance, or small for a long chain
        graph = sparse.diags(np.bincount(both[0], minlength=n) + LEAK, format="csc") - ones
        solved = splu(graph[1:, 1:], permc_spec="MMD_AT_PLUS_A", **_SYMMETRIC)
        self.place = np.append(-1, solved.perm_c).astype(np.int64)
        lower = solved.L
        lower.sort_indices()
        self.starts, self.rows = lower.indptr.astype(np.int64), lower.indices.astype(np.int64)
        columns = np.repeat(np.arange(n - 1), np.diff(self.starts))
        first, last = np.sort(self.place[ends], axis=1).T
        at = np.searchsorted(columns * n + self.rows, first * n + last)
        self.blocks = np.where(first < 0, -1, at)


@inner
def _subtract(block: Float, A: Float, B: Float) -> None:
    """A B^T from a block."""
    for i in range(3):
        for j in range(3):
            for k in range(3):
                block[i, j] -= A[i, k] * B[j, k]


@inner
def _divide(L: Float, block: Float) -> None:
    """The block times L^-T."""
    for i in range(3):
        for j in range(3):
            total = block[i, j]
            for k in range(j):
                total -= block[i, k] * L[j, k]
            block[i, j] = total / L[j, j]


@inner
def _root(block: Float) -> None:
    """L of a diagonal block, in its place."""
    for j in range(3):
        for i in range(j, 3):
            total = block[i, j]
            for k in range(j):
                total -= block[i, k] * block[j, k]
            block[i, j] = math.sqrt(max(total + LEAST, LEAST)) if i == j else total / block[j, j]


@inner
def _update(starts: Ints, rows: Ints, blocks: Float, j: int) -> None:
    """Take column ``j`` of L out of those to its right."""
    end = starts[j + 1]
    for p in range(starts[j] + 1, end):
        into, last = starts[rows[p]], starts[rows[p] + 1]
        for q in range(p, end):
            while into < last and rows[into] < rows[q]:
                into += 1
            if into < last and rows[into] == rows[q]:  # else it is 0
                _subtract(blocks[into], blocks[q], blocks[p])


@uncounted
def solve(starts: Ints, rows: Ints, blocks: Float, x: Float) -> None:  # noqa: C901 (kernel)
    """``x`` (n, 3), the right side, becomes the solution; ``blocks`` (k, 3, 3) the factor."""
    n = len(x)
    for j in range(n):
        diagonal = blocks[starts[j]]
        _root(diagonal)
        for i in range(3):
            for k in range(i):
                x[j, i] -= diagonal[i, k] * x[j, k]
            x[j, i] /= diagonal[i, i]
        for p in range(starts[j] + 1, starts[j + 1]):
            _divide(diagonal, blocks[p])
            for i in range(3):
                for k in range(3):
                    x[rows[p], i] -= blocks[p, i, k] * x[j, k]
        _update(starts, rows, blocks, j)
    for j in range(n - 1, -1, -1):
        diagonal = blocks[starts[j]]
        for i in range(2, -1, -1):
            for p in range(starts[j] + 1, starts[j + 1]):
                for k in range(3):
                    x[j, i] -= blocks[p, k, i] * x[rows[p], k]
            for k in range(i + 1, 3):
                x[j, i] -= diagonal[k, i] * x[j, k]
            x[j, i] /= diagonal[i, i]
