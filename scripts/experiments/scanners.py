# SPDX-License-Identifier: Apache-2.0
"""Whether shunting works with every scanner: ``python -m scripts.experiments.scanners``.

A tour of the office at dynamism 0.5 with each scanner, its statistical error alone and every error
that its data sheet states. The SLAM gets about five scans a second of each, as in
``mobilia compare``, and nothing of it is set for the scanner. Printed: the median and the largest
unaligned ATE of the online poses over the seeds, in how many runs the estimate was lost, the
processor time of an update, and the machine.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scripts.comparison.columns import lost_at
from scripts.machine import machine
from scripts.metrics.judged import world_truth
from scripts.paper.runs import follow
from scripts.scanner_option import every_of
from sim.core.dynamism import Dynamism
from sim.moments import thinned, toured
from sim.sensors.lidar.registry import names
from sim.simulation import Simulation
from slam import create
from slam.evaluation import metrics

GENERIC = "scanner(fov_deg=240,beams=481,rate_hz=20,sigma_m=0.02)"
SEEDS = (100, 101, 102)


@dataclass(frozen=True, kw_only=True)
class Run:
    """One tour: unaligned ATE m, whether the estimate was lost, ms of processor an update."""

    ate_m: float
    lost: bool
    update_ms: float


def run(scanner: str, seed: int, seconds: float, scene: str, dynamism: float) -> Run:
    """Shunting over one tour with one scanner."""
    rates = Dynamism.world_1(dynamism)
    simulation = Simulation(scene, seed=seed, dynamism=rates, laser=scanner)
    moments = thinned(toured(simulation, seconds), every_of(scanner, None, 8))
    frames = [moment.frame for moment in moments]
    track, truth = follow(create("shunting"), frames, "shunting"), world_truth(frames)
    return Run(
        ate_m=metrics.ate(track.online(), truth).value,
        lost=lost_at(track.online(), truth) is not None,
        update_ms=1e3 * float(np.median(track.durations_s)),
    )


def row(scanner: str, runs: Sequence[Run], every: int) -> str:
    """A line of the table."""
    ates = [100.0 * r.ate_m for r in runs]
    return (
        f"| {scanner} | 1 in {every} | {np.median(ates):.1f} | {max(ates):.1f} | "
        f"{sum(r.lost for r in runs)} of {len(runs)} | "
        f"{np.median([r.update_ms for r in runs]):.1f} |"
    )


def main() -> None:
    """Every scanner and which of its errors, over all seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="office")
    parser.add_argument("--dynamism", type=float, default=0.5)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--scanners", nargs="+", default=[*(set(names()) - {"scanner"}), GENERIC])
    wanted = parser.parse_args()
    print("| scanner | scans used | median ATE, cm | largest, cm | lost | ms an update |")
    print("|---|---|---|---|---|---|")
    for name in sorted(wanted.scanners):
        for errors in ("noise", "full"):
            if name == GENERIC and errors == "full":
                continue  # has no other error
            scanner = f"{name}:{errors}"
            runs = [
                run(scanner, seed, wanted.seconds, wanted.scene, wanted.dynamism)
                for seed in wanted.seeds
            ]
            print(row(scanner, runs, every_of(scanner, None, 8)), flush=True)
    print(
        f"{wanted.scene}, dynamism {wanted.dynamism:g}, {wanted.seconds:g} s, seeds {wanted.seeds}"
    )
    print(", ".join(f"{key} {value}" for key, value in machine().items()))


if __name__ == "__main__":
    main()
