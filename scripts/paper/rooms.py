# SPDX-License-Identifier: Apache-2.0
"""Experiments in simulated rooms: one tour with the LMS-221, seen by every SLAM."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scripts.paper.runs import follow, map_arrays, pose_numbers, save_run, truth_of
from sim.core.dynamism import Dynamism
from sim.simulation import stream
from slam import create, se2
from slam.evaluation import metrics
from slam.frames import Float, Frame
from slam.frontend.odometry_steps import thinned

STRIDE = 5  # 37.5 Hz thinned to 7.5 Hz
FAILED_M, FAILED_RAD = 0.5, 0.2
SYSTEMS: dict[str, tuple[str, dict[str, Any]]] = {
    "odometry": ("odometry", {}),
    "occupancy": ("occupancy", {}),
    "EKF": ("ekf", {"preset": "corners"}),
    "shunting": ("shunting", {}),
    "shunting, features": ("shunting-features", {}),
    "shunting, paper preset, beams": ("shunting", {"config": "paper"}),
    "shunting, paper preset": ("shunting-features", {"config": "paper"}),
}
EVERY_SCAN, EVERY_BEAM = 8, 4  # of the raw points kept for the figure


def run_one(  # noqa: PLR0913 (the arguments of a job)
    path: Path,
    *,
    scene: str,
    options: dict[str, Any],
    dynamism: float,
    seed: int,
    seconds: float,
    keep: bool,
) -> None:
    """Simulate a tour and let every SLAM see it; ``keep`` also keeps maps for the figures.

    The room is one of world 1: no crowd, no change out of sight.
    """
    rates = Dynamism.world_1(dynamism)
    whole = list(stream(scene, seed=seed, dynamism=rates, seconds=seconds, **options))
    frames = thinned(whole, STRIDE)
    truth = truth_of(frames)
    numbers: dict[str, Any] = {}
    arrays: dict[str, Any] = {
        "truth": truth.poses,
        "seconds": (truth.stamps_ns - truth.stamps_ns[0]) * 1e-9,
    }
    for name, (kind, settings) in SYSTEMS.items():
        track = follow(create(kind, **settings), frames, name)
        scored = pose_numbers(track.online(), truth)
        lost = not track.estimates[-1].converged
        scored["failed"] = bool(
            lost or scored["rmse_m"] > FAILED_M or scored["heading_rmse_rad"] > FAILED_RAD
        )
        scored["ms"] = float(np.median(track.durations_s)) * 1e3
        numbers[name] = scored
        arrays[f"errors {name}"] = metrics.pose_errors(track.online(), truth).errors
        arrays[f"poses {name}"] = track.online().poses
        if keep:
            arrays |= map_arrays(track, f" {name}")
    if keep:
        arrays["raw"] = raw_points(frames, arrays["poses shunting"])
    save_run(path, numbers, arrays)


def raw_points(frames: Sequence[Frame], poses: Float) -> Float:
    """(n, 2) m: returns of every so many scans, where the poses put them."""
    out = []
    for frame, pose in list(zip(frames, poses, strict=True))[::EVERY_SCAN]:
        if frame.scan is None:
            continue
        spec, hit = frame.scan.spec, frame.scan.valid
        ranges, angles = frame.scan.ranges[hit][::EVERY_BEAM], spec.angles[hit][::EVERY_BEAM]
        points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)
        out.append(se2.transform(se2.compose(pose, spec.T_robot_laser), points))
    return np.concatenate(out)
