# SPDX-License-Identifier: Apache-2.0
"""Exact relations between poses of an episode, in the format of Kümmerle et al. 2009.

("On measuring the accuracy of SLAM algorithms", Autonomous Robots 27.) A line is ``t1 t2 x y z roll
pitch yaw``: the pose at t2 as seen from that at t1. The metric compares relations, not poses, so it
needs no common frame. Theirs come from matching by hand; these are from the truth.
"""

from __future__ import annotations

import math
from pathlib import Path

from slam import se2
from slam.files import write_text
from slam.frames import NS_PER_S
from slam.trajectory import Trajectory

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
