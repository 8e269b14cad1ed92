# SPDX-License-Identifier: Apache-2.0
"""The paper's map and matching whole, in plain NumPy on one dense array: to be read, not to be fast.

    reference = Reference()
    for frame in slam.logs.open_log("drive.log"):
        x, y, heading = reference.update(frame)
    matplotlib.pyplot.imshow(reference.activity, origin="lower")

Beams as Gaussians, and where the odometry says the robot is, come from ``slam.frontend``. The fast
code is ``create("shunting", config="paper")``; tests/slam/shunting/test_reference.py compares both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, Frame, Odometry
from slam.frontend.config import FRONTEND, FrontendConfig
from slam.frontend.observations import Observations, observe
from slam.frontend.odometry_prior import Prediction, inverted, predict, turned

ACROSS = 1024  # cells, edge of the array, which is centred on the start; a multiple of BLOCK
A = 0.8  # 1/s, decay of Eq. (8); the paper's
SIGMA = 0.01  # activity, threshold of Eq. (8): "a very small positive number"; ours
MU = 0.19 / (4.0 + 4.0 / math.sqrt(2.0))  # 1/s, w = mu / d; A and all w sum to 0.99: "less than 1"
FIRST_S = 1.0  # s, how long the first scan acts: the map is usable at once; ours
LONGEST_S = 3.0  # s, the longest that any scan acts; ours
BELL_ENDS = 12.0  # squared Mahalanobis distance at which I ends: exp(-12 / 2) = 0.0025; ours
SWEEPS = 8  # passes that make one Gauss-Seidel sweep: each changes a thirtieth of the one before
BLOCK = 8  # cells, the fast map is swept in blocks of 8 x 8; another order differs by 0.01
SATURATION = 1.0 / (1.0 + A)  # activity, x of Eq. (8) at rest for I = 1: there overlap counts 1
REWARD = 0.3  # weight of a beam in Eq. (13): beams are not independent, as Eq. (13) has them; ours
FLOOR = 0.1  # overlap, added before the logarithm of Eq. (13): nothing matched is not -inf; ours
TAIL = 3.3  # standard deviations, at least 3 cells, at which an observation's Gaussian ends; ours
FEW = 90  # beams, at most, that approach the optimum; ours
BLUR_CELLS = (0.5, 3.0)  # cells, least and widest blur while approaching; ours
ENOUGH = 3e-3  # log-likelihood: a Newton step expected to raise it by less is the last; ours
STEPS = 20  # Newton steps, at most; ours
NEAR = np.array([(j, i) for j in (-1, 0, 1) for i in (-1, 0, 1) if j or i])  # 0 < d < r0 = 1.5
WEIGHTS = MU / np.hypot(NEAR[:, 0], NEAR[:, 1])[:, None]  # w_ij of Eq. (8)


class Grain(NamedTuple):
    """What the front end has to know: edge of a cell, m; farthest return, m; its own numbers."""

    cell_m: float = 0.03
    range_m: float = 40.0
    frontend: FrontendConfig = FRONTEND


GRAIN = Grain()


class Reference:
    """The robot's pose and the map, frame by frame; the first frame is the origin of the map.

    activity  (1024, 1024) x of Eq. (8); [j, i] is the square of 3 cm about x = (i - 511.5) 0.03 m
              and y = (j - 511.5) 0.03 m
    """

    def __init__(self) -> None:
        self.activity: Float = np.zeros((ACROSS, ACROSS))
        self._before: Odometry | None = None
        self._T_map_robot: Float = np.zeros(3)

    def update(self, frame: Frame) -> Float:
        """The pose (3,) of a frame, which the map then takes in; frames must come in order."""
        if self._before is None:
            twist = np.zeros(3) if frame.odometry.twist is None else frame.odometry.twist
            seen, step = observe(frame, twist, GRAIN), FIRST_S
        else:
            prediction = self._predict(self._before, frame.odometry)
            seen, step = observe(frame, prediction.twist, GRAIN), prediction.elapsed
            start = self._approach(seen, prediction)
            self._T_map_robot = self._climb(_gaussians(seen), start, prediction)
        self._before = frame.odometry
        self._excite(seen, min(step, LONGEST_S))
        return self._T_map_robot

    def _predict(self, before: Odometry, now: Odometry) -> Prediction:
        """p(x_t | x_{t-1}, u_t) of Eq. (12): odometry, 2.25 times the variance that it states."""
        return predict(self._T_map_robot, before, now)

    def _approach(self, seen, prediction):
        """Where to climb from: the optimum for a few beams, blurred by what the prior is off."""
        points, covariances, weights, tangents = _gaussians(seen)
        every = max(1, math.ceil(len(points) / FEW))
        points, covariances = points[::every], covariances[::every]
        J = _jacobian(points)
        prior = turned(prediction.prior, -float(prediction.T_map_robot[2]))
        blur = J @ prior @ J.transpose(0, 2, 1)
        size = np.trace(blur, axis1=1, axis2=2) / GRAIN.cell_m**2
        if not len(points) or size.max() <= BLUR_CELLS[0] ** 2:
            return prediction.T_map_robot
        blur *= np.minimum(1.0, BLUR_CELLS[1] ** 2 / np.maximum(size, 1e-12))[:, None, None]
        few = points, covariances + blur, weights[::every] * every, tangents[::every]
        return self._climb(few, prediction.T_map_robot, prediction)

    def _climb(self, beams, start, prediction):
        """Eq. (13): where log p(z | x, m) + log p(x | x_{t-1}, u) is largest, by Newton's method."""
        pose, precision, damping = start, inverted(prediction.prior), 1e-3

        def prior(at: Float) -> tuple[float, Float]:  # -1/2 squared Mahalanobis distance, slope
            off = at - prediction.T_map_robot
            off[2] = se2.wrap(float(off[2]))
            return float(-0.5 * off @ precision @ off), -precision @ off

        score, slope, along, H = self._reward(*beams, pose)
        for _ in range(STEPS):
            g, M = slope - along + prior(pose)[1], H + precision
            step = np.linalg.solve(M + damping * np.diag(np.diag(M)), g)
            if step @ g < ENOUGH:
                pose = pose + step
                break
            trial = self._reward(*beams, pose + step)
            if trial[0] - score - along @ step + prior(pose + step)[0] > prior(pose)[0]:
                pose, (score, slope, along, H) = pose + step, trial
                damping = max(0.2 * damping, 1e-6)
            else:
                damping = max(10.0 * damping, 0.1)
        return np.array([pose[0], pose[1], se2.wrap(float(pose[2]))])

    def _reward(self, points, covariances, weights, tangents, pose):
        """Sum of log p(z_j | x, m) of Eq. (13), its slope, what of it is along surfaces, and its
        curvature."""
        R = se2.rotation(float(pose[2]))
        C = R @ covariances @ R.T / GRAIN.cell_m**2
        u = _cells(se2.transform(pose, points))
        wide = max(3.0, TAIL * math.sqrt(np.diagonal(C, axis1=1, axis2=2).max(initial=0.0)))
        ij = np.ceil(u - wide)[:, None, :] + _square(math.floor(2.0 * wide) + 1)
        d = ij - u[:, None, :]
        P = np.linalg.inv(C)
        k = np.exp(-0.5 * np.einsum("nci,nij,ncj->nc", d, P, d)) * (np.abs(d) <= wide).all(axis=2)
        k *= self.activity[tuple(_inside(ij).T)].T / SATURATION
        k /= math.pi * np.sqrt(np.linalg.det(C))[:, None]
        f = k.sum(axis=1)
        g = np.einsum("nij,ncj,nc->ni", P, d, k)
        H = P * f[:, None, None] - P @ np.einsum("nc,nci,ncj->nij", k, d, d) @ P
        share = (1.0 / (FLOOR + f))[:, None]
        g = g * share / GRAIN.cell_m
        H = H * share[:, :, None] / GRAIN.cell_m**2 + g[:, :, None] * g[:, None, :]
        low, V = np.linalg.eigh(H)
        H = (V * np.maximum(low, 0.0)[:, None, :]) @ V.transpose(0, 2, 1)
        J, w = _jacobian(points @ R.T), REWARD * weights
        t = tangents @ R.T
        slip = (g * t).sum(axis=1)[:, None] * t
        return (
            w @ np.log(FLOOR + f),
            np.einsum("n,nia,ni->a", w, J, g),
            np.einsum("n,nia,ni->a", w, J, slip),
            np.einsum("n,nia,nij,njb->ab", w, J, H, J),
        )

    def _excite(self, seen, step):
        x, I = self.activity, _impression(seen, self._T_map_robot)
        j, i = np.nonzero((x > 0.0) | (I > 0.0))
        T = se2.compose(self._T_map_robot, seen.T_robot_laser)
        centres = (np.stack([i, j], axis=1) - (ACROSS - 1) / 2) * GRAIN.cell_m
        at_laser = se2.transform(se2.inverse(T), centres)
        act = (I[j, i] > 0.0) | _seen_empty(seen.view, *at_laser.T)
        j, i = j[act], i[act]
        beside = j + NEAR[:, :1], i + NEAR[:, 1:]
        first = _rank(*beside) < _rank(j, i)
        new = x.copy()
        for _ in range(SWEEPS):
            near = np.where(first, new[beside], x[beside])
            E = I[j, i] + (WEIGHTS * np.maximum(near - SIGMA, 0.0)).sum(axis=0)
            value = (x[j, i] + step * E) / (1.0 + step * (A + E))
            value[(value < SIGMA) & (SIGMA * (A + E) > E)] = 0.0
            new[j, i] = value
        self.activity = new


def _gaussians(seen):
    C = seen.covariances[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
    return seen.points_robot, C, seen.weights, seen.tangents


def _cells(points):
    return points / GRAIN.cell_m + (ACROSS - 1) / 2


def _jacobian(points):
    J = np.zeros((len(points), 2, 3))
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    J[:, 0, 2], J[:, 1, 2] = -points[:, 1], points[:, 0]
    return J


def _square(n):
    return np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=2).reshape(-1, 2)


def _inside(ij):
    out = ij.astype(int)[..., ::-1]
    if out.size and (out.min() < 1 or out.max() > ACROSS - 2):
        raise InvalidValueError("left the array")
    return out


def _impression(seen, pose):
    I = np.zeros((ACROSS, ACROSS))
    u = _cells(se2.transform(pose, seen.points_robot))
    s2 = seen.covariances[0, 0] / GRAIN.cell_m**2 if len(u) else 1.0
    wide = math.sqrt(BELL_ENDS * s2)

    def stamp(ij, m):
        ij, m = ij[m < BELL_ENDS], m[m < BELL_ENDS]
        j, i = _inside(ij).T
        np.maximum.at(I, (j, i), np.exp(-0.5 * m))

    ij = np.ceil(u - wide)[:, None, :] + _square(math.floor(2 * wide) + 1)
    stamp(ij, ((ij - u[:, None, :]) ** 2).sum(axis=2) / s2)
    for k in np.flatnonzero(seen.joined[:-1]):
        a, e = u[k], u[k + 1] - u[k]
        if e @ e <= 1.0:
            continue
        m = 0 if abs(e[0]) >= abs(e[1]) else 1  # major axis
        lo, hi = sorted((a[m], a[m] + e[m]))
        along = np.arange(math.ceil(lo), math.floor(hi) + 1)
        across = math.sqrt(BELL_ENDS * s2 * (1 + (e[1 - m] / e[m]) ** 2))
        centre = a[1 - m] + e[1 - m] / e[m] * (along - a[m])
        aside = np.ceil(centre - across)[:, None] + np.arange(math.floor(2 * across) + 1)
        ij = np.empty((*aside.shape, 2))
        ij[..., m], ij[..., 1 - m] = along[:, None], aside
        d = ij - a
        stamp(ij, (d[..., 0] * e[1] - d[..., 1] * e[0]) ** 2 / (e @ e * s2))
    return I


def _seen_empty(view, dx, dy):
    r, turns = np.hypot(dx, dy), np.arctan2(dy, dx) / view.step
    k = np.floor(turns + 0.5).astype(int)
    off, k = turns - k, k % len(view.limit)
    beside = [np.abs(off - m - view.offset[(k + m) % len(view.limit)]) for m in (-1, 0, 1)]
    gate = np.min(beside, axis=0) * view.step * r <= view.gate
    return (r < view.limit[k] - view.margin) & gate


def _rank(j, i):
    return ((j // BLOCK * ACROSS + i // BLOCK) * BLOCK + j % BLOCK) * BLOCK + i % BLOCK
