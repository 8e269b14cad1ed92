# SPDX-License-Identifier: Apache-2.0
"""Loops closed while driving: errors online and final, corrections, and what they cost.

``python -m scripts.experiments.loops LOG [LOG ...] [--set loops.datum=first] [--maps out/loops]``;
``--every 2`` takes every second scan, ``--backwards`` the log from its end; ``--rooms`` drives
through six simulated rooms instead; ``--slam occupancy``.

For each log with reference poses: aligned and unaligned error of the online and of the final path,
processor time of a scan, time of ``trajectory()``, and the corrections that were announced.
``--maps`` writes the map of each as a picture.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from scripts.checked import whole
from scripts.experiments.measured import ended
from sim.simulation import stream
from slam.evaluation import metrics
from slam.frames import Float, Frame
from slam.grid.occupancy import OccupancySlam
from slam.logs import open_log
from slam.shunting import ShuntingSlam
from slam.trajectory import Trajectory
from slam.variants import assignment

ROOMS: tuple[tuple[str, int, float, dict[str, Any]], ...] = (  # scene, seed, dynamism, options
    ("corridor", 1, 0.5, {}), ("classroom", 2, 0.3, {}), ("office", 3, 0.5, {}),
    ("random-rooms", 4, 0.5, {"size_m": 22.0}), ("warehouse", 5, 0.5, {}), ("station", 6, 0.5, {}),
)  # fmt: skip
ROOM_S = 330.0  # s of each drive: about 160 m
SCANNER = "scanner(fov_deg=180, beams=361, rate_hz=5, sigma_m=0.01)"  # an LMS-221's noise, 5 Hz
SLAMS: dict[str, type[ShuntingSlam] | type[OccupancySlam]] = {
    "shunting": ShuntingSlam, "occupancy": OccupancySlam,
}  # fmt: skip


def read(path: Path) -> list[Frame]:
    """A log."""
    return list(open_log(path))


def driven_room(scene: str, seed: int, dynamism: float, options: dict[str, Any]) -> list[Frame]:
    """One of ``ROOMS``."""
    return list(
        stream(scene, seconds=ROOM_S, seed=seed, dynamism=dynamism, laser=SCANNER, **options)
    )


def backwards(frames: list[Frame]) -> list[Frame]:
    """The same scans and poses, from the last to the first."""
    ends = frames[0].stamp_ns + frames[-1].stamp_ns
    out = []
    for frame in reversed(frames):
        stamp = ends - frame.stamp_ns
        scan = None if frame.scan is None else replace(frame.scan, stamp_ns=stamp)
        odometry = replace(frame.odometry, stamp_ns=stamp)
        out.append(replace(frame, stamp_ns=stamp, odometry=odometry, scan=scan))
    return out


def driven(
    slam: ShuntingSlam | OccupancySlam, frames: list[Frame]
) -> tuple[Trajectory, Float, list[str]]:
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


def report(
    name: str, frames: list[Frame], slam: ShuntingSlam | OccupancySlam, maps: Path | None
) -> None:
    """Print the figures of one log or room."""
    online, spent, said = driven(slam, frames)
    begun = time.thread_time()
    final = slam.trajectory()
    ended = 1e3 * (time.thread_time() - begun)
    truth = Trajectory(
        stamps_ns=online.stamps_ns, poses=np.array([frame.truth for frame in frames])
    )
    print(f"{name}: {len(frames)} scans, {online.length_m():.0f} m")
    for which, trajectory in (("online", online), ("final", final)):
        aligned = metrics.ate(trajectory, truth, align="se2").value
        plain = metrics.ate(trajectory, truth).value
        print(f"  {which:7s} ATE {aligned:.4f} m aligned, {plain:.4f} m unaligned")
    p50, p99, p999 = np.percentile(spent[1:], [50.0, 99.0, 99.9])
    print(f"  scan    p50 {p50:.1f} ms, p99 {p99:.1f} ms, p99.9 {p999:.1f} ms; end {ended:.0f} ms")
    print("\n".join(f"  {line}" for line in said) or "  no correction", flush=True)
    raster = slam.map()
    if maps is not None and raster is not None:
        maps.mkdir(parents=True, exist_ok=True)
        shades = 255.0 * (1.0 - np.nan_to_num(raster.values[::-1]))
        Image.fromarray(shades.astype(np.uint8)).save(maps / f"{Path(name).stem}.png")


def main(arguments: list[str] | None = None) -> int:
    """Figures of each log."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="*", type=Path)
    parser.add_argument("--rooms", action="store_true")
    parser.add_argument("--every", type=int, default=1, metavar="N")
    parser.add_argument("--backwards", action="store_true")
    parser.add_argument("--slam", choices=sorted(SLAMS), default="shunting")
    parser.add_argument("--set", nargs="*", default=[], metavar="PATH=VALUE")
    parser.add_argument("--maps", type=Path)
    wanted = parser.parse_args(arguments)
    changes = dict(assignment(word, "--set") for word in wanted.set)
    runs = [(path.name, partial(read, path)) for path in wanted.logs]
    if wanted.rooms:
        runs += [(room[0], partial(driven_room, *room)) for room in ROOMS]
    if not runs:
        parser.error("name a log, or --rooms")
    whole("--every", wanted.every, 1)
    for name, frames_of in runs:
        frames = frames_of()[:: wanted.every]
        frames = backwards(frames) if wanted.backwards else frames
        report(name, frames, SLAMS[wanted.slam](changes), wanted.maps)
    return 0


if __name__ == "__main__":
    sys.exit(ended(main))
