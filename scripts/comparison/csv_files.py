# SPDX-License-Identifier: Apache-2.0
"""Tables as CSV files, written so that they read back, and read by the rules of their columns."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.comparison.rules import Table
from sim.recording.sums import check_vouched
from slam.bounded import text_of
from slam.errors import InvalidValueError, LogFormatError
from slam.files import cell_of, write_text

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
    path: Path, rows: Sequence[Mapping[str, Any]], table: Table, axis: str = "dynamism"
) -> None:
    """The same by the rules of the table; ``InvalidValueError`` for rows that break one."""
    rules = table.at(axis)
    for number, row in enumerate(rows, 1):
        for column, rule in rules.items():
            value = row.get(column)
            if isinstance(value, float) and math.isnan(value):
                value = None
            if not rule.holds(value):
                raise InvalidValueError(
                    f"{path.name}, row {number}: {column} must be {rule.wanted}, got {value!r:.80}"
                )
        if said := table.impossible(row):
            raise InvalidValueError(f"{path.name}, row {number}: {said}")
    write_csv(path, rows, tuple(table.columns), axis)


def read_csv(
    path: Path, table: Table, axis: str = "dynamism", *, vouched: bool = False
) -> list[Row]:
    """The rows of a table by its rules, empty cells as None; columns that it has not are not read.

    axis     as in ``write_csv``
    vouched  its hash has been checked; else by whatever SHA256SUMS lists it

    Raises ``LogFormatError`` that names line and column, the cell and what it must be.
    """
    if not vouched:
        check_vouched(path)
    lines = csv.reader(io.StringIO(text_of(path, MAX_BYTES), newline=""), strict=True)
    names = {column: axis if column == "dynamism" else column for column in table.columns}
    found: dict[tuple[Any, ...], Row] = {}
    try:
        for row in _rows(path, lines, table, names):
            if found.setdefault(tuple(row[column] for column in table.key), row) is not row:
                told = ", ".join(f"{names[column]} {row[column]!s:.80}" for column in table.key)
                raise LogFormatError(path, f"a second row of {told}", lines.line_num)
    except csv.Error as error:
        raise LogFormatError(path, f"no table: {error}", lines.line_num) from error
    return list(found.values())


def _rows(path: Path, lines: Any, table: Table, names: Mapping[str, str]) -> Iterator[Row]:
    head: list[str] = next(lines, [])
    for name in names.values():
        if head.count(name) != 1:
            many = "more than one column" if name in head else "a table without the column"
            raise LogFormatError(path, f"{many} {name!r}", 1)
    rules = table.at(names.get("dynamism", ""))
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
        if said := table.impossible(row):
            raise LogFormatError(path, said, lines.line_num)
        yield row
