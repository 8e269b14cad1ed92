# SPDX-License-Identifier: Apache-2.0
"""``rearranged.csv`` of an episode: what was put elsewhere out of the robot's sight, and when.

A pose that is left empty is out of the building.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenes.scene import Pose
from sim.actors.rearranging import Rearrangement, is_out
from slam.files import write_text

REARRANGED = "rearranged.csv"
_POSE = ("x_m", "y_m", "heading_rad")
COLUMNS = ("time_s", "name", "change", *(f"from_{c}" for c in _POSE), *(f"to_{c}" for c in _POSE))
Rect = tuple[float, float, float, float]


def write_rearranged(path: Path, events: Sequence[Rearrangement], bounds: Rect) -> None:
    """A row for each thing put elsewhere, in order; times in s since the start, poses m, m, rad."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for event in events:
        poses = (*_words(event.before, bounds), *_words(event.after, bounds))
        writer.writerow((f"{event.time_s:.6f}", event.name, event.change, *poses))
    write_text(path, text.getvalue())


def _words(pose: Pose, bounds: Rect) -> tuple[str, ...]:
    if is_out(np.array(pose), bounds):
        return "", "", ""
    return tuple(f"{value:.6f}" for value in pose)
