# SPDX-License-Identifier: Apache-2.0
"""Degradation curves: a metric against the level, a line with its interval for each SLAM."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from scripts.comparison.tables import number
from scripts.figures import log_axis
from scripts.metrics.row import Metric
from scripts.metrics.table import METRICS
from scripts.report import style
from scripts.report.study import LEAST_RUNS, Study

WIDTH, HEIGHT = 4.0, 2.8  # inches


def curve(study: Study, scene: str, key: str) -> str:
    """The SVG of one scene and metric: medians (shares), 95 % intervals, single runs as dots."""
    metric = METRICS[key]
    figure = style.new_figure(WIDTH, HEIGHT)
    with style.styled():
        ax = figure.subplots()
        for slam in study.slams:
            _line(ax, study, scene, slam, metric)
        _axes(ax, study, metric)
    return style.svg(figure, f"{metric.name} against {study.axis} in {scene}")


def _line(ax: Axes, study: Study, scene: str, slam: str, metric: Metric) -> None:
    color = style.color(slam, study.slams)
    at = style.apart(slam, study.slams, study.levels)
    points = []
    for level in study.levels:
        row = study.level(scene, level, slam, metric.key)
        if row is not None:
            value, low, high = (_times(row[k], metric.factor) for k in ("value", "low", "high"))
            if row["n"] < LEAST_RUNS:  # too few for an interval
                low = high = math.nan
            points.append((level + at, value, low, high))
        if metric.key != "lost":
            values = [number(run, metric.key) for run in study.runs(scene, level, slam)]
            shown = [v * metric.factor for v in values if v is not None and math.isfinite(v)]
            ax.plot([level + at] * len(shown), shown, ".", color=color, ms=3.4, alpha=0.4, mew=0,
                    zorder=1)  # fmt: skip
    style.line(ax, points, color, style.marker(slam, study.slams))


def _times(value: float | None, factor: float) -> float:
    return math.nan if value is None else value * factor


def _axes(ax: Axes, study: Study, metric: Metric) -> None:
    ax.set_ylabel(metric.heading)
    style.level_axis(ax, study.levels, study.axis)
    if metric.key == "nees_over_3":
        ax.axhline(1.0, color=style.TRUTH, lw=1.0, ls="--", zorder=0)
        style.remark(ax, 1.0, "honest", style.TRUTH)
    if metric.log:
        log_axis(ax)
    else:
        ax.set_ylim(bottom=0.0, top=100.0 if metric.shown == "%" else None)
        ax.yaxis.set_major_locator(MaxNLocator(5))
