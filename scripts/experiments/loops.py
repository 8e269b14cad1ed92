# SPDX-License-Identifier: Apache-2.0
"""Loops closed while driving: errors online and final, corrections, and what they cost.

``python -m scripts.experiments.loops LOG [LOG ...] [--set loops.datum=first] [--maps out/loops]``.

For each log with reference poses: aligned and unaligned error of the online and of the final path,
processor time of a scan, time of ``trajectory()``, and the corrections that were announced.
``--maps`` writes the map of each as a picture.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image

from slam.evaluation import metrics
from slam.frames import Float, Frame
from slam.logs import open_log
from slam.shunting import ShuntingSlam
from slam.trajectory import Trajectory
from slam.variants import assignment


def driven(slam: ShuntingSlam, frames: list[Frame]) -> tuple[Trajectory, Float, list[str]]:
    """The online path, processor time of each scan in ms, and the corrections in words."""
    poses, spent, said = [], [], []
    for k, frame in enumerate(frames):
        begun = time.thread_time()
        estimate = slam.update(frame.without_truth())
        spent.append(1e3 * (time.thread_time() - begun))
        poses.append(estimate.T_map_robot)
        x, y, theta = estimate.diagnostics["correction"]
        if x or y or theta:
            said.append(f"scan {k}: {x:+.2f} m, {y:+.2f} m, {theta:+.3f} rad")
    stamps = np.array([frame.stamp_ns for frame in frames])
    return Trajectory(stamps_ns=stamps, poses=np.array(poses)), np.array(spent), said


def report(path: Path, changes: dict[str, object], maps: Path | None) -> None:
    """Print the figures of one log."""
    frames = list(open_log(path))
    slam = ShuntingSlam(changes)
    online, spent, said = driven(slam, frames)
    begun = time.thread_time()
    final = slam.trajectory()
    ended = 1e3 * (time.thread_time() - begun)
    truth = Trajectory(
        stamps_ns=online.stamps_ns, poses=np.array([frame.truth for frame in frames])
    )
    print(f"{path.name}: {len(frames)} scans, {online.length_m():.0f} m")
    for name, trajectory in (("online", online), ("final", final)):
        aligned = metrics.ate(trajectory, truth, align="se2").value
        plain = metrics.ate(trajectory, truth).value
        print(f"  {name:7s} ATE {aligned:.4f} m aligned, {plain:.4f} m unaligned")
    p50, p99, p999 = np.percentile(spent[1:], [50.0, 99.0, 99.9])
    print(f"  scan    p50 {p50:.1f} ms, p99 {p99:.1f} ms, p99.9 {p999:.1f} ms; end {ended:.0f} ms")
    print("\n".join(f"  {line}" for line in said) or "  no correction", flush=True)
    raster = slam.map()
    if maps is not None and raster is not None:
        maps.mkdir(parents=True, exist_ok=True)
        shades = 255.0 * (1.0 - np.nan_to_num(raster.values[::-1]))
        Image.fromarray(shades.astype(np.uint8)).save(maps / f"{path.stem}.png")


def main(arguments: list[str] | None = None) -> int:
    """Figures of each log."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--set", nargs="*", default=[], metavar="PATH=VALUE")
    parser.add_argument("--maps", type=Path)
    wanted = parser.parse_args(arguments)
    changes = dict(assignment(word, "--set") for word in wanted.set)
    for path in wanted.logs:
        report(path, changes, wanted.maps)
    return 0


if __name__ == "__main__":
    sys.exit(main())
