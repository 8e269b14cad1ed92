# SPDX-License-Identifier: Apache-2.0
"""The columns of ``runs.csv``, how each is computed from a track, and which way is better."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slam.errors import InvalidValueError, SlamFailedError
from slam.evaluation import lost, metrics
from slam.frames import NS_PER_S
from slam.replay import Track
from slam.trajectory import Trajectory

SETTLED_S = 5.0  # NEES counts after this: before, the covariance is that of the known first pose
STEADY_SCANS = 5  # timings count after this
AXES = (("x", "m"), ("y", "m"), ("theta", "rad"))

IDENTITY = ("scene", "dynamism", "seed", "slam")
ERRORS = (
    "ate_unaligned_m", "ate_se2_m", "ate_final_m", "heading_rmse_rad", "end_error_m",
    "rpe_m_per_m", "rpe_rad_per_m", "rpe_m_per_s", "rpe_rad_per_s",
)  # fmt: skip
MOMENTS = tuple(
    f"{name}_{axis}_{unit}{power}"
    for name, power in (("mean_e", ""), ("var_e", "2"), ("var_p", "2"))
    for axis, unit in AXES
)
MAPS = (
    "ghost_rate", "ghost_left_rate", "new_object_recall", "new_objects", "half_life_s",
    "half_life_observations", "half_life_events", "half_life_censored", "door_accuracy",
    "doors_judged",
)  # fmt: skip
DRIVES = (
    "duration_s", "distance_m", "moving_share_of_returns", "semi_static_share_of_returns",
)  # fmt: skip
COLUMNS = (
    *IDENTITY, "outcome", "failure", "scans", *ERRORS, *MOMENTS, "lost", "lost_at_s", "nees_over_3",
    "nees_abs_log", "not_trusted_share", "ms_per_scan_p50", "ms_per_scan_p99", "peak_memory_mb",
    *MAPS, *DRIVES,
)  # fmt: skip

LESS_IS_BETTER = (
    *ERRORS, "lost", "nees_abs_log", "ms_per_scan_p50", "ms_per_scan_p99", "peak_memory_mb",
    "ghost_rate", "ghost_left_rate", "half_life_s", "half_life_observations",
)  # fmt: skip
MORE_IS_BETTER = ("new_object_recall", "door_accuracy")
WORST_WHEN_FAILED = ERRORS  # a SLAM that failed has none, which must not flatter its median


def scored(
    track: Track, final: Trajectory | None, failure: SlamFailedError | None, truth: Trajectory
) -> dict[str, Any]:
    """The row of one SLAM, its maps and identity aside; None where there is no number."""
    row: dict[str, Any] = {"scans": len(track.estimates), **_timings(track)}
    lost_at_s = lost_at(track.online(), truth)
    if failure is not None:
        outcome = getattr(failure, "outcome", "raised")
        if lost_at_s is None:
            lost_at_s = _failed_at_s(track, truth)
        return row | {
            "outcome": outcome, "failure": str(failure), "lost": 1, "lost_at_s": lost_at_s,
        }  # fmt: skip
    row |= {"outcome": "finished" if lost_at_s is None else "lost", "failure": None}
    row |= {"lost": int(lost_at_s is not None), "lost_at_s": lost_at_s}
    return row | _errors(track.online(), final, truth) | _honesty(track, truth)


def lost_at(online: Trajectory, truth: Trajectory) -> float | None:
    """Seconds from the start to the loss (``slam.evaluation.lost``); None if it never was lost."""
    if len(online) == 0:
        return None
    pairs = metrics.pose_errors(online, truth)
    seconds = (pairs.stamps_ns - truth.stamps_ns[0]) / NS_PER_S
    return lost.lost_at(seconds, pairs.distances, pairs.errors[:, 2])


def _failed_at_s(track: Track, truth: Trajectory) -> float:
    """Of the scan that it did not answer."""
    k = min(len(track.estimates), len(truth) - 1)
    return float(truth.stamps_ns[k] - truth.stamps_ns[0]) / NS_PER_S


def _timings(track: Track) -> dict[str, Any]:
    spent = np.array(track.durations_s[STEADY_SCANS:]) * 1e3
    if len(spent) == 0:
        return {}
    p50, p99 = np.percentile(spent, [50.0, 99.0]).tolist()
    return {"ms_per_scan_p50": p50, "ms_per_scan_p99": p99}


def _errors(online: Trajectory, final: Trajectory | None, truth: Trajectory) -> dict[str, Any]:
    statistics = metrics.error_statistics(online, truth)
    pairs = metrics.pose_errors(online, truth)
    row: dict[str, Any] = {
        "ate_unaligned_m": metrics.ate(online, truth).value,
        "ate_se2_m": metrics.ate(online, truth, align="se2").value,
        "ate_final_m": metrics.ate(final or online, truth).value,
        "heading_rmse_rad": metrics.heading_rmse(online, truth).value,
        "end_error_m": float(pairs.distances[-1]),
    }
    for per in ("m", "s"):
        try:
            metre, radian = metrics.rpe(online, truth, per=per)
        except InvalidValueError:  # it did not drive so far
            continue
        row |= {f"rpe_m_per_{per}": metre.value, f"rpe_rad_per_{per}": radian.value}
    values = (statistics.mean, statistics.var_e, statistics.var_p)
    return row | dict(zip(MOMENTS, np.concatenate(values).tolist(), strict=True))


def _honesty(track: Track, truth: Trajectory) -> dict[str, Any]:
    """Mean NEES over 3 (1 where the covariance is right), and how far from 1 it is, as a ratio."""
    row = {"not_trusted_share": float(np.mean([not e.converged for e in track.estimates]))}
    online = track.online()
    settled = (online.stamps_ns - online.stamps_ns[0]) / NS_PER_S > SETTLED_S
    values = metrics.nees(online, track.covariances(), truth).values[settled]
    values = values[np.isfinite(values)]
    if len(values) == 0 or not values.mean() > 0.0:  # guests claim nothing
        return row
    ratio = float(values.mean()) / 3.0
    return row | {"nees_over_3": ratio, "nees_abs_log": abs(math.log(ratio))}
