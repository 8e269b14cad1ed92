# SPDX-License-Identifier: Apache-2.0
"""How far an estimated trajectory is from the true one; every figure says its unit and alignment.

Errors are estimate minus truth in the map frame, which is the robot's frame at the first update:
alignment "none" expresses the truth in the frame of that known first pose and moves nothing else;
"se2" then also moves the whole estimate rigidly onto the truth (closed form least squares), which
is fair only to references without a common origin. Inputs are never changed.
"""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slam import se2
from slam.checked import frozen
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Float
from slam.shaped import one_of
from slam.trajectory import Trajectory

Alignment = Literal["none", "se2"]
Per = Literal["m", "s"]


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One figure: ``value`` in ``unit`` over ``n`` samples; ``alignment`` is "" where it cannot
    matter."""

    name: str
    value: float
    unit: str
    alignment: str
    n: int

    def __str__(self) -> str:
        how = f", {self.alignment} alignment" if self.alignment else ""
        return f"{self.name} {self.value:.4g} {self.unit} ({self.n} samples{how})"


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseErrors:
    """``errors`` (n, 3) m, m, rad: estimate minus truth at ``stamps_ns``, heading wrapped.

    estimate, truth  the compared poses (n, 3) in the map frame, after the alignment
    """

    stamps_ns: NDArray[np.int64]
    errors: Float
    estimate: Float
    truth: Float
    alignment: Alignment

    @property
    def distances(self) -> Float:
        """(n,) m between estimated and true position."""
        squared = self.errors[:, :2] ** 2
        return np.sqrt(squared[:, 0] + squared[:, 1])


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorStatistics:
    """The paper's table: ``mean``, ``var_e`` and ``var_p``, each (3,) for x, y, theta.

    mean   mean of e, in ``units`` (m, m, rad)
    var_e  sum (e - mean)^2 / (n - 1), units squared
    var_p  sum e^2 / (n - 1) = var_e + n / (n - 1) mean^2, units squared: the paper's definition;
           its printed var(p) do not follow from it
    """

    mean: Float
    var_e: Float
    var_p: Float
    n: int
    alignment: Alignment
    units: tuple[str, str, str] = ("m", "m", "rad")


@dataclass(frozen=True, kw_only=True, eq=False)
class Nees:
    """Normalised estimation error squared e' P^-1 e of (x, y, theta); 3 on average when P is right.

    values  (n,), NaN where P is singular (the first pose is known exactly)
    mean    over the ``n_used`` other frames, NaN when there are none
    """

    values: Float
    mean: float
    n_used: int
    alignment: Alignment = "none"


def associate(estimate: Trajectory, truth: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Both trajectories at their common stamps (exactly equal, ns).

    Raises ``InvalidValueError`` when there is none.
    """
    stamps, of_estimate, of_truth = np.intersect1d(
        estimate.stamps_ns, truth.stamps_ns, assume_unique=True, return_indices=True
    )
    if len(stamps) == 0:
        raise InvalidValueError(
            f"estimate ({len(estimate)} poses) and truth ({len(truth)} poses) have no common stamp"
        )
    return (
        Trajectory(stamps_ns=stamps, poses=estimate.poses[of_estimate]),
        Trajectory(stamps_ns=stamps, poses=truth.poses[of_truth]),
    )


def pose_errors(
    estimate: Trajectory, truth: Trajectory, *, align: Alignment = "none"
) -> PoseErrors:
    """Errors of ``estimate`` (map frame) against ``truth`` (any frame) at their common stamps.

    Where the truth begins later than the estimate, the two are tied at their first common stamp, so
    the error up to there is not counted. Raises ``InvalidValueError`` for an unknown alignment and
    when there is no common stamp.
    """
    one_of("align", align, get_args(Alignment))
    first_ns = int(estimate.stamps_ns[0]) if len(estimate) else None
    estimate, truth = associate(estimate, truth)
    T_map_world = se2.inverse(truth.poses[0])
    if truth.stamps_ns[0] != first_ns:
        T_map_world = se2.compose(estimate.poses[0], T_map_world)
    truth_map = _moved(T_map_world, truth.poses)
    estimate_map = estimate.poses
    if align == "se2":
        estimate_map = _moved(se2.fit(estimate_map[:, :2], truth_map[:, :2]), estimate_map)
    errors = estimate_map - truth_map
    errors[:, 2] = se2.wrap_array(errors[:, 2])
    return PoseErrors(
        stamps_ns=truth.stamps_ns,
        errors=frozen("PoseErrors", "errors", errors, (None, 3)),
        estimate=frozen("PoseErrors", "estimate", estimate_map, (None, 3)),
        truth=frozen("PoseErrors", "truth", truth_map, (None, 3)),
        alignment=align,
    )


def ate(estimate: Trajectory, truth: Trajectory, *, align: Alignment = "none") -> Metric:
    """Absolute trajectory error: root mean square distance of the positions, m."""
    errors = pose_errors(estimate, truth, align=align)
    return _rmse("ATE", errors.distances, "m", align)


def heading_rmse(estimate: Trajectory, truth: Trajectory, *, align: Alignment = "none") -> Metric:
    """Root mean square heading error, rad, wrapped; "se2" aligns by the positions only."""
    errors = pose_errors(estimate, truth, align=align)
    return _rmse("heading RMSE", errors.errors[:, 2], "rad", align)


def error_statistics(
    estimate: Trajectory, truth: Trajectory, *, align: Alignment = "none"
) -> ErrorStatistics:
    """The paper's mean(e), var(e) and var(p) per coordinate (needs two poses or more)."""
    e = pose_errors(estimate, truth, align=align).errors
    n = len(e)
    if n < 2:
        raise InvalidValueError(f"error statistics need at least 2 poses, got {n}")
    mean = e.mean(axis=0)
    return ErrorStatistics(
        mean=mean,
        var_e=((e - mean) ** 2).sum(axis=0) / (n - 1),
        var_p=(e**2).sum(axis=0) / (n - 1),
        n=n,
        alignment=align,
    )


def rpe(
    estimate: Trajectory, truth: Trajectory, *, per: Per, delta: float = 1.0
) -> tuple[Metric, Metric]:
    """Relative pose error over ``delta`` true metres or seconds: (translation, rotation).

    From each pose to the first one at least ``delta`` further: the motion between them, estimated
    against true, as root mean square; divided by the way (time) really between them, so that sparse
    logs give a rate too (m/m and rad/m, or m/s and rad/s). No alignment can change it.
    Raises ``InvalidValueError`` when the trajectory is shorter than ``delta``.
    """
    if per not in get_args(Per) or not 0.0 < delta < math.inf:
        raise InvalidValueError(f"rpe needs per 'm' or 's' and delta > 0, got {per!r} and {delta}")
    estimate, truth = associate(estimate, truth)
    if per == "s":
        along = (truth.stamps_ns - truth.stamps_ns[0]) / NS_PER_S
    else:
        steps = np.diff(truth.poses[:, :2], axis=0)
        along = np.concatenate([[0.0], np.cumsum(np.sqrt((steps * steps).sum(axis=1)))])
    end = np.searchsorted(along, along + delta * (1.0 - 1e-9))
    start = np.flatnonzero(end < len(along))
    if len(start) == 0:
        raise InvalidValueError(f"the true trajectory is shorter than {delta} {per}")
    end = end[start]
    motion_true = _between(truth.poses[start], truth.poses[end])
    motion_estimated = _between(estimate.poses[start], estimate.poses[end])
    e = _between(motion_true, motion_estimated) / (along[end] - along[start])[:, None]
    name = f"RPE over {delta:g} {per}"
    translation = np.sqrt(e[:, 0] ** 2 + e[:, 1] ** 2)
    return _rmse(name, translation, f"m/{per}", ""), _rmse(name, e[:, 2], f"rad/{per}", "")


def nees(estimate: Trajectory, covariances: ArrayLike, truth: Trajectory) -> Nees:
    """NEES of each common frame; ``covariances`` (len(estimate), 3, 3) in the map frame."""
    P = frozen("nees", "covariances", covariances, (len(estimate), 3, 3))
    errors = pose_errors(estimate, truth)
    P = P[np.isin(estimate.stamps_ns, errors.stamps_ns)]
    values = np.full(len(P), np.nan)
    for k, (e, covariance) in enumerate(zip(errors.errors, P, strict=True)):
        try:
            whitened = np.linalg.solve(np.linalg.cholesky(covariance), e)
        except np.linalg.LinAlgError:  # not positive definite: says nothing about this frame
            continue
        values[k] = whitened @ whitened
    used = values[np.isfinite(values)]
    mean = float(used.mean()) if len(used) else math.nan
    return Nees(values=values, mean=mean, n_used=len(used))


def _rmse(name: str, e: Float, unit: str, alignment: str) -> Metric:
    value = math.sqrt(float((e * e).mean()))
    return Metric(name=name, value=value, unit=unit, alignment=alignment, n=len(e))


def _moved(T_a_b: Float, poses_b: Float) -> Float:
    """(n, 3) poses of frame b, in frame a."""
    out = np.empty_like(poses_b)
    out[:, :2] = se2.transform(T_a_b, poses_b[:, :2])
    out[:, 2] = se2.wrap_array(poses_b[:, 2] + T_a_b[2])
    return out


def _between(poses_b: Float, poses_c: Float) -> Float:
    """(n, 3) row by row ``se2.between``."""
    d = poses_c - poses_b
    c, s = np.cos(poses_b[:, 2]), np.sin(poses_b[:, 2])
    x, y = c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1]
    return np.stack([x, y, se2.wrap_array(d[:, 2])], axis=1)
