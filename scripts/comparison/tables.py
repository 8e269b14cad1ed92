# SPDX-License-Identifier: Apache-2.0
"""Tables of runs: what sums them up, and the CSV files that they are written to and read from."""

import csv
import io
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, TypeVar

from scripts.comparison.rules import Table
from scripts.comparison.schema import FAILED
from scripts.metrics.table import JUDGED, MEDIANS, METRICS, SHARES
from sim.recording.sums import check_vouched
from slam.bounded import text_of
from slam.errors import InvalidValueError, LogFormatError
from slam.evaluation.statistics import median_interval, paired, quantile, share_interval
from slam.files import cell_of, write_text

Row = dict[str, Any]
R = TypeVar("R", bound=Mapping[str, Any])
MAX_BYTES = 1 << 29  # of a table: half a million rows of runs.csv


def number(row: Row, metric: str) -> float | None:
    """A cell as a number: infinite for the error of a SLAM that failed, None where it is empty."""
    value = row.get(metric)
    if value is None and row["outcome"] in FAILED and METRICS[metric].worst_if_failed:
        return math.inf
    return None if value is None or math.isnan(value) else float(value)


def levels(rows: Sequence[Row]) -> list[Row]:
    """Median, interval and quartiles of each metric; of losses the share."""

    def summed(metric: str, group: Sequence[Row]) -> Row:
        values = [v for v in (number(row, metric) for row in group) if v is not None]
        if metric in SHARES or not values:
            return share_of(round(sum(values)), len(values))
        quartiles = {"q25": quantile(values, 0.25), "q75": quantile(values, 0.75)}
        return median_of(values) | quartiles

    return summary(rows, ("scene", "dynamism", "slam"), (*SHARES, *MEDIANS), summed)


def summary(
    rows: Sequence[R],
    keys: Sequence[str],
    metrics: Iterable[str],
    summed: Callable[[str, list[R]], Row],
) -> list[Row]:
    """A row of each metric for the rows of each key; none where ``summed`` makes none of them."""
    return [
        {**dict(zip(keys, key, strict=True)), "metric": metric, **found}
        for key, group in grouped(rows, keys).items()
        for metric in metrics
        if (found := summed(metric, group))
    ]


def share_of(hits: int, n: int) -> Row:
    """So many of ``n`` in the columns of a summary, with Wilson's 95 % interval; {} of none."""
    if n == 0:
        return {}
    low, high = share_interval(hits, n)
    return {"statistic": "share", "n": n, "value": hits / n, "low": low, "high": high}


def median_of(values: Sequence[float]) -> Row:
    """The median in the columns of a summary, with its 95 % bootstrap interval; {} of none."""
    if not values:
        return {}
    low, high = median_interval(values)
    value = quantile(values, 0.5)
    return {"statistic": "median", "n": len(values), "value": value, "low": low, "high": high}


def pairs(rows: Sequence[Row]) -> list[Row]:
    """Every two SLAMs on the runs where both have the number."""
    out = []
    slams = list(dict.fromkeys(row["slam"] for row in rows))
    for (scene, dynamism), group in grouped(rows, ("scene", "dynamism")).items():
        for metric in JUDGED:
            for slam_a, slam_b in combinations(slams, 2):
                a, b = (by_seed(group, slam, metric) for slam in (slam_a, slam_b))
                seeds = sorted(a.keys() & b.keys())
                if not seeds:
                    continue
                both = ([a[seed] for seed in seeds], [b[seed] for seed in seeds])
                head = {"scene": scene, "dynamism": dynamism, "metric": metric}
                head |= {"slam_a": slam_a, "slam_b": slam_b}
                out.append(head | paired(*both, less_is_better=METRICS[metric].better == "less"))
    return out


def by_seed(rows: Sequence[Row], slam: str, metric: str) -> dict[int, float]:
    """The runs of one SLAM that have the number."""
    pairs = ((row["seed"], number(row, metric)) for row in rows if row["slam"] == slam)
    return {seed: value for seed, value in pairs if value is not None}


def grouped(rows: Iterable[R], keys: Sequence[str]) -> dict[tuple[Any, ...], list[R]]:
    """Rows by what they have in these columns, in the order in which that comes."""
    groups: dict[tuple[Any, ...], list[R]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return groups


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
    for number, row in enumerate(rows, 1):
        try:
            table.row(row, axis)
        except InvalidValueError as error:
            raise InvalidValueError(f"{path.name}, row {number}: {error}") from error
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
    places = {column: head.index(name) for column, name in names.items()}
    for line in lines:
        if len(line) != len(head):
            raise LogFormatError(
                path, f"must have {len(head)} cells, got {len(line)}", lines.line_num
            )
        cells = {column: line[place] for column, place in places.items()}
        try:
            yield table.row(cells, names.get("dynamism", ""))
        except InvalidValueError as error:
            raise LogFormatError(path, str(error), lines.line_num) from error
