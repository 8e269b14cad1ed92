# SPDX-License-Identifier: Apache-2.0
"""Which observed point is which landmark, judged jointly (IPJC).

A *hypothesis* gives each point a landmark or none. Searched for is the one with most pairs, and
among those the one of least cost. As Li and Olson (2012) have it, each accepted pair updates the
state, and the posterior judges the next, linearised where the pairs before have moved it. Any test
costs O(1), an acceptance O(c^2) for c candidate landmarks. After each, all pairs that are left are
tested again: the posterior shows which points no landmark can explain any more, and hypotheses that
leave out good pairs are cut at once.

On linear problems the costs of IPJC sum up to the joint chi-square of all pairs (chain rule of the
Gaussian), which joint compatibility branch and bound (Neira and Tardos 2001) tests.
"""

from typing import NamedTuple

import numpy as np

from slam._jit import inner, njit
from slam.arrays import Bools, Float, Ints
from slam.landmarks import kernels
from slam.landmarks.filter import EkfFilter
from slam.landmarks.hypotheses import Association, Gates
from slam.landmarks.kernels import ITERATIONS, SETTLED, absorb, look


@njit
def distances(  # noqa: C901, PLR0913 (kernel)
    pose: Float,
    landmarks: Float,
    P: Float,
    z: Float,
    R: Float,
    wanted: Bools,
    gate: float,
    limit: float,
) -> Float:
    """(k, n) posterior cost of each ``wanted`` (k, n) pair of a point and a landmark.

    inf where not wanted, beyond ``gate``, beyond ``limit`` or singular. Costs are those of
    ``kernels.linearise`` for one pair: O(1) each, whatever the size of the state. Pairs far beyond
    the gate even with a bound on the curvature of h are not iterated.
    """
    out = np.full(wanted.shape, np.inf)
    h, H, start = np.zeros(2), np.zeros((2, 5)), np.zeros(5)
    M, place = np.zeros((5, 5)), np.zeros(5, dtype=np.int64)
    place[1], place[2] = 1, 2
    for j in range(wanted.shape[1]):
        any_wanted = False
        for k in range(len(z)):
            any_wanted |= wanted[k, j]
        if not any_wanted:
            continue
        place[3], place[4] = 3 + 2 * j, 4 + 2 * j
        for a in range(5):
            for b in range(5):
                M[a, b] = P[place[a], place[b]]
        start[:] = 0.0
        look(pose, landmarks[j], start, 3, h, H)
        x, y = h[0], h[1]
        p00, p01, p11 = spread(M, H)
        for k in range(len(z)):
            if not wanted[k, j]:
                continue
            u, v = z[k, 0] - x, z[k, 1] - y
            bend = 2.0 * M[2, 2] * (u * u + v * v)
            s00, s11, s01 = p00 + R[k, 0, 0] + bend, p11 + R[k, 1, 1] + bend, p01 + R[k, 0, 1]
            determinant = s00 * s11 - s01 * s01
            if not determinant > 0.0:
                continue
            rough = (s11 * u * u - 2.0 * s01 * u * v + s00 * v * v) / determinant
            if rough > 2.0 * gate:
                continue
            cost = pair_cost(pose, landmarks[j], M, z[k], R[k])
            if 0.0 <= cost <= min(gate, limit):
                out[k, j] = cost
    return out


@njit
def spread(M: Float, H: Float) -> tuple[float, float, float]:
    """Elements 00, 01 and 11 of H M H' with M (5, 5) and H (2, 5)."""
    p00 = p01 = p11 = 0.0
    for a in range(5):
        left, right = 0.0, 0.0
        for b in range(5):
            left += M[a, b] * H[0, b]
            right += M[a, b] * H[1, b]
        p00 += H[0, a] * left
        p01 += H[0, a] * right
        p11 += H[1, a] * right
    return p00, p01, p11


@inner
def pair_cost(pose: Float, landmark: Float, M: Float, z: Float, R: Float) -> float:
    """The cost of ``kernels.linearise`` for one pair, M (5, 5) being pose's and landmark's part.

    Negative where the innovation's covariance is singular.
    """
    xi, h, H = np.zeros(5), np.zeros(2), np.zeros((2, 5))
    cost = -1.0
    for _ in range(ITERATIONS):
        look(pose, landmark, xi, 3, h, H)
        u, v = z[0] - h[0], z[1] - h[1]
        for a in range(5):
            u += H[0, a] * xi[a]
            v += H[1, a] * xi[a]
        p00, p01, p11 = spread(M, H)
        s00, s01, s11 = p00 + R[0, 0], p01 + R[0, 1], p11 + R[1, 1]
        determinant = s00 * s11 - s01 * s01
        if not (s00 > 0.0 and determinant > 0.0):
            return -1.0
        wu, wv = (s11 * u - s01 * v) / determinant, (s00 * v - s01 * u) / determinant
        cost = u * wu + v * wv
        moved = 0.0
        for a in range(5):
            step = 0.0
            for b in range(5):
                step += M[a, b] * (H[0, b] * wu + H[1, b] * wv)
            moved += (step - xi[a]) ** 2
            xi[a] = step
        if moved < SETTLED:
            break
    return cost


PAIRS, NODES = range(2)  # places in ``Search.counts``


class Search(NamedTuple):
    """What stays the same during the search of k points among n landmarks, and what it found.

    points, covariances  (k, 2) m and (k, 2, 2) m^2, the least ambiguous first
    plausible            (k, n) pairs within the gate of the prior
    together             (k + 1,) limit of the joint cost of so many pairs
    added                limit of what one more pair adds
    most_nodes           hypotheses looked into
    chosen, taken        (k,) place of each point's landmark or -1, (n,): the hypothesis looked into
    best, best_cost      (k,), (1,): the best one so far
    counts               (2,) pairs of the best one; hypotheses looked into so far
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
    for i in range(first, wanted.shape[0]):
        for j in range(wanted.shape[1]):
            wanted[i, j] = search.plausible[i, j] and not search.taken[j]
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


def _any(costs: Float) -> Bools:
    """(k,) which points have a finite cost with some landmark."""
    out: Bools = np.asarray(np.isfinite(costs).any(axis=1))
    return out


def _order(costs: Float) -> list[int]:
    """Points that have a candidate, the least ambiguous first."""
    counts = np.isfinite(costs).sum(axis=1)
    return [int(k) for k in np.argsort(counts, kind="stable") if counts[k] > 0]
