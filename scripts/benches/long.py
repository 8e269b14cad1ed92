# SPDX-License-Identifier: Apache-2.0
"""Whether time and memory stay flat for hours: ``python -m scripts.benches.long [LOG]``.

Without a log, the robot tours the station at motion 1. A log is driven there and back again, so
that a minute of it becomes hours of one building.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from scripts.benches.world import SEED
from scripts.comparison.entry import reading_kb
from sim.simulation import Simulation, tour
from slam import se2
from slam.evaluation.lost import LOST_M
from slam.frames import NS_PER_S, Frame
from slam.logs.open import open_log
from slam.shunting import ShuntingSlam
from slam.tracker.cells import living

ROW_NS = 600 * NS_PER_S  # of the run, a row of the table
HEADINGS = ("min", "scans", "world, ms", "SLAM, ms", "slowest, ms", "RSS, MB", "blocks",
            "error, cm", "lost", "not trusted")  # fmt: skip


def there_and_back(path: Path) -> Iterator[Frame]:
    """The log for ever: forwards, backwards, forwards, each step taking the time it took."""
    frames = list(open_log(path))
    frame, stamp_ns = frames[0], frames[0].stamp_ns
    yield frame
    while True:
        for before, frame in pairwise(frames):
            stamp_ns += abs(frame.stamp_ns - before.stamp_ns)
            odometry = replace(frame.odometry, stamp_ns=stamp_ns, twist=None)
            scan = replace(frame.scan, stamp_ns=stamp_ns) if frame.scan is not None else None
            yield replace(frame, stamp_ns=stamp_ns, odometry=odometry, scan=scan)
        frames.reverse()


def measure(frames: Iterator[Frame], hours: float) -> None:
    """Print a row for each ten minutes of ``frames``; ms are of the processor, a scan."""
    slam, row = ShuntingSlam(), []
    first = next(frames)
    slam.update(first.without_truth())
    print("| " + " | ".join(HEADINGS) + " |\n|" + "---:|" * len(HEADINGS), flush=True)
    due_ns, end_ns = first.stamp_ns + ROW_NS, first.stamp_ns + round(hours * 3600 * NS_PER_S)
    start_s = time.process_time()
    for frame in frames:
        sensed_s, blind = time.process_time(), frame.without_truth()
        estimate = slam.update(blind)
        world_s, slam_s = sensed_s - start_s, time.process_time() - sensed_s
        off_m = np.nan
        if first.truth is not None and frame.truth is not None:
            off = estimate.T_map_robot - se2.between(first.truth, frame.truth)
            off_m = float(np.hypot(off[0], off[1]))
        row.append((world_s, slam_s, off_m, not estimate.converged))
        if frame.stamp_ns >= due_ns:
            world, spent, errors, doubted = np.array(row).T
            told = (
                f"{(due_ns - first.stamp_ns) / NS_PER_S / 60:.0f}", f"{len(row)}",
                f"{world.mean() * 1e3:.2f}", f"{spent.mean() * 1e3:.2f}",
                f"{spent.max() * 1e3:.0f}", f"{reading_kb('VmRSS') / 1e3:.0f}",
                f"{len(living(slam.network.cells)[0])}",
                f"{np.sqrt((errors**2).mean()) * 1e2:.1f}", f"{(errors > LOST_M).mean():.1%}",
                f"{doubted.mean():.2%}",
            )  # fmt: skip
            print("| " + " | ".join(told) + " |", flush=True)
            due_ns, row = due_ns + ROW_NS, []
            if frame.stamp_ns >= end_ns:
                return
        start_s = time.process_time()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", nargs="?", type=Path)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=SEED, help="of the station")
    asked = parser.parse_args()
    full = Simulation("station", seed=asked.seed, dynamism=0.0, motion=1.0)
    endless = tour(full, 1e7) if asked.log is None else there_and_back(asked.log)
    measure(endless, asked.hours)
