# SPDX-License-Identifier: Apache-2.0
"""Section 4.2: every SLAM on one world of points, and the floor of known associations."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scripts.paper.census import Census, landmarks_of
from scripts.paper.runs import follow, map_arrays, pose_numbers, save_run, truth_of
from slam import create, se2
from slam.ekf.config import EkfConfig
from slam.ekf.slam import EkfSlam
from slam.evaluation import metrics
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Float, Frame
from slam.landmarks.filter import EkfFilter
from slam.replay import Track
from slam.shunting.featured import FeaturedShuntingSlam
from slam.trajectory import Trajectory

EVERY = 10  # steps between two looks at which landmarks there are
SHUNTING: dict[str, Any] = {"cell_m": 0.01, "range_m": 12.5, "carried_per_h": 0.0}


def told(frames: Sequence[Frame], static: set[int]) -> Iterator[EkfFilter]:
    """The EKF's filter after each frame, told which point is which and which ones never move."""
    state, before, scale = EkfFilter(), None, EkfConfig().noise_scale
    index: dict[int, int] = {}
    for frame in frames:
        covariance = frame.odometry.increment_covariance
        if before is not None and covariance is not None:
            state.predict(se2.between(before, frame.odometry.T_odom_robot), covariance)
        before = frame.odometry.T_odom_robot
        seen = frame.features
        assert seen is not None
        assert seen.ids is not None
        old = [k for k, i in enumerate(seen.ids.tolist()) if i in index]
        new = [k for k, i in enumerate(seen.ids.tolist()) if i in static and i not in index]
        which = [index[int(seen.ids[k])] for k in old]
        covariances = seen.covariances * scale**2
        state.update(which, seen.points_robot[old], covariances[old])
        for k, at in zip(new, state.add(seen.points_robot[new], covariances[new]), strict=True):
            index[int(seen.ids[k])] = int(at)
        yield state


def with_known_associations(frames: Sequence[Frame], static: set[int]) -> tuple[Trajectory, Float]:
    """The floor: online poses and landmarks of the filter that is told."""
    state, poses = EkfFilter(), []
    for state in told(frames, static):
        poses.append(state.pose.copy())
    stamps = np.array([frame.stamp_ns for frame in frames])
    return Trajectory(stamps_ns=stamps, poses=np.array(poses)), state.landmarks.copy()


def run_one(path: Path, *, moving: float, seed: int, steps: int, keep: bool) -> None:
    """All SLAMs on one world; ``keep`` also keeps the maps for the figures."""
    world = PointWorld(PointWorldConfig(moving=moving, n_steps=steps), seed=seed)
    frames = list(world.stream())
    truth = truth_of(frames)
    counts = np.zeros(world.config.n_points, dtype=np.int64)
    for frame in frames:
        if frame.features is not None and frame.features.ids is not None:
            counts[frame.features.ids] += 1
    static = set(np.flatnonzero((counts >= 2) & ~world.moving).tolist())
    T_first_world = se2.inverse(world.path[0])
    true_points = se2.transform(T_first_world, world.points[0][sorted(static)])
    known, known_points = with_known_associations(frames, set(np.flatnonzero(~world.moving)))
    odometry = follow(create("odometry"), frames, "odometry")
    ekf, ekf_census = _counted(EkfSlam(preset="points"), frames, true_points)
    ours, our_census = _counted(FeaturedShuntingSlam(**SHUNTING), frames, true_points)
    floor = Census(true_points)
    floor.take(known_points, np.arange(len(known_points)))
    numbers = {
        "odometry": pose_numbers(odometry.online(), truth),
        "EKF": pose_numbers(ekf.online(), truth) | ekf_census.numbers(),
        "shunting": pose_numbers(ours.online(), truth) | our_census.numbers(),
        "known associations": pose_numbers(known, truth) | floor.numbers(),
    }
    arrays: dict[str, Any] = {"true": true_points, "truth": truth.poses}
    for name, track in (("odometry", odometry), ("EKF", ekf), ("shunting", ours)):
        arrays[f"errors {name}"] = metrics.pose_errors(track.online(), truth).errors
        arrays[f"poses {name}"] = track.online().poses
    arrays["errors known associations"] = metrics.pose_errors(known, truth).errors
    arrays["seconds"] = (truth.stamps_ns - truth.stamps_ns[0]) * 1e-9
    if keep:
        arrays |= map_arrays(ekf) | map_arrays(ours)
    save_run(path, numbers, arrays)


def _counted(system: Any, frames: Sequence[Frame], true_points: Float) -> tuple[Track, Census]:
    track, census = Track(name="", system=system), Census(true_points)
    for k, frame in enumerate(frames):
        track.take(frame.without_truth())
        if k % EVERY == 0 or k == len(frames) - 1:
            census.take(*landmarks_of(system))
    return track, census
