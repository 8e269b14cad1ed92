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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.ekf import kernels
from slam.ekf.filter import EkfFilter
from slam.ekf.hypotheses import MOST_NODES, Association, Best, Effort, Gates, Ints
from slam.ekf.jcbb import Jcbb
from slam.frames import Float

Associate = Callable[[EkfFilter, Ints, Float, Float, Gates], Association]


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
    best = Best(landmarks=[-1] * len(points))
    order = _order(costs)
    search = Jcbb(state, chosen, (points, covariances), costs, gates, best, order)
    search.visit(0, [], np.zeros((0, 0)), np.zeros(0), 0.0)
    return _answer(best, chosen, costs)


def ipjc(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Association:
    """Incremental posterior joint compatibility."""
    costs = _prior_costs(state, chosen, points, covariances, gates)
    columns = np.flatnonzero(np.isfinite(costs).any(axis=0))
    near = chosen[columns]
    best = Best(landmarks=[-1] * len(points))
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


def _answer(best: Best, names: Ints, costs: Float) -> Association:
    found = np.array([names[j] if j >= 0 else -1 for j in best.landmarks], dtype=np.int64)
    return Association(
        landmarks=found,
        cost=best.cost,
        plausible=_any(costs),
        effort=best.effort,
    )


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
        best: Best,
        order: list[int],
    ) -> None:
        self.points, self.covariances = seen
        self.prior, self.gates, self.best, self.order = prior, gates, best, order

    def visit(self, depth: int, now: _Posterior) -> None:
        """Judge all points that are left against all landmarks that are left, then branch."""
        left = self.order[depth:]
        if not left:
            if self.best.beaten_by(len(now.pairs), now.cost):
                self.best.keep(now.pairs, now.cost)
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
            best.keep(now.pairs, now.cost)
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
