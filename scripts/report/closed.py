# SPDX-License-Identifier: Apache-2.0
"""Closed-loop results (``mobilia drive``) as a part of the report."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.ticker import MaxNLocator

from scripts.closed_loop.folder import Driven
from scripts.comparison.csv_files import Row
from scripts.metrics.row import digits
from scripts.report import style
from scripts.report.answer import percent
from scripts.report.curves import HEIGHT, WIDTH
from scripts.report.study import LEAST_RUNS
from scripts.report.tables import Cell, Table

SUCCESS = ("success", "success_low", "success_high")
PRECISION = ("precision_m", "precision_m_low", "precision_m_high")
_OF = {SUCCESS: ("goals",), PRECISION: ("reached", "wrong")}  # whose sum each is of


def curves(drive: Driven, slams: Sequence[str]) -> list[tuple[str, str]]:
    """(name, SVG) of goals reached and of precision against the level; ``slams`` give colours."""
    return [
        ("goals reached", _curve(drive, slams, SUCCESS, "goals truly reached, %")),
        ("precision", _curve(drive, slams, PRECISION, "distance from the goal, cm")),
    ]


def _curve(drive: Driven, slams: Sequence[str], keys: tuple[str, str, str], label: str) -> str:
    figure = style.new_figure(WIDTH, HEIGHT)
    with style.styled():
        ax = figure.subplots()
        for slam in drive.slams:
            at = style.apart(slam, drive.slams, drive.levels)
            points = []
            for row in drive.of(slam):
                value, low, high = (_percent(row[key]) for key in keys)
                if _few(row, keys):
                    low = high = math.nan
                points.append((row["dynamism"] + at, value, low, high))
            style.line(ax, points, style.color(slam, slams), style.marker(slam, slams))
        ax.set_ylabel(label)
        ax.set_ylim(0.0, 103.0 if keys == SUCCESS else None)
        ax.yaxis.set_major_locator(MaxNLocator(5))
        style.level_axis(ax, drive.levels, drive.axis)
    return style.svg(figure, f"{label} against {drive.axis} in {drive.scene}")


def _percent(value: float | None) -> float:
    """Shares in percent as metres in centimetres."""
    return math.nan if value is None else 100.0 * value


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


def _few(row: Row, keys: tuple[str, str, str]) -> bool:
    """Whether it is of too few goals for an interval."""
    return sum(float(row[column]) for column in _OF[keys]) < LEAST_RUNS


def _interval(row: Row) -> str:
    if _few(row, SUCCESS):
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
    if not _few(row, PRECISION) and low is not None and high is not None:
        small = f"{digits(100 * low)} to {digits(100 * high)}"
    return Cell(text=_number(row["precision_m"], 100.0).text, small=small)


def _number(value: float | None, factor: float = 1.0) -> Cell:
    return Cell(text="–" if value is None else digits(value * factor))
