# SPDX-License-Identifier: Apache-2.0
"""A log's twin: building, way, scanner, odometry as wrong as its own; both in one picture."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from scenes import build
from scenes.crowd import crowd_of
from scenes.crowd_kinds import with_crowd
from scenes.from_map import FromMap, plan, write
from scenes.scene import Scene
from scripts.figures import save, styled
from sim.core.dynamism import Dynamism
from sim.sensors.odometry.fit import OdometryFit, fitted
from sim.twins.log import Drive, LogTwin, laid, scanner_like
from slam import create, se2
from slam.errors import InvalidValueError
from slam.evaluation.evidence import Beside, beside, evidence_of
from slam.evaluation.scanner.card import measure
from slam.frames import Float, Frame, LaserSpec, Stream, StreamMetadata
from slam.logs import open_log
from slam.replay import Replay

PASSES = 2  # the second time with better poses


REFERENCE = "reference"
LEAST_SCANS = 30
SIGMA_M = 0.01  # of a log from which nothing can be measured: a SICK LMS's


@dataclass(frozen=True, kw_only=True, eq=False)
class Recorded:
    """A log, read: its frames with scans, and where they were taken.

    poses  (n, 3) of the robot: the log's reference, or those of a SLAM;  whose  of which
    """

    stream: Stream
    frames: list[Frame]
    poses: Float
    whose: str

    @property
    def spec(self) -> LaserSpec:
        """Of all its scans."""
        scan = self.frames[0].scan
        assert scan is not None
        return scan.spec

    @property
    def odometry(self) -> Float:
        """(n, 3) as the log has it."""
        return np.array([frame.odometry.T_odom_robot for frame in self.frames])


@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """A twin: its frames, what they were made with, and the log beside it."""

    stream: Stream
    scene: Scene
    fit: OdometryFit
    beside: Beside
    words: dict[str, Any] = field(default_factory=dict)


def recorded(path: Path, slam: str) -> Recorded:
    """The log at ``path``; where it has no reference, a SLAM says where its scans were taken.

    Raises ``InvalidValueError`` for a log of too few scans, ``LogFormatError`` for no log.
    """
    stream = open_log(path)
    frames = [frame for frame in stream if frame.scan is not None]
    if len(frames) < LEAST_SCANS:
        raise InvalidValueError(f"{path}: {len(frames)} scans, at least {LEAST_SCANS} are needed")
    others = [k for k, frame in enumerate(frames) if not _alike(frames[0], frame)]
    if others:
        raise InvalidValueError(
            f"{path}: scan {others[0]} has other beams, or the scanner elsewhere, than the first: "
            "a twin has one scanner"
        )
    if slam == REFERENCE and all(frame.truth is not None for frame in frames):
        poses = np.array([frame.truth for frame in frames])
        return Recorded(stream=stream, frames=frames, poses=poses, whose=REFERENCE)
    name = "shunting" if slam == REFERENCE else slam
    replay = Replay.of({name: create(name)})
    list(replay.run(frame.without_truth() for frame in frames))
    replay.tracks[name].finish()
    track = replay.tracks[name].final() or replay.tracks[name].online()
    return Recorded(stream=stream, frames=frames, poses=np.array(track.poses), whose=name)


def _alike(one: Frame, other: Frame) -> bool:
    """Whether two scans are of one scanner."""
    assert one.scan is not None
    assert other.scan is not None
    a, b = one.scan.spec, other.scan.spec
    return a.angles.shape == b.angles.shape and bool(
        np.allclose(a.angles, b.angles) and np.allclose(a.T_robot_laser, b.T_robot_laser)
    )


def housed(log: Recorded, folder: Path) -> tuple[Recorded, Path]:
    """The log with its poses put right by the walls, and the scene of what its scans show, as
    building.toml and building.xml in ``folder``."""
    name, poses = str(log.stream.metadata.extra.get("file", "a log")), log.poses
    scans = [frame.scan for frame in log.frames if frame.scan is not None]
    mount, angles = log.spec.T_robot_laser, log.spec.angles
    ranges = np.array([np.where(scan.valid, scan.ranges, np.nan) for scan in scans])
    for _ in range(PASSES):
        raster = evidence_of(scans, poses).raster()
        drawn = plan(raster, FromMap(path=poses[:, :2], things=False, few=False), source=name)
        lasers = np.array([se2.compose(pose, mount) for pose in poses])
        walls, lasers = laid(drawn.walls, lasers, ranges.astype(np.float64), angles)
        poses = np.array([se2.compose(laser, se2.inverse(mount)) for laser in lasers])
    seen = replace(drawn, walls=walls, ends=drawn.ends[:0])  # a twin has what the log saw
    scene = write(seen, folder / "building", made_of=name)
    return replace(log, poses=poses), scene


def made(
    log: Recorded, scene: Path, *, seed: int = 0, crowd: str = "none", motion: float = 0.0
) -> Made:
    """The twin of a log in a scene by its file."""
    poses = log.poses
    built = with_crowd(build(str(scene), seed=seed), crowd_of(crowd), as_many_as_fit=True)
    fit, sigma_m, unit_m = fitted(log.odometry, poses), *_noise(log.stream)
    rng = np.random.default_rng([seed, 1])
    drive = Drive(
        stamps_ns=np.array([frame.stamp_ns for frame in log.frames]),
        poses=poses,
        odometry=fit.drawn(poses, rng),
    )
    lives = motion > 0.0
    twin = LogTwin(
        built, drive, log.spec, scanner_like(log.spec, sigma_m, unit_m), seed=seed,
        rates=Dynamism.of(Dynamism.at(0.0), motion=motion) if lives else None,
    )  # fmt: skip
    frames = list(twin.frames())
    settings = {
        "seed": seed, "crowd": crowd, "motion": motion, "poses": log.whose,
        "sigma_m": sigma_m, "range_step_m": unit_m, "odometry": fit.words(),
    }  # fmt: skip
    found = beside(log.frames, frames, poses)
    return Made(
        stream=_stream(frames, log.spec, settings), scene=built, fit=fit, beside=found,
        words={**settings, "beside": found.words()},
    )  # fmt: skip


def _noise(stream: Stream) -> tuple[float, float]:
    """(one sigma m, step m of the ranges) by the log's own sensor card."""
    card = measure(stream)
    values = [card.figures[key].value for key in ("standing", "wall") if key in card.figures]
    sigma = next((value for value in values if math.isfinite(value)), SIGMA_M)
    step = card.figures["step"].value
    return round(float(sigma), 5), round(float(step), 6) if math.isfinite(step) else 0.0


def _stream(frames: list[Frame], spec: LaserSpec, extra: Mapping[str, Any]) -> Stream:
    metadata = StreamMetadata(
        source="simulation", laser=spec, truth="simulator", extra={"twin": dict(extra)}
    )
    return Stream(metadata=metadata, frames=lambda: frames, length=len(frames))


SHOWN_M = 0.3  # differences beyond are drawn as that
MOST_POINTS = 120_000


@styled()
def differences(path: Path, found: Beside, poses: Float, title: str) -> None:
    """The log's returns, coloured by how much farther (red) or nearer (blue) the twin's lie."""
    every = max(1, len(found.apart) // MOST_POINTS)
    x, y = found.points[::every].T
    apart = np.clip(found.apart[::every], -SHOWN_M, SHOWN_M)
    order = np.argsort(np.abs(apart), kind="stable")
    span = np.ptp(found.points, axis=0) / np.ptp(found.points, axis=0).max()
    figure = Figure(figsize=(2.5 + 7.0 * float(span[0]), 1.5 + 7.0 * float(span[1])))
    axes = figure.add_subplot()
    drawn = axes.scatter(x[order], y[order], c=apart[order], s=1.0, cmap="coolwarm", linewidths=0)
    axes.plot(poses[:, 0], poses[:, 1], color="#168c5a", linewidth=0.5)
    axes.set_aspect("equal")
    axes.set(xlabel="x, m", ylabel="y, m", title=title)
    figure.colorbar(drawn, ax=axes, shrink=0.7, label="the twin's return lies farther, m")
    save(figure, path)
