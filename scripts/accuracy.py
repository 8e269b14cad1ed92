# SPDX-License-Identifier: Apache-2.0
"""Accuracy table over seeds nobody tuned on: ``python -m scripts.accuracy``.

For each row (scene, dynamism, scanner, scan rate) and each SLAM: the median over the seeds of the
unaligned online error, the worst beside it, the same of the heading, what odometry alone does, and
NEES / 3 after the first 5 s (1 where the covariance is right).
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from sim.lidar_config import Lms221Config
from sim.simulation import stream
from slam import create, metrics
from slam.files import write_text
from slam.frames import Frame, Odometry
from slam.replay import Track
from slam.trajectory import Trajectory

SETTLED_S = 5.0
LOST_M = 0.5
SCANNERS = {"noise": Lms221Config.noise_only(), "full": Lms221Config()}


@dataclass(frozen=True, kw_only=True)
class Row:
    """What is simulated: ``stride`` 8 thins 37.5 Hz to 4.7 Hz."""

    scene: str
    dynamism: float
    scanner: str = "noise"
    stride: int = 8


ROWS = (
    Row(scene="office", dynamism=0.0),
    Row(scene="office", dynamism=0.5),
    Row(scene="office", dynamism=1.0),
    Row(scene="arena", dynamism=0.5),
    Row(scene="arena", dynamism=1.0),
    Row(scene="office", dynamism=0.5, stride=1),
    Row(scene="office", dynamism=0.5, scanner="full"),
    Row(scene="office", dynamism=0.5, scanner="full", stride=1),
)


@dataclass(frozen=True, kw_only=True)
class Score:
    """One run of one SLAM."""

    row: Row
    seed: int
    slam: str
    ate_m: float
    heading_rad: float
    nees: float
    not_trusted: int
    ms_p50: float


def thinned(frames: list[Frame], stride: int) -> list[Frame]:
    """Every ``stride``-th frame, with the covariance of all the motion in between."""
    out = []
    for k in range(0, len(frames), stride):
        odometry = frames[k].odometry
        parts = [f.odometry.increment_covariance for f in frames[max(k - stride + 1, 0) : k + 1]]
        given = [part for part in parts if part is not None]
        whole = Odometry(
            stamp_ns=odometry.stamp_ns,
            T_odom_robot=odometry.T_odom_robot,
            increment_covariance=np.sum(given, axis=0) if given else None,
            twist=odometry.twist,
        )
        frame = frames[k]
        out.append(
            Frame(stamp_ns=frame.stamp_ns, odometry=whole, scan=frame.scan, truth=frame.truth)
        )
    return out


def scores(row: Row, seed: int, seconds: float, slams: list[str]) -> Iterator[Score]:
    """One simulated tour, seen by every SLAM."""
    laser = SCANNERS[row.scanner]
    whole = list(stream(row.scene, seed=seed, dynamism=row.dynamism, seconds=seconds, laser=laser))
    frames = thinned(whole, row.stride)
    truth = Trajectory(
        stamps_ns=np.array([f.stamp_ns for f in frames]), poses=np.array([f.truth for f in frames])
    )
    for name in slams:
        track = Track(name=name, system=create(name))
        for frame in frames:
            track.take(frame.without_truth())
        online = track.online()
        settled = (online.stamps_ns - online.stamps_ns[0]) * 1e-9 > SETTLED_S
        nees = metrics.nees(online, track.covariances(), truth).values[settled]
        yield Score(
            row=row,
            seed=seed,
            slam=name,
            ate_m=metrics.ate(online, truth).value,
            heading_rad=metrics.heading_rmse(online, truth).value,
            nees=float(np.nanmean(nees)) / 3.0 if np.isfinite(nees).any() else math.nan,
            not_trusted=sum(not e.converged for e in track.estimates),
            ms_p50=float(np.median(track.durations_s)) * 1e3,
        )


def summary(row: Row, runs: list[Score]) -> str:
    """One line of the table."""
    ate = np.array([run.ate_m for run in runs]) * 100.0
    heading = np.degrees([run.heading_rad for run in runs])
    rate = 37.5 / row.stride
    return (
        f"{row.scene:7s} {row.dynamism:.1f} {row.scanner:5s} {rate:4.1f} Hz  {runs[0].slam:10s}"
        f" ATE {np.median(ate):6.2f} worst {ate.max():6.2f} cm"
        f"  heading {np.median(heading):.3f} worst {heading.max():.3f} deg"
        f"  NEES/3 {np.nanmean([run.nees for run in runs]):.2f}"
        f"  lost {int((ate > 100.0 * LOST_M).sum())}  {np.median([r.ms_p50 for r in runs]):.2f} ms"
    )


def main(arguments: list[str] | None = None) -> int:
    """Print the table row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slam", nargs="+", default=["shunting", "occupancy", "odometry"])
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(100, 110)))
    parser.add_argument("--seconds", type=float, default=60.0, help="of each tour, simulated")
    parser.add_argument("--rows", type=int, nargs="+", default=list(range(len(ROWS))))
    parser.add_argument("--json", type=Path, help="also write every run here")
    wanted = parser.parse_args(arguments)
    everything: list[Score] = []
    for row in (ROWS[k] for k in wanted.rows):
        runs = [
            score
            for seed in wanted.seeds
            for score in scores(row, seed, wanted.seconds, wanted.slam)
        ]
        everything += runs
        for name in wanted.slam:
            print(summary(row, [run for run in runs if run.slam == name]), flush=True)
    if wanted.json is not None:
        write_text(wanted.json, json.dumps([asdict(run) for run in everything], indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
