# SPDX-License-Identifier: Apache-2.0
"""``mobilia export``: an episode, or any bag, in the formats of others."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from scripts.console import say, working
from scripts.names import check
from slam.errors import InvalidValueError
from slam.files import replacing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from slam.frames import Frame, Stream

SLAM = "shunting"


def export(
    episode: Annotated[Path, typer.Argument(help="An episode, a bag or any other log.")],
    to: Annotated[str, typer.Option(help="tum, carmen, npz or smfeval.")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write; default beside the log or dataset. tum: NAME_odometry.tum, ..."
        ),
    ] = None,
    slam: Annotated[str, typer.Option(help="With --to smfeval: whose poses.")] = SLAM,
) -> None:
    """Write an episode as TUM trajectories, as a CARMEN log or as NumPy arrays.

    tum: NAME_odometry.tum and, where it is known, NAME_truth.tum. carmen: scans, odometry, true
    poses. npz: everything, labels too, as arrays by name. smfeval: runs a SLAM; NAME_SLAM.tum has
    its online poses with their covariances ("wide TUM"), NAME_truth.tum the true ones in its map.
    """
    writers: dict[str, Callable[[Path, Stream], list[Path]]] = {
        "tum": _tum, "carmen": _carmen, "npz": _npz, "smfeval": partial(_smfeval, slam=slam),
    }  # fmt: skip
    if to not in writers:
        raise InvalidValueError(f"--to must be one of {', '.join(writers)}, got {to!r}")
    if slam != SLAM and to != "smfeval":
        raise InvalidValueError(f"--slam is for --to smfeval, got --to {to}")
    check([slam])
    if out is not None and out.is_dir():
        raise InvalidValueError(f"--out must be a file, got the folder {out}")
    from sim.recording.verify import check_bag
    from slam.logs import open_log, read_bag
    from slam.logs.bag_topics import is_bag

    check_bag(episode)
    stream = read_bag(episode, labels=True) if is_bag(episode) else open_log(episode)
    suffix = {"carmen": ".log.gz", "npz": ".npz"}.get(to, ".tum")
    plain = episode.absolute()
    target = out or _beside(plain) / (plain.name.split(".log")[0] + suffix)
    with working(f"writing {to}"):
        written = writers[to](target, stream)
    for path in written:
        say(escape(str(path)))


def _beside(log: Path) -> Path:
    """The nearest folder above whose files no SHA256SUMS lists: there, one more is no damage."""
    from sim.recording.sums import SUMS

    free = (folder for folder in log.parents if not (folder / SUMS).exists())
    return next(free, log.parent)


def _tum(target: Path, stream: "Stream") -> list[Path]:
    import numpy as np

    from slam.frames import EPOCH
    from slam.trajectory import Trajectory, write_tum

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


def _smfeval(target: Path, stream: "Stream", slam: str) -> list[Path]:
    import numpy as np

    from scripts.machine import versions
    from scripts.names import file_name
    from slam import create, se2
    from slam.evaluation.wide_tum import write_wide_tum
    from slam.frames import EPOCH
    from slam.oracle import shown
    from slam.replay import Track
    from slam.trajectory import Trajectory, write_tum

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


def _carmen(target: Path, stream: "Stream") -> list[Path]:
    from slam.logs import write_carmen

    write_carmen(target, stream)
    return [target]


def _npz(target: Path, stream: "Stream") -> list[Path]:
    import numpy as np

    from slam.frames import EPOCH

    frames = list(stream)
    if not frames or frames[0].scan is None:
        raise InvalidValueError("npz holds scans: this log has none")
    spec = frames[0].scan.spec
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


def _optional(frames: "list[Frame]") -> "dict[str, NDArray[Any]]":
    """What every frame has, of what it need not have."""
    import numpy as np

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
