# SPDX-License-Identifier: Apache-2.0
"""Pose graph in the plane: least squares over relative poses, robust against wrong loops.

Gauss-Newton with SciPy's sparse solver: graphs here are a few thousand poses in a chain with some
loops, which it solves in milliseconds an iteration, and it is a dependency anyway. Loops get the
Geman-McClure kernel with graduated non-convexity (Yang, Antonante, Tzoumas, Carlone 2020): at first
all pull, then those that do not fit the others are let go of.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from slam import se2
from slam.frames import Float

INLIER = 11.3  # chi squared of 3 degrees of freedom, 99 %
ROUNDS = 60
STILL = 1e-5  # m or rad: largest step at which it has converged
SHARPER = 1.4


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


def optimise(poses: Float, edges: list[Edge]) -> tuple[Float, Float]:
    """Poses (n, 3) of least squares, the first held fast, and each edge's weight (len(edges),).

    A weight near 0 is an edge that was let go of.
    """
    poses = np.array(poses, dtype=np.float64)
    if len(poses) < 2 or not edges:
        return poses, np.ones(len(edges))
    a = np.array([e.a for e in edges])
    b = np.array([e.b for e in edges])
    measured = np.array([e.T_a_b for e in edges])
    information = np.array([e.information for e in edges])
    robust = np.array([e.robust for e in edges])
    residuals = _residuals(poses, a, b, measured)[0]
    squares = np.einsum("ni,nij,nj->n", residuals, information, residuals)
    mu = max(2.0 * float(squares[robust].max(initial=0.0)) / INLIER, 1.0)
    for _ in range(ROUNDS):
        residuals, to_a, to_b = _residuals(poses, a, b, measured)
        squares = np.einsum("ni,nij,nj->n", residuals, information, residuals)
        weights = np.where(robust, (mu * INLIER / (squares + mu * INLIER)) ** 2, 1.0)
        step = _step(len(poses), a, b, residuals, to_a, to_b, weights[:, None, None] * information)
        poses[1:] += step.reshape(-1, 3)
        if mu == 1.0 and np.abs(step).max() < STILL:
            break
        mu = max(mu / SHARPER, 1.0)
    poses[:, 2] = se2.wrap_array(poses[:, 2])
    return poses, weights


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


def _step(  # noqa: PLR0913 (arrays of one problem)
    n: int, a: Float, b: Float, residuals: Float, to_a: Float, to_b: Float, information: Float
) -> Float:
    """Gauss-Newton step of poses 1..n-1, flat."""
    jacobian = np.concatenate([to_a, to_b], axis=2)  # (m, 3, 6)
    weighted = np.einsum("nji,njk->nik", jacobian, information)
    blocks = weighted @ jacobian
    gradient = np.einsum("nij,nj->ni", weighted, residuals)
    index = np.concatenate([3 * a[:, None] + np.arange(3), 3 * b[:, None] + np.arange(3)], axis=1)
    rows = np.repeat(index[:, :, None], 6, axis=2)
    columns = np.repeat(index[:, None, :], 6, axis=1)
    shape = (3 * n, 3 * n)
    H = sparse.coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsc()
    g = np.zeros(3 * n)
    np.add.at(g, index.ravel(), gradient.ravel())
    step: Float = spsolve(H[3:, 3:] + 1e-9 * sparse.eye(3 * n - 3, format="csc"), -g[3:])
    return step


def carried(before: Float, after: Float, at: Float, poses: Float) -> Float:
    """(m, 3) ``poses`` moved along with the key poses ``before`` -> ``after`` they lie between.

    ``at`` (m,) is the place of each in the list of key poses, e.g. 3.25: a quarter from the fourth
    to the fifth.
    """
    out = np.empty_like(poses)
    for k, place in enumerate(at.tolist()):
        low = min(int(place), len(before) - 1)
        high = min(low + 1, len(before) - 1)
        by_low = se2.compose(after[low], se2.between(before[low], poses[k]))
        by_high = se2.compose(after[high], se2.between(before[high], poses[k]))
        out[k] = se2.interpolate(by_low, by_high, place - math.floor(place))
    return out
