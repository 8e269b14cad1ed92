# SPDX-License-Identifier: Apache-2.0
"""Pose graph in the plane: least squares over relative poses, robust against wrong loops.

Gauss-Newton with SciPy's sparse solver: graphs here are a few thousand poses in a chain with some
loops, which it solves in milliseconds an iteration, and it is a dependency anyway. Loops get the
Geman-McClure kernel with graduated non-convexity (Yang, Antonante, Tzoumas, Carlone 2020): at first
all pull, then those that do not fit the others are let go of.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from slam import se2
from slam.frames import Float
from slam.frontend.odometry_prior import upper_inverted

INLIER = 11.3  # chi squared of 3 degrees of freedom, 99 %
ROUNDS = 60
STILL = 1e-5  # m or rad: largest step at which it has converged
SHARPER = 1.4
_SYMMETRIC: Any = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
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
        self._a = np.array([e.a for e in edges])
        self._b = np.array([e.b for e in edges])
        self._measured = np.array([e.T_a_b for e in edges])
        self._information = np.array([e.information for e in edges])
        self._robust = np.array([e.robust for e in edges])
        self._rounds = 0
        self._normal = _Normal(len(self.poses), self._a, self._b)
        squares = self._squares(self._residuals()[0])
        self._mu = max(2.0 * float(squares[self._robust].max(initial=0.0)) / INLIER, 1.0)

    def _residuals(self) -> tuple[Float, Float, Float]:
        return _residuals(self.poses, self._a, self._b, self._measured)

    def _squares(self, residuals: Float) -> Float:
        return np.asarray(np.einsum("ni,nij,nj->n", residuals, self._information, residuals))

    def round(self) -> None:
        """One step of Gauss-Newton; the loops that do not fit lose weight."""
        residuals, to_a, to_b = self._residuals()
        scale = self._mu * INLIER
        weights = (scale / (self._squares(residuals) + scale)) ** 2
        self.weights = np.where(self._robust, weights, 1.0)
        information = self.weights[:, None, None] * self._information
        step = self._normal.step(residuals, np.concatenate([to_a, to_b], axis=2), information)
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


def _residuals(poses: Float, a: Float, b: Float, measured: Float) -> tuple[Float, Float, Float]:
    """(m, 3) between(a, b) minus measured, and its Jacobians (m, 3, 3) by poses a and b."""
    A, d = poses[a], poses[b] - poses[a]
    c, s = np.cos(A[:, 2]), np.sin(A[:, 2])
    x, y = c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0]
    out = np.stack([x, y, d[:, 2]], axis=1) - measured
    out[:, 2] = se2.wrap_array(out[:, 2])
    by_a, by_b = np.zeros((len(A), 3, 3)), np.zeros((len(A), 3, 3))
    by_b[:, 0, 0], by_b[:, 0, 1], by_b[:, 1, 0], by_b[:, 1, 1], by_b[:, 2, 2] = c, s, -s, c, 1.0
    by_a[:] = -by_b
    by_a[:, 0, 2], by_a[:, 1, 2] = y, -x
    return out, by_a, by_b


class _Normal:
    """The normal equations of poses 1..n-1: where their numbers lie is worked out once.

    Poses are eliminated by least degree, which leaves the factor of a map's graph sparse.
    """

    def __init__(self, n: int, a: NDArray[np.int64], b: NDArray[np.int64]) -> None:
        ends = np.stack([a, b], axis=1)
        rows, columns = np.repeat(ends, 2, axis=1).ravel(), np.tile(ends, 2).ravel()
        ones = sparse.csc_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n))
        ones = ones[1:, 1:] + len(rows) * sparse.eye(n - 1, format="csc")
        place = np.full(n, -1)  # in the order of elimination; the first pose is held fast
        place[1:] = splu(ones, permc_spec="MMD_AT_PLUS_A", **_SYMMETRIC).perm_c
        self._place = place
        self._pulled = (3 * ends[:, :, None] + np.arange(3)).ravel()
        rows, columns = place[rows], place[columns]
        self._free = (rows >= 0) & (columns >= 0)
        numbers = np.append(columns[self._free] * n + rows[self._free], (n + 1) * np.arange(n - 1))
        blocks, slots = np.unique(numbers, return_inverse=True)
        columns, rows = np.divmod(blocks, n)
        first = np.searchsorted(columns, np.arange(n))  # block of each column of blocks
        high = np.diff(first)
        # a column of blocks is three of numbers, each three times as high
        i = np.arange(3)
        at = 9 * first[columns] + 3 * (np.arange(len(blocks)) - first[columns])
        at = at[:, None, None] + i[:, None] + 3 * i * high[columns, None, None]
        self._at = at[slots[: 1 - n]].ravel()
        self._indices = np.empty(9 * len(blocks), np.int32)
        self._indices[at] = 3 * rows[:, None, None] + i[:, None]
        starts = 9 * first[:-1, None] + 3 * i * high[:, None]
        self._starts = np.append(starts.ravel(), len(self._indices)).astype(np.int32)
        self._diagonal = at[rows == columns][:, i, i].ravel()

    def step(self, residuals: Float, jacobian: Float, information: Float) -> Float:
        """(n, 3) step of Gauss-Newton; ``jacobian`` (m, 3, 6) by both ends of each edge."""
        m = len(residuals)
        weighted = jacobian.transpose(0, 2, 1) @ information
        blocks = (weighted @ jacobian).reshape(m, 2, 3, 2, 3).transpose(0, 1, 3, 2, 4)
        values = np.bincount(self._at, blocks.reshape(4 * m, 9)[self._free].ravel())
        values[self._diagonal] += 1e-9
        H = sparse.csc_matrix((values, self._indices, self._starts))
        pull = np.bincount(self._pulled, (weighted @ residuals[:, :, None]).ravel())
        moves = np.zeros((len(self._place), 3))
        moves[self._place] = -pull.reshape(-1, 3)
        moved = splu(H, permc_spec="NATURAL", **_SYMMETRIC).solve(moves[:-1].ravel())
        step: Float = np.append(moved, np.zeros(3)).reshape(-1, 3)[self._place]
        return step


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
