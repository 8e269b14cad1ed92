# SPDX-License-Identifier: Apache-2.0
"""Joint compatibility branch and bound (Neira and Tardos 2001): the reference, for small sets."""

from __future__ import annotations

import numpy as np

from slam.ekf import kernels
from slam.ekf.filter import EkfFilter
from slam.ekf.hypotheses import MOST_NODES, Best, Gates, Ints
from slam.frames import Float


class Jcbb:
    """Interpretation tree over the points in order; the joint cost by an incremental Cholesky."""

    def __init__(
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
        self.S: Float = H @ kernels.gather(state.error_covariance, chosen) @ H.T

    def visit(
        self, depth: int, pairs: list[tuple[int, int]], L: Float, white: Float, cost: float
    ) -> None:
        """``L`` Cholesky factor of the pairs' joint covariance, ``white`` = L^-1 innovation."""
        best = self.best
        best.effort.nodes += 1
        if best.effort.nodes > MOST_NODES * 1000:
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
            added = float((whitened[-2:] ** 2).sum())
            count = len(pairs) + 1
            if added <= self.gates.added() and cost + added <= self.gates.together(count):
                left = len(self.order) - depth - 1
                if self._promising(count + left, cost + added):
                    self.visit(depth + 1, [*pairs, (k, j)], grown, whitened, cost + added)
        if self._promising(len(pairs) + len(self.order) - depth - 1, cost):
            self.visit(depth + 1, pairs, L, white, cost)

    def _promising(self, most: int, cost: float) -> bool:
        return self.best.beaten_by(most, cost)

    def _grow(
        self, k: int, j: int, pairs: list[tuple[int, int]], L: Float, white: Float
    ) -> tuple[Float, Float]:
        size = len(L)
        self.best.effort.tests += 1
        self.best.effort.work += (size + 2) ** 2
        grown = np.zeros((size + 2, size + 2))
        grown[:size, :size] = L
        rows = slice(2 * j, 2 * j + 2)
        if size:
            columns = np.array([(2 * i, 2 * i + 1) for _, i in pairs]).ravel()
            cross = self.S[rows][:, columns].T.copy()
            for r in range(size):  # forward substitution
                cross[r] = (cross[r] - L[r, :r] @ cross[:r]) / L[r, r]
            grown[size:, :size] = cross.T
        own = self.S[rows, rows] + self.covariances[k] - grown[size:, :size] @ grown[size:, :size].T
        grown[size:, size:] = np.linalg.cholesky(own)
        fresh = self.points[k] - self.predicted[j] - grown[size:, :size] @ white
        return grown, np.concatenate([white, np.linalg.solve(grown[size:, size:], fresh)])
