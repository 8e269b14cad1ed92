# SPDX-License-Identifier: Apache-2.0
"""Tables of truth, CSV: written by our own writers, read as what anybody may have written.

A pose is three fields, x m, y m and heading rad; all three empty: out of the building.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from scenes.scene import Pose
from slam.bounded import text_of
from slam.csv_cells import cell_of, word_of
from slam.errors import LogFormatError

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
