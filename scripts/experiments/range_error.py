# SPDX-License-Identifier: Apache-2.0
"""The scanner's systematic error learnt: ``python -m scripts.experiments.range_error``.

For each scene, dynamism and scanner, over training seeds: the median over the seeds of the
unaligned and the aligned online error with the error learnt and without, the worst beside it, and
in how many runs an error was found.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from scripts.experiments.accuracy import SCANNERS
from sim.core.dynamism import Dynamism
from sim.simulation import Simulation, tour
from slam import se2
from slam.evaluation import metrics
from slam.frames import Frame
from slam.frontend.odometry_sum import thinned
from slam.shunting import ShuntingSlam
from slam.trajectory import Trajectory
from slam.variants import assignment

SCENES = ("office", "arena")
SWITCH = ("off", "on")


class Run(NamedTuple):
    """One run: errors in m, and whether a systematic error was taken off at its end."""

    ate_m: float
    aligned_m: float
    found: bool


def run(frames: list[Frame], changes: Mapping[str, Any]) -> Run:
    """The errors online of one SLAM on one stream."""
    slam = ShuntingSlam(changes)
    poses = np.array([slam.update(frame.without_truth()).T_map_robot for frame in frames])
    stamps = np.array([frame.stamp_ns for frame in frames])
    first = frames[0].truth
    assert first is not None
    truth = np.array([se2.between(first, frame.truth) for frame in frames])  # type: ignore[arg-type]
    online, true = (Trajectory(stamps_ns=stamps, poses=p) for p in (poses, truth))
    return Run(
        ate_m=metrics.ate(online, true).value,
        aligned_m=metrics.ate(online, true, align="se2").value,
        found=slam.learnt_error is not None and slam.learnt_error.found,
    )


def streams(
    scene: str, dynamism: float, scanner: str, seeds: list[int], seconds: float, every: int
) -> list[list[Frame]]:
    """One drive for each seed, every so many scans of it."""
    out = []
    for seed in seeds:
        moving = Dynamism.world_1(dynamism)  # as the accuracy table: no crowd
        simulation = Simulation(scene, seed=seed, laser=SCANNERS[scanner], dynamism=moving)
        out.append(thinned(list(tour(simulation, seconds)), every))
    return out


def line(words: str, runs: list[Run]) -> str:
    """One row of the table."""
    ate = 100.0 * np.array([one.ate_m for one in runs])
    aligned = 100.0 * np.array([one.aligned_m for one in runs])
    found = sum(one.found for one in runs)
    return (
        f"{words:34s}{np.median(ate):8.2f}{ate.max():8.2f}{np.median(aligned):9.2f}"
        f"{found:6d} of {len(runs)}"
    )


def main(arguments: list[str] | None = None) -> int:
    """Print the table row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--dynamism", type=float, nargs="+", default=[0.0, 0.5])
    parser.add_argument("--scanners", nargs="+", default=["noise", "full"], choices=list(SCANNERS))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--seconds", type=float, default=60.0, help="of each drive, simulated")
    parser.add_argument("--every", type=int, default=8, help="use one scan in so many")
    parser.add_argument("--set", nargs="*", default=[], metavar="PATH=VALUE")
    wanted = parser.parse_args(arguments)
    changes = dict(assignment(word, "--set") for word in wanted.set)
    print(f"{wanted.seconds:g} s, every {wanted.every}th scan, seeds {wanted.seeds}; cm")
    print(f"{'':34s}{'ATE':>8s}{'worst':>8s}{'aligned':>9s}{'found':>8s}")
    for scanner in wanted.scanners:
        for scene in wanted.scenes:
            for dynamism in wanted.dynamism:
                drives = streams(
                    scene, dynamism, scanner, wanted.seeds, wanted.seconds, wanted.every
                )
                for learn in SWITCH:
                    words = f"{scene} {dynamism:g}, {scanner}, learn {learn}"
                    runs = [run(d, changes | {"range_error.learn": learn}) for d in drives]
                    print(line(words, runs), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
