# SPDX-License-Identifier: Apache-2.0
"""Pose graph in the plane: least squares over relative poses, robust against wrong loops.

Gauss-Newton: graphs here are some hundred poses in a chain with some loops, an iteration of which
takes a fraction of a millisecond. Loops get the Geman-McClure kernel with graduated non-convexity
(Yang, Antonante, Tzoumas, Carlone 2020): at first all pull, then those that do not fit the others
are let go of.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from slam import se2
from slam._jit import inner, njit
from slam.arrays import Float, Ints
from slam.block_cholesky import Pattern, solve
from slam.frontend.odometry_prior import upper_inverted

INLIER = 11.3  # chi squared of 3 degrees of freedom, 99 %
ROUNDS = 60
STILL = 1e-5  # m or rad: largest step at which it has converged
SHARPER = 1.4
Pose: TypeAlias = tuple[float, float, float]
DIGITS = 6  # of m and rad that a solution has: those beyond follow the processor's algebra


@dataclass(frozen=True, kw_only=True, eq=False)
class Edge:
    """``T_a_b`` (3,) measured between poses a and b, ``information`` (3, 3) in frame a.

    robust  a loop, which may be wrong; the chain itself is not
    """

    a: int
    b: int
    T_a_b: Float
    information: Float
    robust: bool = False

    @cached_property
    def numbers(self) -> tuple[Pose, tuple[float, float, float, float, float, float]]:
        """``T_a_b``, and row by row the upper part of its covariance, in plain numbers."""
        (a, b, c), (_, d, e), (_, _, f) = self.information.tolist()
        x, y, turn = self.T_a_b.tolist()
        return (x, y, turn), upper_inverted(a, b, c, d, e, f)


class Relaxation:
    """Least squares of poses (n, 3), the first held fast, one round at a time.

    poses    (n, 3) after the rounds so far
    weights  (len(edges),); near 0: an edge that was let go of
    done     nothing moves any more, or ``ROUNDS`` are over
    """

    def __init__(self, poses: Float, edges: list[Edge]) -> None:
        self.poses = np.array(poses, dtype=np.float64)
        self.weights = np.ones(len(edges))
        self.done = len(self.poses) < 2 or not edges
        if self.done:
            return
        self._ends = np.array([(e.a, e.b) for e in edges])
        self._measured = np.array([e.T_a_b for e in edges])
        self._information = np.array([e.information for e in edges])
        self._robust = np.array([e.robust for e in edges])
        self._rounds = 0
        self._pattern = Pattern(len(self.poses), self._ends)
        self._squares = np.empty(len(edges))
        weigh(self.poses, self._ends, self._measured, self._information, self._squares)
        most = float(self._squares[self._robust].max(initial=0.0))
        self._mu = max(2.0 * most / INLIER, 1.0)

    def round(self) -> None:
        """One step of Gauss-Newton; the loops that do not fit lose weight."""
        weigh(self.poses, self._ends, self._measured, self._information, self._squares)
        scale = self._mu * INLIER
        self.weights = np.where(self._robust, (scale / (self._squares + scale)) ** 2, 1.0)
        of, blocks = self._pattern, np.zeros((len(self._pattern.rows), 3, 3))
        pull = np.zeros((len(self.poses), 3))
        lay_out(
            self.poses, self._ends, self._measured, self._information, self.weights,
            (of.place, of.starts, of.blocks), blocks, pull,
        )  # fmt: skip
        solve(of.starts, of.rows, blocks, pull[:-1])
        step = np.where(of.place[:, None] < 0, 0.0, pull[of.place])
        self.poses += step
        self._rounds += 1
        still = self._mu == 1.0 and float(np.abs(step).max()) < STILL
        self.done = still or self._rounds == ROUNDS
        self._mu = max(self._mu / SHARPER, 1.0)
        if self.done:
            self.poses[:, 2] = se2.wrap_array(self.poses[:, 2])
            self.poses = np.round(self.poses, DIGITS)


def optimise(poses: Float, edges: list[Edge]) -> tuple[Float, Float]:
    """Poses (n, 3) of least squares, the first held fast, and each edge's weight (len(edges),).

    A weight near 0 is an edge that was let go of.
    """
    relaxation = Relaxation(poses, edges)
    while not relaxation.done:
        relaxation.round()
    return relaxation.poses, relaxation.weights


@inner
def _residual(A: Float, B: Float, T_a_b: Float, out: Float) -> tuple[float, float]:
    """(3,) between(A, B) minus measured; cosine and sine of A's heading."""
    c, s = math.cos(A[2]), math.sin(A[2])
    dx, dy, turn = B[0] - A[0], B[1] - A[1], B[2] - A[2] - T_a_b[2]
    out[0] = c * dx + s * dy - T_a_b[0]
    out[1] = c * dy - s * dx - T_a_b[1]
    out[2] = turn - math.tau * math.floor(turn / math.tau + 0.5)
    return c, s


@njit
def weigh(poses: Float, ends: Ints, measured: Float, information: Float, squares: Float) -> None:
    """``squares`` (m,): chi squared of the residual of each edge."""
    r = np.empty(3)
    for m in range(len(ends)):
        _residual(poses[ends[m, 0]], poses[ends[m, 1]], measured[m], r)
        total = 0.0
        for i in range(3):
            for j in range(3):
                total += r[i] * information[m, i, j] * r[j]
        squares[m] = total


@njit
def lay_out(  # noqa: C901, PLR0913 (kernel)
    poses: Float,
    ends: Ints,
    measured: Float,
    information: Float,
    weights: Float,
    pattern: tuple[Ints, Ints, Ints],
    blocks: Float,
    pull: Float,
) -> None:
    """Normal equations of all edges, in the order of elimination: ``blocks`` (k, 3, 3) of the lower
    triangle, ``pull`` (n, 3) the right side; both are 0 before.
    """
    place, starts, own = pattern
    r, J, W = np.empty(3), np.zeros((2, 3, 3)), np.empty((3, 3))  # J by pose a, by pose b
    for m in range(len(ends)):
        c, s = _residual(poses[ends[m, 0]], poses[ends[m, 1]], measured[m], r)
        J[1, 0, 0], J[1, 0, 1], J[1, 1, 0], J[1, 1, 1], J[1, 2, 2] = c, s, -s, c, 1.0
        J[0, 0, 0], J[0, 0, 1], J[0, 1, 0], J[0, 1, 1], J[0, 2, 2] = -c, -s, s, -c, -1.0
        J[0, 0, 2], J[0, 1, 2] = r[1] + measured[m, 1], -(r[0] + measured[m, 0])
        for k in range(2):
            at = place[ends[m, k]]
            if at < 0:
                continue
            for i in range(3):
                for j in range(3):
                    total = 0.0
                    for q in range(3):
                        total += J[k, q, i] * information[m, q, j]
                    W[i, j] = weights[m] * total
                for q in range(3):
                    pull[at, i] -= W[i, q] * r[q]
            for other in range(2):
                to = place[ends[m, other]]
                if to < 0 or to > at:
                    continue  # the upper triangle
                block = blocks[starts[at] if to == at else own[m]]
                for i in range(3):
                    for j in range(3):
                        for q in range(3):
                            block[i, j] += W[i, q] * J[other, q, j]


def carried(before: Float, after: Float, at: Float, poses: Float) -> Float:
    """(m, 3) ``poses`` moved along with the key poses ``before`` -> ``after`` they lie between.

    ``at`` (m,) is the place of each in the list of key poses, e.g. 3.25: a quarter from the fourth
    to the fifth.
    """
    low = np.minimum(at.astype(np.int64), len(before) - 1)
    high = np.minimum(low + 1, len(before) - 1)
    by_low = _composed(after[low], relative(before[low], poses))
    by_high = _composed(after[high], relative(before[high], poses))
    apart = by_high - by_low  # millimetres: straight from one to the other
    apart[:, 2] = se2.wrap_array(apart[:, 2])
    out = by_low + (at - np.floor(at))[:, None] * apart
    out[:, 2] = se2.wrap_array(out[:, 2])
    return out


def least_moved(poses: Float, before: Float) -> Float:
    """(n, 3) poses, moved as a whole so that their positions are nearest to those ``before``.

    A graph says nothing of where it lies as a whole. Geodesy calls this choice the datum of a free
    network.
    """
    T = se2.fit(poses[:, :2], before[:, :2])
    return np.array([se2.compose(T, pose) for pose in poses])


def _turns(poses: Float) -> tuple[Float, Float]:
    """Cosines and sines (n,) of headings, with libm: see ``slam.se2``."""
    headings = poses[:, 2].tolist()
    return np.array([math.cos(t) for t in headings]), np.array([math.sin(t) for t in headings])


def _composed(first: Float, then: Float) -> Float:
    """(n, 3) row by row ``se2.compose``; headings not wrapped."""
    c, s = _turns(first)
    x = first[:, 0] + c * then[:, 0] - s * then[:, 1]
    y = first[:, 1] + s * then[:, 0] + c * then[:, 1]
    return np.stack([x, y, first[:, 2] + then[:, 2]], axis=1)


def relative(first: Float, then: Float) -> Float:
    """(n, 3) row by row ``se2.between``; headings not wrapped."""
    d = then - first
    c, s = _turns(first)
    return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]], axis=1)
