# SPDX-License-Identifier: Apache-2.0
"""``rearranged.csv`` of an episode: what was put elsewhere out of the robot's sight, and when.

A pose that is left empty is out of the building.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes.scene import Pose
from sim.actors.rearranging import Rearrangement, is_out
from sim.recording.tables import POSE, pose_words, read_table, table
from slam.files import write_text

REARRANGED = "rearranged.csv"
COLUMNS = ("time_s", "name", "change", *(f"from_{c}" for c in POSE), *(f"to_{c}" for c in POSE))
CHANGES = ("moved", "parked", "unparked", "swapped", "removed", "brought in")
MAX_S = 1e9  # of a time, more than an episode may last
Rect = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Rearranged:
    """A row: when, s; which; how (one of ``CHANGES``); from where, to where; None: out."""

    time_s: float
    name: str
    change: str
    before: Pose | None
    after: Pose | None


def write_rearranged(path: Path, events: Sequence[Rearrangement], bounds: Rect) -> None:
    """A row for each thing put elsewhere, in order; times in s since the start, poses m, m, rad."""
    rows = []
    for event in events:
        poses = [None if is_out(np.array(p), bounds) else p for p in (event.before, event.after)]
        words = (word for pose in poses for word in pose_words(pose))
        rows.append((f"{event.time_s:.6f}", event.name, event.change, *words))
    write_text(path, table(COLUMNS, rows))


def read_rearranged(path: Path) -> list[Rearranged]:
    """``rearranged.csv`` of an episode's folder; ``LogFormatError`` for anything else."""
    found = list[Rearranged]()
    for row in read_table(path / REARRANGED, COLUMNS):
        time_s, change = row.number(0, 0.0, MAX_S), row.one_of(2, CHANGES)
        before, after = row.pose(3), row.pose(6)
        if found and time_s < found[-1].time_s:
            raise row.error(f"time_s must not go back from {found[-1].time_s:g}, got {time_s:g}")
        if (before is None) != (change == "brought in") or (after is None) != (change == "removed"):
            raise row.error(f"{change!r} does not go with these poses: {row.words[3:]!r:.80}")
        found.append(
            Rearranged(time_s=time_s, name=row.word(1), change=change, before=before, after=after)
        )
    return found
