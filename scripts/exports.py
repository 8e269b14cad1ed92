# SPDX-License-Identifier: Apache-2.0
"""Streams in the formats of others; each writer says which files it wrote."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.machine import versions
from scripts.names import file_name
from slam import create, se2
from slam.errors import InvalidValueError
from slam.evaluation.wide_tum import write_wide_tum
from slam.files import replacing
from slam.frames import EPOCH, Frame, Stream
from slam.logs import write_carmen
from slam.oracle import shown
from slam.replay import Track
from slam.trajectory import Trajectory, write_tum


def tum(target: Path, stream: Stream, _: str) -> list[Path]:
    """Odometry, and the truth where it is known."""
    stamps, odometry, truth = [], [], []
    for frame in stream:
        stamps.append(frame.stamp_ns)
        odometry.append(frame.odometry.T_odom_robot)
        truth.append(frame.truth)
    at, epoch_ns = np.array(stamps), int(stream.metadata.extra.get(EPOCH, 0))
    written = [target.with_name(f"{target.stem}_odometry{target.suffix}")]
    write_tum(written[0], Trajectory(stamps_ns=at, poses=np.array(odometry)), epoch_ns)
    known = [k for k, pose in enumerate(truth) if pose is not None]
    if known:
        written.append(target.with_name(f"{target.stem}_truth{target.suffix}"))
        poses = np.array([truth[k] for k in known])
        write_tum(written[-1], Trajectory(stamps_ns=at[known], poses=poses), epoch_ns)
    return written


def smfeval(target: Path, stream: Stream, slam: str) -> list[Path]:
    """What a SLAM believes online with its covariances, and the truth in its map."""
    track = Track(slam, create(slam))
    truth: list[tuple[int, NDArray[np.float64]]] = []
    for frame in stream:
        track.take(shown(track.system, frame))
        if frame.truth is not None:
            truth.append((frame.stamp_ns, frame.truth))
    if not track.estimates:
        raise InvalidValueError("smfeval scores poses: this log has no frames")
    online, epoch_ns = track.online(), int(stream.metadata.extra.get(EPOCH, 0))
    written = [target.with_name(f"{target.stem}_{file_name(slam)}{target.suffix}")]
    write_wide_tum(
        written[0], online, track.covariances(), epoch_ns=epoch_ns, algorithm=slam,
        version=versions()["mobilia"],
    )  # fmt: skip
    if truth and truth[0][0] == online.stamps_ns[0]:  # the map begins where the robot does
        written.append(target.with_name(f"{target.stem}_truth{target.suffix}"))
        stamps = np.array([stamp_ns for stamp_ns, _ in truth])
        poses = np.array([se2.between(truth[0][1], pose) for _, pose in truth])
        write_tum(written[1], Trajectory(stamps_ns=stamps, poses=poses), epoch_ns)
    return written


def carmen(target: Path, stream: Stream, _: str) -> list[Path]:
    """Scans, odometry, true poses."""
    write_carmen(target, stream)
    return [target]


def npz(target: Path, stream: Stream, _: str) -> list[Path]:
    """Everything, labels too, as arrays by name."""
    frames = list(stream)
    if not frames or frames[0].scan is None:
        raise InvalidValueError("npz holds scans: this log has none")
    spec = frames[0].scan.spec
    if any(f.scan is not None and f.scan.spec != spec for f in frames):
        raise InvalidValueError(
            "npz holds scans of one geometry, those of this log differ: give --to carmen"
        )
    arrays = {
        "stamps_ns": np.array([f.stamp_ns for f in frames]),
        "epoch_ns": np.array(stream.metadata.extra.get(EPOCH, 0)),
        "T_odom_robot": np.array([f.odometry.T_odom_robot for f in frames]),
        "ranges": np.array([f.scan.ranges for f in frames if f.scan is not None]),
        "angles": spec.angles,
        "beam_time_offsets": spec.beam_time_offsets,
        "range_min_max": np.array([spec.range_min, spec.range_max]),
        "T_robot_laser": spec.T_robot_laser,
        **_optional(frames),
    }
    with replacing(target) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    return [target]


def _optional(frames: list[Frame]) -> dict[str, NDArray[Any]]:
    """What every frame has, of what it need not have."""
    arrays = {}
    if all(f.odometry.increment_covariance is not None for f in frames):
        covariances = [f.odometry.increment_covariance for f in frames]
        arrays["increment_covariance"] = np.array(covariances)
    if all(f.odometry.twist is not None for f in frames):
        arrays["twist"] = np.array([f.odometry.twist for f in frames])
    if all(f.truth is not None for f in frames):
        arrays["T_world_robot"] = np.array([f.truth for f in frames])
    if all(f.labels is not None for f in frames):
        for name in ("body", "kind", "displacement", "incidence", "mixed"):
            arrays[f"label_{name}"] = np.array([getattr(f.labels, name) for f in frames])
    return arrays


# By format: from where to write, a stream, and whose poses where these are asked for.
WRITERS: dict[str, Callable[[Path, Stream, str], list[Path]]] = {
    "tum": tum, "carmen": carmen, "npz": npz, "smfeval": smfeval,
}  # fmt: skip
