# SPDX-License-Identifier: Apache-2.0
"""Accuracy table over seeds nobody tuned on: ``python -m scripts.experiments.accuracy``.

For each scene, scanner, scan rate and SLAM: the median over the seeds of the unaligned online
error, the worst beside it, how many times the odometry's own error that is, the same aligned and of
the corrected trajectory, the heading, NEES / 3 after the first 5 s (1 where the covariance is
right) and runs lost.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from scripts.metrics.judged import Judged, world_truth
from scripts.metrics.table import METRICS
from sim.actors.robot import DriveConfig
from sim.core.dynamism import Dynamism
from sim.driving.drive import TourConfig
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation, n_frames, tour
from slam import create
from slam.evaluation.lost import LOST_M
from slam.files import write_text
from slam.frames import Frame
from slam.frontend.odometry_sum import thinned
from slam.replay import Track

FULL_RATE_HZ = 37.5
SCANNERS = {"noise": Lms221Config.noise_only(), "full": Lms221Config()}
STRIDES = {"5": 8, "37.5": 1}  # 4.7 Hz, and every scan
# Walls ahead and to the left at a quarter of a neuron: there pixel locking shows, at 0 or 1/2 not.
QUARTER = (0.0125, 0.0025, 0.0)


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What is simulated.

    settings  of the ``Simulation``
    fast      1.2 m/s and 2.5 rad/s instead of the usual 0.7 and 1.4
    still     the robot does not drive at all
    """

    scene: str
    settings: Mapping[str, object] = field(default_factory=dict)
    fast: bool = False
    still: bool = False

    def frames(self, scanner: str, seed: int, seconds: float) -> list[Frame]:
        """``seconds`` of it, at the scanner's full rate."""
        limits = {"drive": DriveConfig(v_max=1.2, omega_max=2.5)} if self.fast else {}
        simulation = Simulation(
            self.scene,
            seed=seed,
            laser=SCANNERS[scanner],
            **(dict(self.settings) | limits),  # type: ignore[arg-type]
        )
        if self.still:
            count = n_frames(seconds, simulation.scan_period_s)
            return [simulation.observe() for _ in range(count)]
        pace = TourConfig(v_max_mps=1.2, omega_max_radps=2.5) if self.fast else TourConfig()
        return list(tour(simulation, seconds, pace))


HALF = Dynamism.world_1(0.5)  # all figures on file are of world 1: no crowd


def _open(share: float) -> Drive:
    settings = {"walls": "none", "moving_share": share, "dynamism": HALF}
    return Drive(scene="arena", settings=settings)


DRIVES = {
    "office 0": Drive(scene="office", settings={"dynamism": 0.0}),
    "office 0.5": Drive(scene="office", settings={"dynamism": HALF}),
    "office 1": Drive(scene="office", settings={"dynamism": Dynamism.world_1(1.0)}),
    "arena, all move": Drive(scene="arena", settings={"dynamism": HALF, "moving_share": 1.0}),
    "no walls, 30 % move": _open(0.3),
    "no walls, 50 % move": _open(0.5),
    "no walls, all move": _open(1.0),
    "fast turns": Drive(scene="office", settings={"dynamism": 0.0}, fast=True),
    "corridor": Drive(scene="corridor", settings={"dynamism": 0.0}),
    "still": Drive(scene="arena", settings={"dynamism": 0.0, "start": QUARTER}, still=True),
}


# Field of ``Score`` -> metric.
FIGURES = {
    "ate_m": "ate_unaligned_m", "aligned_m": "ate_se2_m", "final_m": "ate_final_m",
    "heading_rad": "heading_rmse_rad", "nees": "nees_over_3", "ms_p50": "ms_per_scan_p50",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Score:
    """One run of one SLAM; ``aligned_m`` online, ``final_m`` of the trajectory it corrects."""

    drive: str
    scanner: str
    rate: str
    seed: int
    slam: str
    ate_m: float = math.nan
    odometry_m: float = math.nan
    aligned_m: float = math.nan
    final_m: float = math.nan
    heading_rad: float = math.nan
    nees: float = math.nan
    not_trusted: int = 0
    ms_p50: float = math.nan


def score(blank: Score, frames: list[Frame]) -> Score:
    """Let the SLAM named in ``blank`` see the frames, and fill the rest of it; inf if it fails."""
    truth = world_truth(frames)
    wheels = Track(name="odometry", system=create("odometry"))
    wheels.survive(frames)
    odometry_m = Judged.of(wheels, truth).ate()
    track = Track(name=blank.slam, system=create(blank.slam))
    failure = track.survive(frames)
    if failure is not None:
        print(f"lost, seed {blank.seed}: {failure}", file=sys.stderr, flush=True)
        lost = math.inf
        return replace(
            blank, ate_m=lost, odometry_m=odometry_m, aligned_m=lost, final_m=lost, heading_rad=lost
        )
    seen = Judged.of(track, truth, track.system.trajectory())
    seen = replace(seen, steady_s=np.array(track.durations_s))
    values = {field: METRICS[key].of(seen) for field, key in FIGURES.items()}
    figures: dict[str, Any] = {k: math.nan if v is None else v for k, v in values.items()}
    return replace(
        blank,
        odometry_m=odometry_m,
        not_trusted=sum(not e.converged for e in track.estimates),
        **figures,
    )


def scores(
    drive: str, scanner: str, seed: int, seconds: float, rates: list[str], slams: list[str]
) -> Iterator[Score]:
    """One simulated run, at every rate, seen by every SLAM."""
    whole = DRIVES[drive].frames(scanner, seed, seconds)
    for rate in rates:
        frames = thinned(whole, STRIDES[rate])
        for name in slams:
            blank = Score(drive=drive, scanner=scanner, rate=rate, seed=seed, slam=name)
            yield score(blank, frames)


def summary(runs: list[Score]) -> str:
    """One line of the table."""
    first = runs[0]
    ate = np.array([run.ate_m for run in runs]) * 100.0
    times = [run.ate_m / run.odometry_m if run.odometry_m > 0.0 else math.nan for run in runs]
    heading = np.degrees([run.heading_rad for run in runs])
    nees = [run.nees for run in runs if math.isfinite(run.nees)]
    aligned = 100.0 * float(np.median([run.aligned_m for run in runs]))
    final = 100.0 * float(np.median([run.final_m for run in runs]))
    return (
        f"{first.drive:20s}{first.scanner:6s}{FULL_RATE_HZ / STRIDES[first.rate]:5.1f} Hz "
        f"{first.slam:10s}{np.median(ate):7.2f}{ate.max():8.2f}{np.median(times):8.3f}"
        f"{aligned:8.2f}{final:8.2f}{np.median(heading):9.3f}{heading.max():8.3f}"
        f"{np.mean(nees) if nees else math.nan:8.2f}"
        f"{int((ate > 100.0 * LOST_M).sum()):5d}{sum(r.not_trusted for r in runs):6d}"
        f"{np.median([r.ms_p50 for r in runs]):7.2f}"
    )


HEADER = (
    f"{'':43s}{'ATE cm':>7s}{'worst':>8s}{'x odom':>8s}{'aligned':>8s}{'final':>8s}"
    f"{'head deg':>9s}{'worst':>8s}{'NEES/3':>8s}{'lost':>5s}{'doubt':>6s}{'ms':>7s}"
)


def main(arguments: list[str] | None = None) -> int:
    """Print the table row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slam", nargs="+", default=["shunting", "occupancy", "odometry"])
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(100, 110)))
    parser.add_argument("--seconds", type=float, default=60.0, help="of each run, simulated")
    parser.add_argument("--drives", nargs="+", default=list(DRIVES), choices=list(DRIVES))
    parser.add_argument("--scanners", nargs="+", default=["noise", "full"], choices=list(SCANNERS))
    parser.add_argument("--rates", nargs="+", default=["5", "37.5"], choices=list(STRIDES))
    parser.add_argument("--json", type=Path, help="also write every run here")
    wanted = parser.parse_args(arguments)
    everything: list[Score] = []
    print(f"pioneer3dx odometry, {wanted.seconds:g} s, seeds {wanted.seeds}\n{HEADER}", flush=True)
    for scanner in wanted.scanners:
        for drive in wanted.drives:
            runs = [
                run
                for seed in wanted.seeds
                for run in scores(drive, scanner, seed, wanted.seconds, wanted.rates, wanted.slam)
            ]
            everything += runs
            for rate in wanted.rates:
                for name in wanted.slam:
                    line = summary([r for r in runs if (r.slam, r.rate) == (name, rate)])
                    print(line, flush=True)
    if wanted.json is not None:
        write_text(wanted.json, json.dumps([asdict(run) for run in everything], indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
