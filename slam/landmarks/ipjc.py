# SPDX-License-Identifier: Apache-2.0
"""Compiled search of incremental posterior joint compatibility (Li and Olson 2012)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam._jit import inner, njit
from slam.landmarks.kernels import absorb
from slam.landmarks.pairs import distances

Float = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
PAIRS, NODES, TESTS, CUT_SHORT = range(4)  # places in ``Search.counts``


class Search(NamedTuple):
    """What stays the same during the search of k points among n landmarks, and what it found.

    points, covariances  (k, 2) m and (k, 2, 2) m^2, the least ambiguous first
    plausible            (k, n) pairs within the gate of the prior
    together             (k + 1,) limit of the joint cost of so many pairs
    added                limit of what one more pair adds
    most_nodes           hypotheses looked into
    chosen, taken        (k,) place of each point's landmark or -1, (n,): the hypothesis looked into
    best, best_cost      (k,), (1,): the best one so far
    counts               (4,) pairs of the best one; nodes; tests of a pair; 1 if it was cut short
    """

    points: Float
    covariances: Float
    plausible: Bools
    together: Float
    added: float
    most_nodes: int
    chosen: Ints
    taken: Bools
    best: Ints
    best_cost: Float
    counts: Ints


@inner
def _better(search: Search, pairs: int, cost: float) -> bool:
    """More pairs than the best hypothesis, or as many at less cost."""
    most = search.counts[PAIRS]
    return bool(pairs > most or (pairs == most and cost < search.best_cost[0]))


@inner
def _judge(  # noqa: PLR0913 (kernel)
    search: Search, pose: Float, landmarks: Float, P: Float, first: int, pairs: int, cost: float
) -> Float:
    """(k, n) what each pair of a point from ``first`` on with a landmark not taken would add."""
    wanted = np.zeros_like(search.plausible)
    tests = 0
    for i in range(first, wanted.shape[0]):
        for j in range(wanted.shape[1]):
            wanted[i, j] = search.plausible[i, j] and not search.taken[j]
            tests += wanted[i, j]
    search.counts[TESTS] += tests
    # No joint cost ever falls: what is too dear now is too dear with any pairs to come.
    limit = search.together[pairs + len(wanted) - first] - cost
    return distances(
        pose, landmarks, P, search.points, search.covariances, wanted, search.added, limit
    )


@inner
def _next(costs: Float, after: float, j: int) -> int:
    """Place of the cheapest that is dearer than ``after``, or as dear and behind ``j``; or -1."""
    found = -1
    for i in range(len(costs)):
        later = costs[i] > after or (costs[i] == after and i > j)
        if later and costs[i] < np.inf and (found < 0 or costs[i] < costs[found]):
            found = i
    return found


@njit
def visit(  # noqa: C901, PLR0913 (kernel)
    search: Search, pose: Float, landmarks: Float, P: Float, first: int, pairs: int, cost: float
) -> None:
    """All hypotheses that begin with the ``pairs`` chosen among the points before ``first``.

    pose, landmarks (n, 2) and P are the posterior of these pairs, ``cost`` is their joint cost.
    Leaving a point out changes no posterior: then the same costs hold for the points behind it.
    """
    k, counts = len(search.points), search.counts
    costs = _judge(search, pose, landmarks, P, first, pairs, cost)
    possible = np.zeros(k + 1, dtype=np.int64)  # how many points from each on have a landmark
    for i in range(k - 1, first - 1, -1):
        possible[i] = possible[i + 1] + (_next(costs[i], -1.0, -1) >= 0)
    i = first
    while _better(search, pairs + possible[i], cost):
        left = possible[i]
        if left == 0:
            for point in range(k):
                search.best[point] = search.chosen[point]
            search.best_cost[0] = cost
            counts[PAIRS] = pairs
            return
        counts[NODES] += 1
        if counts[NODES] > search.most_nodes:
            counts[CUT_SHORT] = 1
            return
        while possible[i + 1] == left:
            i += 1
        j = _next(costs[i], -1.0, -1)
        while j >= 0:
            dearer = cost + costs[i, j]
            if dearer > search.together[pairs + 1]:
                break
            if _better(search, pairs + left, dearer):
                now = (pose.copy(), landmarks.copy(), P.copy())
                z, R = search.points[i : i + 1], search.covariances[i : i + 1]
                added = absorb(now[0], now[1], len(landmarks), now[2], np.array([j]), z, R)
                if added >= 0.0:  # else singular but for rounding: no pair
                    search.chosen[i], search.taken[j] = j, True
                    visit(search, now[0], now[1], now[2], i + 1, pairs + 1, cost + added)
                    search.chosen[i], search.taken[j] = -1, False
            j = _next(costs[i], costs[i, j], j)
        i += 1
