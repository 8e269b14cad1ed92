# SPDX-License-Identifier: Apache-2.0
"""What chairs on castors cost and change.

``python -m scripts.experiments.chair_levels [--seconds 30]``.

The same tours of the office at both levels of chair physics (``sim.actors.castors``): physics
steps a
second, and how far the SLAM's path and map are off. Chairs take different ways after the first
push, so single runs differ; what matters is whether the means do.
"""

from __future__ import annotations

import argparse
import time

import cv2
import numpy as np

from sim.actors.castors import LEVELS
from sim.simulation import Simulation, tour
from sim.world.world import World
from slam import create, se2
from slam.frames import Float
from slam.system import Raster


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
    slam = create("shunting")
    start: Float | None = None
    errors = []
    for frame in tour(simulation, seconds):
        estimate = slam.update(frame.without_truth())
        assert frame.truth is not None
        start = frame.truth if start is None else start
        errors.append(se2.between(start, frame.truth)[:2] - estimate.T_map_robot[:2])
    mapped = slam.map()
    assert start is not None
    assert mapped is not None
    rms = float(np.sqrt((np.array(errors) ** 2).sum(axis=1).mean()))
    return rms, map_error(mapped, start, simulation.world.scene.static_map)


def map_error(mapped: Raster, T_world_map: Float, truth: Raster) -> float:
    """Mean distance of the cells mapped as occupied from what truly never moves, m."""
    rows, columns = np.nonzero(np.nan_to_num(mapped.values) > 0.5)
    local = (np.column_stack([columns, rows]) + 0.5) * mapped.resolution_m
    points = se2.transform(se2.compose(T_world_map, mapped.T_map_origin), local)
    free = (truth.values < 0.5).astype(np.uint8)
    distance = cv2.distanceTransform(free, cv2.DIST_L2, 5) * truth.resolution_m
    cells = np.floor((points - truth.T_map_origin[:2]) / truth.resolution_m).astype(np.int64)
    inside = ((cells >= 0) & (cells < [free.shape[1], free.shape[0]])).all(axis=1)
    return float(distance[cells[inside, 1], cells[inside, 0]].mean())


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
