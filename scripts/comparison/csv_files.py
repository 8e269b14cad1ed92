# SPDX-License-Identifier: Apache-2.0
"""Tables as CSV files, written so that they read back, and read by the rules of their columns."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.comparison.schema import Columns, impossible, level_of
from sim.recording.sums import check_vouched
from slam.bounded import text_of
from slam.csv_cells import cell_of
from slam.errors import InvalidValueError, LogFormatError
from slam.files import write_text

MAX_BYTES = 1 << 29  # of a table: half a million rows of runs.csv
Row = dict[str, Any]


def write_csv(
    path: Path, rows: Sequence[Mapping[str, Any]], columns: Sequence[str], axis: str = "dynamism"
) -> None:
    """One line for each row; None and NaN are empty, numbers are written so that they read back.

    axis  how the column "dynamism" is called on file: what the levels are of
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([axis if column == "dynamism" else column for column in columns])
    for row in rows:
        writer.writerow([_cell(row.get(column)) for column in columns])
    write_text(path, text.getvalue())


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return repr(value) if isinstance(value, float) else cell_of(str(value))


def write_checked(
    path: Path, rows: Sequence[Mapping[str, Any]], columns: Columns, axis: str = "dynamism"
) -> None:
    """The same by the rules of the columns; ``InvalidValueError`` for rows that break one."""
    rules = rules_at(columns, axis)
    for number, row in enumerate(rows, 1):
        for column, rule in rules.items():
            value = row.get(column)
            if isinstance(value, float) and math.isnan(value):
                value = None
            if not rule.holds(value):
                raise InvalidValueError(
                    f"{path.name}, row {number}: {column} must be {rule.wanted}, got {value!r:.80}"
                )
        if said := impossible(row):
            raise InvalidValueError(f"{path.name}, row {number}: {said}")
    write_csv(path, rows, tuple(columns), axis)


def rules_at(columns: Columns, axis: str) -> Columns:
    """The rules of columns, that of the level as levels of this axis have it."""
    return {c: level_of(axis) if c == "dynamism" else rule for c, rule in columns.items()}


def read_csv(
    path: Path,
    columns: Columns,
    key: Sequence[str],
    axis: str = "dynamism",
    *,
    vouched: bool = False,
) -> list[Row]:
    """The rows of a table by the rules of its columns, empty cells as None; others are not read.

    key      the columns that name a row, no two of which are the same
    axis     as in ``write_csv``
    vouched  its hash has been checked; else by whatever SHA256SUMS lists it

    Raises ``LogFormatError`` that names line and column, the cell and what it must be.
    """
    if not vouched:
        check_vouched(path)
    lines = csv.reader(io.StringIO(text_of(path, MAX_BYTES), newline=""), strict=True)
    names = {column: axis if column == "dynamism" else column for column in columns}
    found: dict[tuple[Any, ...], Row] = {}
    try:
        for row in _rows(path, lines, rules_at(columns, axis), names):
            if found.setdefault(tuple(row[column] for column in key), row) is not row:
                told = ", ".join(f"{names[column]} {row[column]!s:.80}" for column in key)
                raise LogFormatError(path, f"a second row of {told}", lines.line_num)
    except csv.Error as error:
        raise LogFormatError(path, f"no table: {error}", lines.line_num) from error
    return list(found.values())


def _rows(path: Path, lines: Any, rules: Columns, names: Mapping[str, str]) -> Iterator[Row]:
    head: list[str] = next(lines, [])
    for name in names.values():
        if head.count(name) != 1:
            many = "more than one column" if name in head else "a table without the column"
            raise LogFormatError(path, f"{many} {name!r}", 1)
    places = {column: head.index(name) for column, name in names.items()}
    for line in lines:
        if len(line) != len(head):
            raise LogFormatError(
                path, f"must have {len(head)} cells, got {len(line)}", lines.line_num
            )
        row: Row = {}
        for column, rule in rules.items():
            cell = line[places[column]]
            row[column] = None if cell == "" else rule.parsed(cell)
            if not rule.holds(row[column]):
                raise LogFormatError(
                    path,
                    f"column {names[column]!r} must be {rule.wanted}, got {cell!r:.80}",
                    lines.line_num,
                )
        if said := impossible(row):
            raise LogFormatError(path, said, lines.line_num)
        yield row
