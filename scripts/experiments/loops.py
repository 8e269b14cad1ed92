# SPDX-License-Identifier: Apache-2.0
"""Loops closed while driving: errors online and final, corrections, and what they cost.

``python -m scripts.experiments.loops --log LOG [LOG ...]``; ``--every 2`` takes every second scan,
``--way backwards`` the log from its end. A name of ``ROOMS`` in the place of a log is a drive
through that simulated room. Errors are of logs with reference poses.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from scripts.experiments.shared import Row
from scripts.experiments.study import Study
from sim.simulation import stream
from slam import create
from slam.evaluation import metrics
from slam.frames import Frame
from slam.logs import open_log
from slam.trajectory import Trajectory

ROOMS: dict[str, dict[str, Any]] = {
    "corridor": {"seed": 1, "dynamism": 0.5},
    "classroom": {"seed": 2, "dynamism": 0.3},
    "office": {"seed": 3, "dynamism": 0.5},
    "random-rooms": {"seed": 4, "dynamism": 0.5, "size_m": 22.0},
    "warehouse": {"seed": 5, "dynamism": 0.5},
    "station": {"seed": 6, "dynamism": 0.5},
}
ROOM_S = 330.0  # s of each drive: about 160 m
SCANNER = "scanner(fov_deg=180, beams=361, rate_hz=5, sigma_m=0.01)"  # an LMS-221's noise, 5 Hz


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


def frames_of(case: Row) -> list[Frame]:
    """Of a log, or of one of ``ROOMS``."""
    name = case["log"]
    room = partial(stream, name, seconds=ROOM_S, laser=SCANNER)
    whole = room(**ROOMS[name]) if name in ROOMS else open_log(Path(name))
    frames = list(whole)[:: case["every"]]
    return backwards(frames) if case["way"] == "backwards" else frames


def logs_of(case: Row) -> list[Path]:
    """The log that is read."""
    return [] if case["log"] in ROOMS else [Path(case["log"])]


def run(case: Row) -> Row:
    """Errors in m, processor times in ms, and the corrections in words."""
    frames, slam = frames_of(case), create(case["slam"])
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
    online = Trajectory(stamps_ns=stamps, poses=np.array(poses))
    truth = Trajectory(stamps_ns=stamps, poses=np.array([frame.truth for frame in frames]))
    begun = time.thread_time()
    paths = {"online": online, "final": slam.trajectory()}
    row: Row = {"scans": len(frames), "length_m": online.length_m(), "said": said}
    row |= {"end_ms": 1e3 * (time.thread_time() - begun), "spent_ms": spent[1:]}
    for which, path in paths.items():
        row[f"{which}_aligned_m"] = metrics.ate(path, truth, align="se2").value
        row[f"{which}_m"] = metrics.ate(path, truth).value
    return row


def tell(rows: Sequence[Row]) -> str:
    """Figures of each log."""
    lines = []
    for row in rows:
        p50, p99, p999 = np.percentile(row["spent_ms"], [50.0, 99.0, 99.9])
        lines += [
            f"{row['log']}, {row['slam']}: {row['scans']} scans, {row['length_m']:.0f} m",
            *(
                f"  {which:7s} ATE {row[f'{which}_aligned_m']:.4f} m aligned, "
                f"{row[f'{which}_m']:.4f} m unaligned"
                for which in ("online", "final")
            ),
            f"  scan    p50 {p50:.1f} ms, p99 {p99:.1f} ms, p99.9 {p999:.1f} ms; "
            f"end {row['end_ms']:.0f} ms",
            *(f"  {line}" for line in row["said"] or ["no correction"]),
        ]
    return "\n".join(lines)


STUDY = Study(
    name="loops",
    axes={"log": tuple(ROOMS), "slam": ("shunting",), "every": (1,), "way": ("forwards",)},
    run=run, data=logs_of, tell=tell, told="World {world}.", defaults={"seeds": 1, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
