# SPDX-License-Identifier: Apache-2.0
"""Which observed point is which landmark: one by one, JCBB, and IPJC.

A *hypothesis* gives each point a landmark or none. All three search for the hypothesis with most
pairs, and among those for the least joint cost, and differ in how they judge one:

- ``individual``: each pair alone; the robot's error, which all pairs share, is not seen as such;
- ``jcbb`` (Neira and Tardos 2001): all pairs together under the *prior*, linearised there once. The
  test of a pair at depth k costs O(k^2);
- ``ipjc`` (Li and Olson 2012): each accepted pair updates the state, and the posterior judges the
  next, linearised where the pairs before have moved it. Any test costs O(1), an acceptance O(c^2)
  for c candidate landmarks; and as the posterior shows which points no landmark can explain any
  more, hypotheses that leave out good pairs are cut at once.

On linear problems the costs of JCBB and IPJC are equal (chain rule of the Gaussian), and so are
their answers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from slam.ekf import kernels
from slam.ekf.filter import EkfFilter
from slam.frames import Float

Ints = NDArray[np.int64]
MOST_NODES = 400  # hypotheses looked into; then the best one so far is the answer


@lru_cache(maxsize=1024)
def chi_square(probability: float, degrees: int) -> float:
    """The value below which a chi-square variable lies with this probability."""
    from scipy.special import gammaincinv  # 0.3 s that other SLAMs need not pay

    return 2.0 * float(gammaincinv(degrees / 2.0, probability))


@dataclass(frozen=True, kw_only=True)
class Gates:
    """Probabilities of chi-square.

    individual  a pair under the prior, 2 dof
    joint       k pairs, 2 k dof
    posterior   what one more pair adds to the joint cost, 2 dof
    """

    individual: float = 0.999999
    joint: float = 0.999999
    posterior: float = 0.99999

    def single(self) -> float:
        """Limit of a pair's cost under the prior."""
        return chi_square(self.individual, 2)

    def together(self, pairs: int) -> float:
        """Limit of the joint cost of so many pairs."""
        return chi_square(self.joint, 2 * pairs)

    def added(self) -> float:
        """Limit of what a pair adds to the joint cost."""
        return chi_square(self.posterior, 2)


@dataclass(kw_only=True)
class Effort:
    """What a search did: ``nodes`` looked into, ``tests`` of a pair, and ``work``, the
    multiplications of tests and acceptances to leading order; ``complete`` unless cut short."""

    nodes: int = 0
    tests: int = 0
    work: int = 0
    complete: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Association:
    """``landmarks`` (k,) the landmark of each point or -1; ``cost`` the joint chi-square.

    plausible  (k,) bool: some landmark lies within the point's individual gate, taken or not
    """

    landmarks: Ints
    cost: float
    plausible: NDArray[np.bool_]
    effort: Effort

    @property
    def matched(self) -> int:
        """Number of pairs."""
        return int((self.landmarks >= 0).sum())


Associate = Callable[[EkfFilter, Ints, Float, Float, Gates], Association]


@dataclass(kw_only=True)
class _Best:
    landmarks: list[int]
    pairs: int = 0
    cost: float = 0.0
    effort: Effort = field(default_factory=Effort)

    def beaten_by(self, pairs: int, cost: float) -> bool:
        return pairs > self.pairs or (pairs == self.pairs and cost < self.cost)


def individual(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Association:
    """Nearest neighbours: the cheapest pair of all first, each point and landmark once."""
    costs = _prior_costs(state, chosen, points, covariances, gates)
    landmarks, plausible = np.full(len(points), -1), _any(costs)
    effort, total = Effort(tests=costs.size, work=50 * costs.size), 0.0
    while costs.size and np.isfinite(costs.min()):
        k, j = np.unravel_index(int(costs.argmin()), costs.shape)
        total += float(costs[k, j])
        landmarks[k] = chosen[j]
        costs[k, :] = np.inf
        costs[:, j] = np.inf
    return Association(landmarks=landmarks, cost=total, plausible=plausible, effort=effort)


def jcbb(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Association:
    """Joint compatibility branch and bound: the reference, for small sets."""
    costs = _prior_costs(state, chosen, points, covariances, gates)
    best = _Best(landmarks=[-1] * len(points))
    order = _order(costs)
    search = _Jcbb(state, chosen, (points, covariances), costs, gates, best, order)
    search.visit(0, [], np.zeros((0, 0)), np.zeros(0), 0.0)
    return _answer(best, chosen, costs)


def ipjc(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Association:
    """Incremental posterior joint compatibility."""
    costs = _prior_costs(state, chosen, points, covariances, gates)
    columns = np.flatnonzero(np.isfinite(costs).any(axis=0))
    near = chosen[columns]
    best = _Best(landmarks=[-1] * len(points))
    best.effort.tests += costs.size
    best.effort.work += 50 * costs.size
    root = _Posterior(
        pose=state.pose.copy(),
        landmarks=state.landmarks[near],
        P=kernels.gather(state.error_covariance, near),
        pairs=[],
        cost=0.0,
    )
    prior = costs[:, columns]
    search = _Ipjc((points, covariances), prior, gates, best, _order(prior))
    search.visit(0, root)
    return _answer(best, near, costs)


METHODS: dict[str, Associate] = {"individual": individual, "jcbb": jcbb, "ipjc": ipjc}


def _prior_costs(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Float:
    """(k, len(chosen)) cost of each pair alone, inf beyond its gate."""
    return kernels.distances(
        state.pose,
        state.landmarks[chosen],
        kernels.gather(state.error_covariance, chosen),
        len(chosen),
        points,
        covariances,
        gates.single(),
    )


def _any(costs: Float) -> NDArray[np.bool_]:
    """(k,) which points have a finite cost with some landmark."""
    out: NDArray[np.bool_] = np.asarray(np.isfinite(costs).any(axis=1))
    return out


def _order(costs: Float) -> list[int]:
    """Points that have a candidate, the least ambiguous first."""
    counts = np.isfinite(costs).sum(axis=1)
    return [int(k) for k in np.argsort(counts, kind="stable") if counts[k] > 0]


def _answer(best: _Best, names: Ints, costs: Float) -> Association:
    found = np.array([names[j] if j >= 0 else -1 for j in best.landmarks], dtype=np.int64)
    return Association(
        landmarks=found,
        cost=best.cost,
        plausible=_any(costs),
        effort=best.effort,
    )


class _Jcbb:
    """Interpretation tree over the points in order; the joint cost by an incremental Cholesky."""

    def __init__(
        self,
        state: EkfFilter,
        chosen: Ints,
        seen: tuple[Float, Float],
        costs: Float,
        gates: Gates,
        best: _Best,
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
                _keep(best, pairs, cost)
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Posterior:
    """The state given the accepted pairs: pose, candidate landmarks, their covariance."""

    pose: Float
    landmarks: Float
    P: Float
    pairs: list[tuple[int, int]]
    cost: float


class _Ipjc:
    """The same tree, judged and bounded by the posterior of the pairs accepted so far."""

    def __init__(
        self,
        seen: tuple[Float, Float],
        prior: Float,
        gates: Gates,
        best: _Best,
        order: list[int],
    ) -> None:
        self.points, self.covariances = seen
        self.prior, self.gates, self.best, self.order = prior, gates, best, order

    def visit(self, depth: int, now: _Posterior) -> None:
        """Judge all points that are left against all landmarks that are left, then branch."""
        left = self.order[depth:]
        if not left:
            if self.best.beaten_by(len(now.pairs), now.cost):
                _keep(self.best, now.pairs, now.cost)
            return
        self._branch(depth, now, self._costs(left, now))

    def _costs(self, left: list[int], now: _Posterior) -> Float:
        costs = kernels.distances(
            now.pose,
            now.landmarks,
            now.P,
            len(now.landmarks),
            self.points[left],
            self.covariances[left],
            self.gates.added(),
        )
        self.best.effort.tests += costs.size
        self.best.effort.work += 50 * costs.size
        # No joint cost ever falls: what is too dear now is too dear with any pairs to come.
        limit = self.gates.together(len(now.pairs) + len(left)) - now.cost
        costs[(costs > limit) | ~np.isfinite(self.prior[left])] = np.inf
        costs[:, [j for _, j in now.pairs]] = np.inf
        return costs

    def _branch(self, depth: int, now: _Posterior, costs: Float) -> None:
        """``costs`` of the points from ``depth`` on; skipping a point changes no posterior."""
        best = self.best
        best.effort.nodes += 1
        if best.effort.nodes > MOST_NODES:
            best.effort.complete = False
            return
        possible = _any(costs)
        if not best.beaten_by(len(now.pairs) + int(possible.sum()), now.cost):
            return
        if not possible.any():
            _keep(best, now.pairs, now.cost)
            return
        skip = int(possible.argmax())
        k, count = self.order[depth + skip], len(now.pairs) + 1
        for j in np.argsort(costs[skip], kind="stable").tolist():
            dearer = now.cost + float(costs[skip, j])
            if dearer > self.gates.together(count):
                break
            if best.beaten_by(count + int(possible[skip + 1 :].sum()), dearer):
                self.visit(depth + skip + 1, self._accept(now, k, j))
        self._branch(depth + skip + 1, now, costs[skip + 1 :])

    def _accept(self, now: _Posterior, k: int, j: int) -> _Posterior:
        pose, landmarks, P = now.pose.copy(), now.landmarks.copy(), now.P.copy()
        self.best.effort.work += 8 * len(P) ** 2
        cost = kernels.absorb(
            pose,
            landmarks,
            len(landmarks),
            P,
            np.array([j]),
            self.points[k : k + 1],
            self.covariances[k : k + 1],
        )
        return _Posterior(
            pose=pose, landmarks=landmarks, P=P, pairs=[*now.pairs, (k, j)], cost=now.cost + cost
        )


def _keep(best: _Best, pairs: list[tuple[int, int]], cost: float) -> None:
    best.pairs, best.cost = len(pairs), cost
    best.landmarks = [-1] * len(best.landmarks)
    for k, j in pairs:
        best.landmarks[k] = j
