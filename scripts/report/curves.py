# SPDX-License-Identifier: Apache-2.0
"""Degradation curves: a number against the level, a line with its intervals for each SLAM."""

import math
from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from scripts import figures
from scripts.comparison.tables import Row, number
from scripts.figures import COLORS, SVG, color_of, log_axis, remark, styled, svg
from scripts.metrics.table import Metric
from scripts.report.study import LEAST_RUNS, Study

SIZE = (4.0, 2.8)  # inches, of 96 pixels
Lines = Mapping[str, Sequence[figures.Point]]
"""By SLAM, its points at the levels."""


@styled(SVG)
def curve(study: Study, scene: str, metric: Metric) -> str:
    """The SVG of one scene and metric: medians (shares), 95 % intervals, single runs as dots."""
    lines = {slam: _points(study, scene, slam, metric) for slam in study.slams}
    figure = Figure(figsize=SIZE, layout="constrained")
    ax = figure.subplots()
    if metric.key != "lost":
        _runs(ax, study, scene, metric)
    _draw(ax, lines, study.levels, study.axis, study.slams)
    _y_axis(ax, metric)
    return svg(figure, f"{metric.name} against {study.axis} in {scene}")


def _draw(ax: Axes, lines: Lines, levels: Sequence[float], axis: str, slams: Sequence[str]) -> None:
    """Each SLAM's line a little beside the level, in its colour and mark among ``slams``."""
    for slam, points in lines.items():
        aside = figures.apart(slam, list(lines), levels)
        moved = [(at + aside, value, low, high) for at, value, low, high in points]
        figures.line(ax, moved, color_of(slam, slams), figures.marker(slam, slams))
    figures.level_axis(ax, levels, axis)


def _points(study: Study, scene: str, slam: str, metric: Metric) -> list[figures.Point]:
    rows = (study.level(scene, level, slam, metric.key) for level in study.levels)
    keys = ("value", "low", "high")
    return [
        _point({**row, "dynamism": level}, keys, metric.factor, few=row["n"] < LEAST_RUNS)
        for level, row in zip(study.levels, rows, strict=True)
        if row is not None
    ]


def _point(row: Row, keys: tuple[str, str, str], factor: float, *, few: bool) -> figures.Point:
    """Level, value and the ends of its interval, which one of too few has not."""
    value, low, high = (math.nan if row[k] is None else row[k] * factor for k in keys)
    return row["dynamism"], value, *((math.nan, math.nan) if few else (low, high))


def _runs(ax: Axes, study: Study, scene: str, metric: Metric) -> None:
    """Single runs as dots."""
    for slam in study.slams:
        aside = figures.apart(slam, study.slams, study.levels)
        for level in study.levels:
            values = [number(run, metric.key) for run in study.runs(scene, level, slam)]
            shown = [v * metric.factor for v in values if v is not None and math.isfinite(v)]
            ax.plot([level + aside] * len(shown), shown, ".", color=color_of(slam, study.slams),
                    ms=3.4, alpha=0.4, mew=0, zorder=1)  # fmt: skip


def _y_axis(ax: Axes, metric: Metric) -> None:
    ax.set_ylabel(metric.heading)
    if metric.key == "nees_over_3":
        ax.axhline(1.0, color=COLORS["truth"], lw=1.0, ls="--", zorder=0)
        remark(ax, 1.0, "honest", COLORS["truth"])
    if metric.log:
        log_axis(ax)
    else:
        ax.set_ylim(bottom=0.0, top=100.0 if metric.shown == "%" else None)
        ax.yaxis.set_major_locator(MaxNLocator(5))
