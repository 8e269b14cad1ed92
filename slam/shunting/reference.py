# SPDX-License-Identifier: Apache-2.0
"""The paper's map and matching whole, in plain NumPy on one dense array: to be read, not fast.

    reference = Reference()
    for frame in slam.logs.open_log("drive.log"):
        x, y, heading = reference.update(frame)
    pyplot.imshow(reference.activity, origin="lower")

The front end turns beams into Gaussians, and odometry into a prior. "Ours" is not in the paper.
A test holds ``create("shunting", config="paper")`` to this file: docs/paper/method.md."""

import math

import numpy as np

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, Frame, Odometry
from slam.frontend.observations import Observations, observe
from slam.frontend.odometry_prior import Prediction, predict
from slam.shunting.slam import ShuntingConfig

FRONT_END = ShuntingConfig.paper()  # how beams become Gaussians: de-skew, surfaces, view; ours
CELL = 0.03  # m, edge of a neuron's square; ours
ACROSS = 1024  # neurons, edge of the array, in whose middle the drive starts: 30.7 m; ours
A = 0.8  # 1/s, decay of Eq. (8)
SIGMA = 0.01  # activity, threshold of Eq. (8): "a very small positive number"
NEAR = np.array([(j, i) for j in (-1, 0, 1) for i in (-1, 0, 1) if j or i])  # 0 < d < r0 of Eq. (8)
MU = 0.19 / (4.0 + 4.0 / math.sqrt(2.0))  # 1/s, of Eq. (8): A and all w sum to "less than 1"
FIRST_S = 1.0  # s, how long the first scan acts; ours
ENDS = 12.0  # squared Mahalanobis distance at which I of Eq. (8) ends: exp(-12 / 2) = 0.0025; ours
SWEEPS = 8  # passes that come to what one Gauss-Seidel sweep (section 3.4) in this order gives:
ORDER = np.arange(ACROSS**2).reshape(128, 128, 8, 8).swapaxes(1, 2).reshape(ACROSS, ACROSS)  # ours
REWARD = 0.3  # weight of the logarithms of Eq. (13), as beams are not independent; ours
FLOOR = 0.1  # overlap, added before the logarithm: no beam may outweigh all others; ours
TAIL = 3.3  # standard deviations, and at least 3 neurons, at which a beam's Gaussian ends; ours
FEW = 90  # beams at most in the coarse step of the "multiresolution search" (section 3.4); ours
WIDEST = 3.0  # neurons, by which that step blurs a beam at most, as the prior may be off; ours
ENOUGH = 3e-3  # log-likelihood: a Newton step that should gain less is the last; ours
STEPS = 20  # Newton steps at most; ours
Arrays = tuple[Float, ...]  # beams: places (n, 2), covariances (n, 2, 2), weights, tangents (n, 2)


class Reference:
    """The network ``activity``, x of Eq. (8), by rows of y; [512, 512] is right above the start."""

    def __init__(self) -> None:
        self.activity: Float = np.zeros((ACROSS, ACROSS))
        self.T_map_robot: Float = np.zeros(3)
        self._before: Odometry | None = None

    def update(self, frame: Frame) -> Float:
        """The pose (3,) of a frame, whose scan the map then takes in."""
        before, self._before = self._before or frame.odometry, frame.odometry
        prior = predict(self.T_map_robot, before, frame.odometry)  # p(x_t | x_t-1, u_t) of Eq. (12)
        seen = observe(frame, prior.twist, FRONT_END)
        if before is not frame.odometry:
            C = seen.covariances[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
            beams = seen.points_robot, C, seen.shares, seen.tangents
            start = self._climb(beams, prior.T_map_robot, prior, coarse=True)
            self.T_map_robot = self._climb(beams, start, prior, coarse=False)
        self._excite(seen, prior.elapsed or FIRST_S)
        return self.T_map_robot

    def _climb(self, beams: Arrays, pose: Float, prior: Prediction, coarse: bool) -> Float:
        """Newton's method, to the pose at which Eq. (13) is largest."""
        for _ in range(STEPS):
            _, slope, curvature = self.posterior(beams, pose, prior, coarse)
            pose = pose + (step := np.linalg.solve(curvature, slope))
            if slope @ step < ENOUGH:
                break
        return se2.compose(pose, se2.IDENTITY)  # the heading wrapped

    def posterior(self, beams: Arrays, pose: Float, prior: Prediction, coarse: bool) -> Arrays:
        """Eq. (13), its slope (3,) and its negative curvature (3, 3)."""
        R, every = se2.rotation(float(pose[2])), math.ceil(len(beams[0]) / FEW) if coarse else 1
        points, C, weights, tangents = (part[:: every or 1] for part in beams)
        (x, y), one, w = R @ points.T, np.ones(len(points)), REWARD * weights * every
        J = np.array([[one, 0.0 * one, -y], [0.0 * one, one, x]]).transpose(2, 0, 1) / CELL
        C = R @ C @ R.T / CELL**2
        if coarse:
            blur = J @ prior.prior @ J.swapaxes(1, 2)
            C += blur * np.minimum(WIDEST**2 / np.trace(blur, axis1=1, axis2=2), 1.0)[:, None, None]
        P, wide = np.linalg.inv(C), max(3.0, TAIL * math.sqrt(C.max(initial=0.0)))
        (j, i), d = _around(se2.transform(pose, points), wide)
        k = self.activity[j, i] * (1.0 + A)  # Eq. (8) comes to rest at x = 1 / (1 + A) for I = 1
        k *= np.exp(-0.5 * np.einsum("nci,nij,ncj->nc", d, P, d))  # overlapped volumes of Fig. 5
        k *= (abs(d) <= wide).all(axis=2) / (math.pi * np.sqrt(np.linalg.det(C)))[:, None]
        f = FLOOR + k.sum(axis=1)  # p(z_j | x, m) of Eq. (13), 1 where a landmark meets itself
        g = np.einsum("nij,ncj,nc->ni", P, d, k) / f[:, None]
        H = P * (1.0 - FLOOR / f)[:, None, None] + g[:, :, None] * g[:, None, :]
        H -= P @ np.einsum("nc,nci,ncj->nij", k / f[:, None], d, d) @ P
        low, V = np.linalg.eigh(H)  # ours: a beam bends the sum downwards or not at all
        H = (V * np.maximum(low, 0.0)[:, None, :]) @ V.transpose(0, 2, 1)
        t = tangents @ R.T  # ours: along a surface the slope says only where the map is older
        g -= (g * t).sum(axis=1)[:, None] * t
        off = pose - prior.T_map_robot
        off[2], precision = se2.wrap(float(off[2])), np.linalg.inv(prior.prior)
        score = w @ np.log(f) - 0.5 * off @ precision @ off  # Eq. (13)
        slope = np.einsum("n,nia,ni->a", w, J, g) - precision @ off
        return score, slope, np.einsum("n,nia,nij,njb->ab", w, J, H, J) + precision

    def _excite(self, seen: Observations, h: float) -> None:
        """Eq. (8) for h s, implicit in x, where I > 0 or x > 0 is in view; others stay (ours)."""
        x, given = self.activity, self._inputs(seen)
        j, i = np.nonzero((x > 0.0) | (given > 0.0))
        T_laser_map = se2.inverse(se2.compose(self.T_map_robot, seen.T_robot_laser))
        dx, dy = se2.transform(T_laser_map, (np.stack([i, j], axis=1) + (1 - ACROSS) / 2) * CELL).T
        # Section 3.3: hidden is what lies behind an observation; ours: or what no beam passed near
        view, r, n = seen.view, np.hypot(dx, dy), len(seen.view.limit)
        k = np.floor((turns := np.arctan2(dy, dx) / view.step) + 0.5).astype(int)
        aside = np.min([abs(turns - k - m - view.offset[(k + m) % n]) for m in (-1, 0, 1)], axis=0)
        empty = (r < view.limit[k % n] - view.margin) & (aside * view.step * r <= view.gate)
        j, i = j[empty | (given[j, i] > 0.0)], i[empty | (given[j, i] > 0.0)]
        beside, new = (j + NEAR[:, :1], i + NEAR[:, 1:]), x.copy()
        swept, d = ORDER[beside] < ORDER[j, i], np.hypot(NEAR[:, :1], NEAR[:, 1:])
        for _ in range(SWEEPS):
            above = np.maximum(np.where(swept, new[beside], x[beside]) - SIGMA, 0.0)
            E = given[j, i] + (MU / d * above).sum(axis=0)  # ours: [x - sigma]+ without "+ sigma"
            x_new = (x[j, i] + h * E) / (1.0 + h * (A + E))
            new[j, i] = np.where((x_new < SIGMA) & (SIGMA * (A + E) > E), 0.0, x_new)
        self.activity = new

    def _inputs(self, seen: Observations) -> Float:
        """I of Eq. (8): the largest of the Gaussians of hits and of stretches between them."""
        u = se2.transform(self.T_map_robot, seen.points_robot) / CELL - 0.5
        ridges = [(place, np.zeros(2), np.zeros(2)) for place in u]  # place, direction, axis
        for v, w in zip(u[:-1], np.diff(u, axis=0) * seen.joined[:-1, None], strict=True):
            n = int(abs(w[1]) > abs(w[0]))  # ours: where a stretch crosses the lattice, it is drawn
            first, last = sorted((v[n], v[n] + w[n]))
            for t in range(math.ceil(first), math.floor(last) + 1) if w @ w > 1.0 else ():
                ridges.append((v + (t - v[n]) / w[n] * w, w / np.hypot(*w), np.eye(2)[n]))
        at, e, a = np.array(ridges).reshape(-1, 3, 1, 2).transpose(1, 0, 2, 3)
        variance = seen.covariances[:, 0].max(initial=0.0) / CELL**2
        (j, i), d = _around((at[:, 0] + 0.5) * CELL, math.sqrt(2.0 * ENDS * variance))
        m = ((d - e * (d * e).sum(2, keepdims=True)) ** 2).sum(2) / max(variance, 1e-9)
        near = (m < ENDS) & (abs((d * a).sum(2)) < 0.5)
        np.maximum.at(out := np.zeros_like(self.activity), (j[near], i[near]), np.exp(-m[near] / 2))
        return out


def _around(points_map: Float, wide: float) -> tuple[Float, Float]:
    """Rows and columns (2, n, c) of the neurons about each point, their offsets (n, c, 2)."""
    u, side = points_map / CELL - 0.5, np.arange(math.floor(2.0 * wide) + 1)
    near = np.ceil(u - wide)[:, None] + np.stack(np.meshgrid(side, side), axis=2).reshape(-1, 2)
    rows_columns = near.T[::-1].swapaxes(1, 2).astype(int) + ACROSS // 2
    if rows_columns.size and not 0 < rows_columns.min() <= rows_columns.max() < ACROSS - 1:
        raise InvalidValueError(f"Reference holds {ACROSS * CELL:.0f} m about the start, no more")
    return rows_columns, near - u[:, None]
