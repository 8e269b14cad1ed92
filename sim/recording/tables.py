# SPDX-License-Identifier: Apache-2.0
"""Tables of truth, CSV.

A pose is three fields, x m, y m and heading rad; all three empty: out of the building.
``rearranged.csv`` has what was put elsewhere out of sight. Relations are those of Kümmerle et
al. 2009 ("On measuring the accuracy of SLAM algorithms", Autonomous Robots 27), here from the
truth: a line is ``t1 t2 x y z roll pitch yaw``, the pose at t2 as seen from that at t1, so that the
metric needs no common frame.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from scenes.scene import Pose
from sim.actors.rearranging import Rearrangement, is_out
from slam import se2
from slam.files import cell_of, write_text
from slam.frames import NS_PER_S
from slam.trajectory import Trajectory

POSE = ("x_m", "y_m", "heading_rad")


def pose_words(pose: Pose | None) -> tuple[str, ...]:
    """The three fields of a pose."""
    return ("", "", "") if pose is None else tuple(f"{value:.6f}" for value in pose)


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """The text of a file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([cell_of(c) if isinstance(c, str) else c for c in row] for row in rows)
    return text.getvalue()


REARRANGED = "rearranged.csv"
COLUMNS = ("time_s", "name", "change", *(f"from_{c}" for c in POSE), *(f"to_{c}" for c in POSE))
Rect = tuple[float, float, float, float]


def write_rearranged(path: Path, events: Sequence[Rearrangement], bounds: Rect) -> None:
    """A row for each thing put elsewhere, in order; times in s since the start, poses m, m, rad."""
    rows = []
    for event in events:
        poses = [None if is_out(np.array(p), bounds) else p for p in (event.before, event.after)]
        words = (word for pose in poses for word in pose_words(pose))
        rows.append((f"{event.time_s:.6f}", event.name, event.change, *words))
    write_text(path, table(COLUMNS, rows))


STEP_NS = NS_PER_S  # between the poses that are related
FAR = 10  # steps: the second kind of relation, and the least before a place is seen again
NEAR_M = 1.0  # to a pose before that: a place seen again


def pairs(trajectory: Trajectory) -> list[tuple[int, int]]:
    """Indices (i, j): neighbours a second apart, ten seconds apart, and places seen again."""
    chosen: list[int] = []
    for k, stamp_ns in enumerate(trajectory.stamps_ns.tolist()):
        if not chosen or stamp_ns - int(trajectory.stamps_ns[chosen[-1]]) >= STEP_NS:
            chosen.append(k)
    positions = trajectory.poses[chosen, :2].tolist()
    out = []
    for b in range(1, len(chosen)):
        out.append((chosen[b - 1], chosen[b]))
        if b < FAR:
            continue
        out.append((chosen[b - FAR], chosen[b]))
        seen = [(math.dist(positions[a], positions[b]), a) for a in range(b - FAR)]
        if seen and min(seen)[0] < NEAR_M:
            out.append((chosen[min(seen)[1]], chosen[b]))
    return out


def write_relations(path: Path, truth: Trajectory) -> None:
    """One line for each of ``pairs``."""
    lines = []
    for i, j in pairs(truth):
        x, y, yaw = se2.between(truth.poses[i], truth.poses[j]).tolist()
        times = f"{_seconds(truth, i)} {_seconds(truth, j)}"
        lines.append(f"{times} {x:.9f} {y:.9f} 0 0 0 {yaw:.12f}\n")
    write_text(path, "".join(lines))


def _seconds(trajectory: Trajectory, k: int) -> str:
    seconds, nanoseconds = divmod(int(trajectory.stamps_ns[k]), NS_PER_S)
    return f"{seconds}.{nanoseconds:09d}"
