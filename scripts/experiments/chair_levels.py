# SPDX-License-Identifier: Apache-2.0
"""What chairs on castors cost and change.

``python -m scripts.experiments.chair_levels [--seconds 30]``.

The same tours of the office at both levels of chair physics (``sim.actors.castors``): physics
steps a second, and how far the SLAM's path and map are off. Chairs take different paths after the
first push, so single runs differ; what matters is whether the means do.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from scripts.comparison.maps import Believed, StaticDistance
from scripts.metrics.judged import world_truth
from scripts.paper.runs import follow
from sim.actors.castors import LEVELS
from sim.simulation import Simulation, tour
from sim.world.world import World
from slam import create
from slam.evaluation import metrics


def steps_per_s(level: str, n: int = 3000) -> float:
    """Physics steps a second of CPU, actors included."""
    world = World("office", seed=1, dynamism=0.8, n_chairs=50, n_people=10, chairs=level)
    for _ in range(900):
        world.substep()
    began = time.process_time()
    for _ in range(n):
        world.substep()
    return n / (time.process_time() - began)


def run(level: str, seed: int, seconds: float) -> tuple[float, float]:
    """RMS error of the online positions m, mean distance of mapped from true walls m."""
    simulation = Simulation("office", seed=seed, dynamism=0.8, chairs=level)
    frames = list(tour(simulation, seconds))
    track, truth = follow(create("shunting"), frames, "shunting"), world_truth(frames)
    mapped = track.map()
    assert mapped is not None
    occupied = Believed(mapped, truth.poses[0]).occupied()
    off_m = StaticDistance(simulation.world.scene.static_map)(occupied)
    return metrics.ate(track.online(), truth).value, float(off_m[np.isfinite(off_m)].mean())


def main() -> None:
    """Measure both levels and print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    print(f"{'chairs':8s}{'steps/s':>9s}{'position RMS':>14s}{'map error':>11s}   (m; per seed)")
    for level in LEVELS:
        results = np.array([run(level, s, arguments.seconds) for s in range(arguments.seeds)])
        each = "  ".join(f"{rms:.3f}/{off:.3f}" for rms, off in results.tolist())
        rms, off = results.mean(axis=0).tolist()
        print(f"{level:8s}{steps_per_s(level):9.0f}{rms:14.3f}{off:11.3f}   {each}")


if __name__ == "__main__":
    main()
