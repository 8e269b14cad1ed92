# SPDX-License-Identifier: Apache-2.0
"""What each part of the trust in returns is worth in a crowd: one taken out at a time.

``python -m scripts.experiments.trust_in_returns --seeds 0 1 --seconds 50``.

For each variant over all runs: geometric mean and worst of the unaligned online error, and the
share of silent failures (``Judged.silent_share``). "oracle" is the SLAM on the same scans without
the returns of what can move.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from scripts.metrics.judged import Judged, world_truth
from sim.simulation import Simulation, tour
from slam import create
from slam.frames import Frame
from slam.frontend.odometry_sum import MotionSum
from slam.oracle import shown
from slam.replay import Track
from slam.shunting import ShuntingSlam
from slam.system import SlamSystem

VARIANTS: dict[str, Mapping[str, object]] = {
    "whole": {},
    "all returns vote": {"standing.settled_s": 0.0},
    "without what left": {"standing.left_s": 0.0},
    "without what came": {"standing.came_s": 0.0},
    "without surfaces": {"standing.along_m": 0.001, "standing.thin_m": 0.0},
    "young trace open": {"standing.young_trace": 0.0},
    "thin things judged": {"standing.thin_m": 0.0},
    "vague poses judge": {"standing.vague_m": 1000.0, "standing.sigmas": 0.0},
    "odometry not asked": {"standing.disagreed": 0.0},
    "never in doubt": {"carried_per_h": 0.0},
}


def recorded(scene: str, seed: int, seconds: float, motion: float, every: int) -> list[Frame]:
    """Every so many scans of a tour with its crowd, labels kept, the motion between summed."""
    simulation = Simulation(
        scene, seed=seed, motion=motion, change=0.0, laser="lms221:noise", labels=True
    )
    summed, frames = MotionSum(), []
    for k, frame in enumerate(tour(simulation, seconds)):
        summed.add(frame.odometry)
        if k % every == 0:
            frames.append(summed.passed_on(frame))
    return frames


def scored(system: SlamSystem, frames: Sequence[Frame]) -> tuple[float, float]:
    """Unaligned error, m, and the share of silent failures."""
    track = Track("one", system)
    for frame in frames:
        track.take(shown(system, frame))
    run = Judged.of(track, world_truth(frames))
    return run.ate(), run.silent_share() or 0.0


def main(arguments: list[str] | None = None) -> int:
    """A line for each variant."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=["arena", "office", "gallery", "station"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--seconds", type=float, default=50.0, help="of each run, simulated")
    parser.add_argument("--motion", type=float, default=1.0)
    parser.add_argument("--every", type=int, default=8, help="of the scans at 37.5 Hz")
    wanted = parser.parse_args(arguments)
    runs = [
        recorded(scene, seed, wanted.seconds, wanted.motion, wanted.every)
        for scene in wanted.scenes
        for seed in wanted.seeds
    ]
    print(f"{'':22s}{'mean cm':>9s}{'worst cm':>10s}{'silent':>8s}", flush=True)
    made: dict[str, Callable[[], SlamSystem]] = {
        name: partial(ShuntingSlam, numbers) for name, numbers in VARIANTS.items()
    }
    made["oracle"] = partial(create, "oracle(shunting)")
    for name, new in made.items():
        ates, silent = zip(*(scored(new(), frames) for frames in runs), strict=True)
        mean = 100.0 * float(np.exp(np.mean(np.log(ates))))
        row = f"{name:22s}{mean:9.2f}{100.0 * max(ates):10.1f}{np.mean(silent):8.3f}"
        print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
