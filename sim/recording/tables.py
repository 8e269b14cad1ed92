# SPDX-License-Identifier: Apache-2.0
"""Tables of truth, CSV: written by our own writers, read as what anybody may have written.

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
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes.scene import Pose
from sim.actors.rearranging import Rearrangement, is_out
from slam import se2
from slam.bounded import text_of
from slam.errors import LogFormatError
from slam.files import cell_of, word_of, write_text
from slam.frames import NS_PER_S
from slam.trajectory import Trajectory

MAX_BYTES = 1 << 26  # of a table
MAX_WORD = 200  # characters of a name
MAX_NUMBER = 40  # characters of a number
_DECIMAL = re.compile(r"-?[0-9]+(\.[0-9]+)?([eE][-+]?[0-9]+)?")
MAX_M = 1e6  # of a coordinate, a thousand times as far as what is out of the building
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


class Row:
    """One row as it was read; each reader of a field raises ``LogFormatError`` naming it."""

    def __init__(self, file: Path, line: int, columns: Sequence[str], words: list[str]) -> None:
        self.file, self.line, self.columns, self.words = file, line, columns, words

    def error(self, wrong: str) -> LogFormatError:
        """One that says where."""
        return LogFormatError(self.file, wrong, self.line)

    def word(self, column: int) -> str:
        """A name: one printable line."""
        word = self.words[column]
        if not 0 < len(word) <= MAX_WORD or not word.isprintable():
            wanted = f"1 to {MAX_WORD} printable characters"
            raise self.error(f"{self.columns[column]} must be {wanted}, got {word!r:.80}")
        return word

    def one_of(self, column: int, known: Sequence[str]) -> str:
        """One of these words."""
        word = self.words[column]
        if word not in known:
            wanted = f"one of {', '.join(known)}"
            raise self.error(f"{self.columns[column]} must be {wanted}, got {word!r:.80}")
        return word

    def whole(self, column: int, most: int) -> int:
        """A whole number from 0 to ``most``."""
        word = self.words[column]
        if not (word.isascii() and word.isdigit() and len(word) < 20 and int(word) <= most):
            wanted = f"a whole number from 0 to {most}"
            raise self.error(f"{self.columns[column]} must be {wanted}, got {word!r:.80}")
        return int(word)

    def number(self, column: int, least: float, most: float) -> float:
        """A plain decimal in that range, with a point and an exponent or without."""
        word = self.words[column]
        plain = len(word) <= MAX_NUMBER and _DECIMAL.fullmatch(word)
        value = float(word) if plain else math.nan
        if not least <= value <= most:  # neither is NaN
            wanted = f"a number from {least:g} to {most:g}"
            raise self.error(f"{self.columns[column]} must be {wanted}, got {word!r:.80}")
        return value

    def pose(self, first: int) -> Pose | None:
        """The three fields from ``first`` on."""
        if not any(self.words[first : first + 3]):
            return None
        x, y, heading = (self.number(first + k, -MAX_M, MAX_M) for k in range(3))
        return x, y, heading


def read_table(file: Path, columns: Sequence[str]) -> Iterator[Row]:
    """The rows of a file with these columns; ``LogFormatError`` for anything else."""
    reader = csv.reader(io.StringIO(text_of(file, MAX_BYTES), newline=""), strict=True)
    try:
        if next(reader, None) != list(columns):
            raise LogFormatError(file, f"expected the columns {', '.join(columns)}", 1)
        for words in reader:
            row = Row(file, reader.line_num, columns, [word_of(cell) for cell in words])
            if len(words) != len(columns):
                raise row.error(f"expected {len(columns)} fields, got {len(words)}")
            yield row
    except csv.Error as error:
        raise LogFormatError(file, f"no table: {error}", reader.line_num) from error


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
