# SPDX-License-Identifier: Apache-2.0
"""Which observed point is which landmark: one by one, or jointly (IPJC).

A *hypothesis* gives each point a landmark or none. Both search for the hypothesis with most pairs,
and among those for the least cost, and differ in how they judge one:

- ``individual``: each pair alone; the robot's error, which all pairs share, is not seen as such;
- ``ipjc`` (Li and Olson 2012): each accepted pair updates the state, and the posterior judges the
  next, linearised where the pairs before have moved it. Any test costs O(1), an acceptance O(c^2)
  for c candidate landmarks. After each, all pairs that are left are tested again: the posterior
  shows which points no landmark can explain any more, and hypotheses that leave out good pairs are
  cut at once.

On linear problems the costs of IPJC sum up to the joint chi-square of all pairs (chain rule of the
Gaussian), which joint compatibility branch and bound (Neira and Tardos 2001) tests.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from slam.frames import Float
from slam.landmarks import kernels
from slam.landmarks.compatibility import Search, distances, visit
from slam.landmarks.filter import EkfFilter
from slam.landmarks.hypotheses import Association, Gates, Ints

Associate = Callable[[EkfFilter, Ints, Float, Float, Gates], Association]


def individual(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Association:
    """Nearest neighbours: the cheapest pair of all first, each point and landmark once."""
    costs = _prior_costs(state, chosen, points, covariances, gates)
    landmarks, plausible = np.full(len(points), -1), _any(costs)
    total = 0.0
    while costs.size and np.isfinite(costs.min()):
        k, j = np.unravel_index(int(costs.argmin()), costs.shape)
        total += float(costs[k, j])
        landmarks[k] = chosen[j]
        costs[k, :] = np.inf
        costs[:, j] = np.inf
    return Association(landmarks=landmarks, cost=total, plausible=plausible)


def ipjc(
    state: EkfFilter, chosen: Ints, points: Float, covariances: Float, gates: Gates
) -> Association:
    """Incremental posterior joint compatibility."""
    costs = _prior_costs(state, chosen, points, covariances, gates)
    columns = np.flatnonzero(np.isfinite(costs).any(axis=0))
    near, order = chosen[columns], _order(costs)
    k = len(order)
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
        counts=np.zeros(2, dtype=np.int64),
    )
    P = kernels.gather(state.error_covariance, near)
    visit(search, state.pose, state.landmarks[near], P, 0, 0, 0.0)
    found = np.full(len(points), -1)
    found[order] = np.where(search.best >= 0, near[search.best], -1) if k else found[:0]
    return Association(landmarks=found, cost=float(search.best_cost[0]), plausible=_any(costs))


METHODS: dict[str, Associate] = {"individual": individual, "ipjc": ipjc}


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
