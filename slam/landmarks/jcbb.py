# SPDX-License-Identifier: Apache-2.0
"""Joint compatibility branch and bound (Neira and Tardos 2001): the reference, for small sets.

As published: pairs within the individual gate, hypotheses within the joint gate, and no other one.
"""

from __future__ import annotations

import math

import numpy as np

from slam._jit import njit
from slam.frames import Float
from slam.landmarks import kernels
from slam.landmarks.algebra import times, times_transposed
from slam.landmarks.filter import EkfFilter
from slam.landmarks.hypotheses import Best, Gates, Ints


class Jcbb:
    """Interpretation tree over the points in order; the joint cost by an incremental Cholesky."""

    def __init__(  # noqa: PLR0913 (arrays of one problem)
        self,
        state: EkfFilter,
        chosen: Ints,
        seen: tuple[Float, Float],
        costs: Float,
        gates: Gates,
        best: Best,
        order: list[int],
    ) -> None:
        self.points, self.covariances = seen
        self.costs, self.gates, self.best, self.order = costs, gates, best, order
        n, xi = len(chosen), np.zeros(3 + 2 * len(chosen))
        h, block = np.zeros(2), np.zeros((2, 5))
        H = np.zeros((2 * n, 3 + 2 * n))
        self.predicted = np.zeros((n, 2))
        for j, landmark in enumerate(state.landmarks[chosen]):
            kernels.look(state.pose, landmark, xi, 3 + 2 * j, h, block)
            H[2 * j : 2 * j + 2, :3] = block[:, :3]
            H[2 * j : 2 * j + 2, 3 + 2 * j : 5 + 2 * j] = block[:, 3:]
            self.predicted[j] = h
        marginal = kernels.gather(state.error_covariance, chosen)
        self.S: Float = times(H, times_transposed(marginal, H))

    def visit(
        self, depth: int, pairs: list[tuple[int, int]], L: Float, white: Float, cost: float
    ) -> None:
        """``L`` Cholesky factor of the pairs' joint covariance, ``white`` = L^-1 innovation."""
        best = self.best
        best.effort.nodes += 1
        if best.effort.nodes > self.gates.most_nodes * 1000:
            best.effort.complete = False
            return
        if depth == len(self.order):
            if best.beaten_by(len(pairs), cost):
                best.keep(pairs, cost)
            return
        k, taken = self.order[depth], {j for _, j in pairs}
        for j in np.argsort(self.costs[k], kind="stable").tolist():
            if not np.isfinite(self.costs[k, j]) or j in taken:
                continue
            grown, whitened = self._grow(k, j, pairs, L, white)
            total = cost + float((whitened[-2:] ** 2).sum())
            count, left = len(pairs) + 1, len(self.order) - depth - 1
            if total <= self.gates.together(count) and self._promising(count + left, total):
                self.visit(depth + 1, [*pairs, (k, j)], grown, whitened, total)
        if self._promising(len(pairs) + len(self.order) - depth - 1, cost):
            self.visit(depth + 1, pairs, L, white, cost)

    def _promising(self, most: int, cost: float) -> bool:
        return self.best.beaten_by(most, cost)

    def _grow(
        self, k: int, j: int, pairs: list[tuple[int, int]], L: Float, white: Float
    ) -> tuple[Float, Float]:
        self.best.effort.tests += 1
        rows = slice(2 * j, 2 * j + 2)
        columns = np.array([(2 * i, 2 * i + 1) for _, i in pairs], dtype=np.int64).ravel()
        cross, own = self.S[rows][:, columns], self.S[rows, rows] + self.covariances[k]
        return grow(L, white, cross, own, self.points[k] - self.predicted[j])


@njit
def grow(L: Float, white: Float, cross: Float, own: Float, fresh: Float) -> tuple[Float, Float]:
    """Cholesky factor and whitened innovation with two more rows.

    cross (2, n) and own (2, 2) are their covariances, fresh (2,) their innovation. Where these have
    no positive definite covariance the new rows are infinite: no gate lets them pass.
    """
    n = len(L)
    grown, whitened = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    grown[:n, :n], whitened[:n] = L, white
    for i in range(2):
        row = grown[n + i]
        whitened[n + i] = fresh[i]
        for j in range(n + i):
            row[j] = cross[i, j] if j < n else own[i, j - n]
            for k in range(j):
                row[j] -= row[k] * grown[j, k]
            row[j] /= grown[j, j]
            whitened[n + i] -= row[j] * whitened[j]
        left = own[i, i]
        for j in range(n + i):
            left -= row[j] * row[j]
        if not left > 0.0:
            whitened[n:] = np.inf
            return grown, whitened
        row[n + i] = math.sqrt(left)
        whitened[n + i] /= row[n + i]
    return grown, whitened
