# SPDX-License-Identifier: Apache-2.0
"""The tables of the report, as heads and rows of cells."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from scripts.comparison.tables import FAILED
from scripts.metrics.row import Metric, digits
from scripts.metrics.table import METRICS
from scripts.report.study import Row, Study, verdict

OUTCOMES = ("finished", "lost", *FAILED)
_MARKS = {1: "better", -1: "worse", 0: ""}


@dataclass(frozen=True, kw_only=True)
class Cell:
    """``text`` with ``small`` print after it; ``mark`` is "better", "worse", "best" or ""."""

    text: str
    small: str = ""
    mark: str = ""


@dataclass(frozen=True, kw_only=True)
class Table:
    """``slams`` are the heads that name one, for its colour; the first column names the row."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    slams: Sequence[str] = field(default_factory=tuple)


def of_levels(study: Study, scene: str, metric: Metric) -> Table:
    """A row for each level, a column for each SLAM that has it: median (share), 95 % interval."""
    slams = [
        slam
        for slam in study.slams
        if any(study.level(scene, level, slam, metric.key) for level in study.levels)
    ]
    rows = []
    for level in study.levels:
        found = [study.level(scene, level, slam, metric.key) for slam in slams]
        best = _best(found, metric)
        cells = [Cell(text=f"{level:g}")]
        for row in found:
            mark = "best" if row is not None and row["value"] == best else ""
            cells.append(_value(row, metric, mark))
        rows.append(cells)
    return Table(caption=metric.heading, head=[study.axis, *slams], rows=rows, slams=slams)


def _best(rows: Sequence[Row | None], metric: Metric) -> float | None:
    values = [float(row["value"]) for row in rows if row is not None]
    if len(values) < 2 or metric.less_is_better is None or len(set(values)) == 1:
        return None
    return min(values) if metric.less_is_better else max(values)


def _value(row: Row | None, metric: Metric, mark: str = "") -> Cell:
    if row is None:
        return Cell(text="–")
    ends = (row["low"], row["high"])
    interval = "" if ends == (math.inf, math.inf) else " to ".join(map(metric.show, ends))
    return Cell(text=metric.show(row["value"]), small=interval, mark=mark)


def of_pairs(study: Study, scene: str, metric: Metric) -> Table:
    """Ours against each rival at each level: median difference, interval, wins-ties-losses."""
    rows = []
    for level in study.levels:
        cells = [Cell(text=f"{level:g}")]
        for rival in study.rivals:
            row = study.pair(scene, level, metric.key, study.ours, rival)
            cells.append(_difference(row, metric))
        rows.append(cells)
    return Table(
        caption=f"{metric.heading}: {study.ours} minus …",
        head=[study.axis, *study.rivals],
        rows=rows,
        slams=study.rivals,
    )


def _difference(row: Row | None, metric: Metric) -> Cell:
    if row is None:
        return Cell(text="–")
    ends = [metric.show(row[end], sign=True) for end in ("low", "high")]
    score = f"{row['wins']:g}–{row['ties']:g}–{row['losses']:g}"
    return Cell(
        text=metric.show(row["median_difference"], sign=True),
        small=f"{ends[0]} to {ends[1]}\n{score}",
        mark=_MARKS[verdict(row, bool(metric.less_is_better))],
    )


def of_outcomes(study: Study, scene: str) -> Table:
    """How the runs of each SLAM ended, a column for each level."""
    rows = []
    for slam in study.slams:
        cells = [Cell(text=slam)]
        for level in study.levels:
            ended = Counter(row["outcome"] for row in study.runs(scene, level, slam))
            fine = ended["finished"]
            rest = [f"{ended[word]} {word}" for word in OUTCOMES[1:] if ended[word]]
            mark = "worse" if rest else ""
            cells.append(Cell(text=f"{fine} of {ended.total()}", small=", ".join(rest), mark=mark))
        rows.append(cells)
    head = [f"finished at {study.axis}", *(f"{level:g}" for level in study.levels)]
    return Table(caption=scene, head=head, rows=rows)


def growth(study: Study, scene: str) -> Table:
    """What the axis does to each SLAM: from the lowest level to the highest."""
    ate, lost = METRICS["ate_unaligned_m"], METRICS["lost"]
    ends = (study.levels[0], study.levels[-1])
    rows = []
    for slam in study.slams:
        found = [study.level(scene, end, slam, ate.key) for end in ends]
        shares = [study.level(scene, end, slam, lost.key) for end in ends]
        ratio = "–"
        if found[0] and found[1] and 0.0 < found[0]["value"] < math.inf:
            ratio = digits(found[1]["value"] / found[0]["value"]) + " ×"
        rows.append([
            Cell(text=slam), *(_value(row, ate) for row in found), Cell(text=ratio),
            *(_count(row) for row in shares),
        ])  # fmt: skip
    head = [f"{ate.name} at {end:g}, {ate.shown}" for end in ends]
    lost_head = [f"{lost.name} at {end:g}" for end in ends]
    caption = f"From {study.axis} {ends[0]:g} to {ends[1]:g}"
    return Table(caption=caption, head=["SLAM", *head, "grows", *lost_head], rows=rows)


def _count(row: Row | None) -> Cell:
    if row is None:
        return Cell(text="–")
    return Cell(text=f"{round(row['value'] * row['n'])} of {row['n']:g}")


def messages(study: Study) -> list[tuple[str, int]]:
    """Error messages of SLAMs that failed, each with its number of runs, most frequent first."""
    said = Counter(str(row["failure"]) for row in study.compared.runs if row["failure"])
    return said.most_common(12)


def costs(study: Study, keys: Sequence[str]) -> Table:
    """A row for each SLAM: medians over all runs' levels, per measure."""
    metrics = [METRICS[key] for key in keys if study.has(key)]
    rows = []
    for slam in study.slams:
        cells = [Cell(text=slam)]
        for metric in metrics:
            found = [
                row["value"]
                for row in study.compared.levels
                if (row["slam"], row["metric"]) == (slam, metric.key)
            ]
            span = f"{metric.show(min(found))} to {metric.show(max(found))}" if found else ""
            middle = sorted(found)[len(found) // 2] if found else None
            cells.append(Cell(text=metric.show(middle), small=span))
        rows.append(cells)
    return Table(
        caption="middle of the medians of all scenes and levels, and their range",
        head=["SLAM", *(metric.heading for metric in metrics)],
        rows=rows,
    )
