# SPDX-License-Identifier: Apache-2.0
"""Closed-loop results (``mobilia drive``) as a table of the report."""

from __future__ import annotations

from scripts.closed_loop.folder import Driven
from scripts.comparison.csv_files import Row
from scripts.metrics.row import digits
from scripts.pages.page import Cell, Table
from scripts.report.answer import percent
from scripts.report.curves import PRECISION, SUCCESS, few_goals


def table(drive: Driven) -> Table:
    """A row for each SLAM and level."""
    rows = [
        [
            Cell(text=str(row["slam"])),
            Cell(text=f"{row['dynamism']:g}"),
            Cell(
                text=f"{row['reached']:g} of {row['goals']:g}",
                small=_interval(row),
            ),
            *(Cell(text=f"{row[key]:g}") for key in ("wrong", "given_up", "failed")),
            _precision(row),
            *(_number(row[key]) for key in ("time_s", "collisions_per_km", "near_misses_per_km")),
            _lost(row),
        ]
        for slam in drive.slams
        for row in drive.of(slam)
    ]  # fmt: skip
    head = ["SLAM", drive.axis, "reached", "wrong", "given up", "failed", "precision, cm",
            "time, s", "collisions per km", "near misses per km", "runs lost"]  # fmt: skip
    return Table(caption=drive.scene, head=head, rows=rows)


def _interval(row: Row) -> str:
    if few_goals(row, SUCCESS):
        return ""
    return f"{100.0 * row['success_low']:.0f} to {100.0 * row['success_high']:.0f} %"


def _lost(row: Row) -> Cell:
    interval = percent(int(row["runs_lost"]), int(row["runs"]))
    recovered = f"{row['runs_recovered']:g} recovered"
    return Cell(
        text=f"{row['runs_lost']:g} of {row['runs']:g}",
        small=f"{interval}\n{recovered}" if interval else recovered,
    )


def _precision(row: Row) -> Cell:
    low, high = (row[key] for key in PRECISION[1:])
    small = ""
    if not few_goals(row, PRECISION) and low is not None and high is not None:
        small = f"{digits(100 * low)} to {digits(100 * high)}"
    return Cell(text=_number(row["precision_m"], 100.0).text, small=small)


def _number(value: float | None, factor: float = 1.0) -> Cell:
    return Cell(text="–" if value is None else digits(value * factor))
