# SPDX-License-Identifier: Apache-2.0
"""Which observed point is which landmark: one by one, JCBB, and IPJC.

A *hypothesis* gives each point a landmark or none. All three search for the hypothesis with most
pairs, and among those for the least joint cost, and differ in how they judge one:

- ``individual``: each pair alone; the robot's error, which all pairs share, is not seen as such;
- ``jcbb`` (Neira and Tardos 2001): all pairs together under the *prior*, linearised there once. The
  test of a pair at depth k costs O(k^2);
- ``ipjc`` (Li and Olson 2012): each accepted pair updates the state, and the posterior judges the
  next, linearised where the pairs before have moved it. Any test costs O(1), an acceptance O(c^2)
  for c candidate landmarks. After each, all pairs that are left are tested again: the posterior
  shows which points no landmark can explain any more, and hypotheses that leave out good pairs are
  cut at once.

On linear problems the costs of JCBB and IPJC are equal (chain rule of the Gaussian), and so are
their answers wherever the gate on what a pair adds, which only IPJC has, cuts nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from slam.frames import Float
from slam.landmarks import kernels
from slam.landmarks.compatibility import CUT_SHORT, NODES, TESTS, Jcbb, Search, distances, visit
from slam.landmarks.filter import EkfFilter
from slam.landmarks.hypotheses import Association, Best, Effort, Gates, Ints

Associate = Callable[[EkfFilter, Ints, Float, Float, Gates], Association]


def individual(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Association:
    """Nearest neighbours: the cheapest pair of all first, each point and landmark once."""
    costs = _prior_costs(state, chosen, points, covariances, gates)
    landmarks, plausible = np.full(len(points), -1), _any(costs)
    effort, total = Effort(tests=costs.size), 0.0
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
    near, order = chosen[columns], _order(costs)
    k, counts = len(order), np.zeros(4, dtype=np.int64)
    counts[TESTS] = costs.size
    search = Search(
        points=points[order],
        covariances=covariances[order],
        plausible=np.ascontiguousarray(np.isfinite(costs[order][:, columns])),
        together=np.array([0.0] + [gates.together(n) for n in range(1, k + 1)]),
        added=gates.added(),
        most_nodes=gates.most_nodes,
        chosen=np.full(k, -1),
        taken=np.zeros(len(near), dtype=np.bool_),
        best=np.full(k, -1),
        best_cost=np.zeros(1),
        counts=counts,
    )
    P = kernels.gather(state.error_covariance, near)
    visit(search, state.pose, state.landmarks[near], P, 0, 0, 0.0)
    found = np.full(len(points), -1)
    found[order] = np.where(search.best >= 0, near[search.best], -1) if k else found[:0]
    return Association(
        landmarks=found,
        cost=float(search.best_cost[0]),
        plausible=_any(costs),
        effort=Effort(
            nodes=int(counts[NODES]),
            tests=int(counts[TESTS]),
            complete=not counts[CUT_SHORT],
        ),
    )


METHODS: dict[str, Associate] = {"individual": individual, "jcbb": jcbb, "ipjc": ipjc}


def _prior_costs(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Float:
    """(k, len(chosen)) cost of each pair alone, inf beyond its gate."""
    gate = gates.single()
    return distances(
        state.pose,
        state.landmarks[chosen],
        kernels.gather(state.error_covariance, chosen),
        points,
        covariances,
        np.ones((len(points), len(chosen)), dtype=np.bool_),
        gate,
        gate,
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
