# SPDX-License-Identifier: Apache-2.0
"""Degradation curves: a metric against dynamism, a line with its interval for each SLAM."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from scripts.compare.tables import number
from scripts.report import style
from scripts.report.metrics import METRICS, Metric
from scripts.report.study import Row, Study

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
    return style.svg(figure, f"{metric.name} against dynamism in {scene}")


def _line(ax: Axes, study: Study, scene: str, slam: str, metric: Metric) -> None:
    color, mark = style.color(slam, study.slams), style.marker(slam, study.slams)
    at = _offset(study, slam)
    points: list[tuple[float, Row]] = []
    for level in study.levels:
        row = study.level(scene, level, slam, metric.key)
        if row is not None:
            points.append((level + at, row))
        if metric.key != "lost":
            _dots(ax, study, scene, level, slam, metric, at, color)
    shown = [(x, row) for x, row in points if _finite(row["value"])]
    values = [row["value"] * metric.factor for _, row in shown]
    ax.plot([x for x, _ in shown], values, color=color, marker=mark, ms=5.0, lw=1.6,
            mec="white", mew=0.6, zorder=3)  # fmt: skip
    whole = [(x, row) for x, row in shown if _finite(row["low"]) and _finite(row["high"])]
    for x, row in whole:
        ends = [row["low"] * metric.factor, row["high"] * metric.factor]
        ax.plot([x, x], ends, color=color, lw=3.2, alpha=0.3, solid_capstyle="round", zorder=2)
    for x, row in points:
        if row["value"] == math.inf:  # most of its runs failed
            ax.plot([x], [0.99], marker="x", ms=7, mew=1.8, color=color, clip_on=False,
                    transform=ax.get_xaxis_transform())  # fmt: skip


def _offset(study: Study, slam: str) -> float:
    """Beside one another, so that intervals do not hide each other."""
    span = max(study.levels) - min(study.levels) or 1.0
    gap = 0.02 * span * min(1.0, 4.0 / max(len(study.levels) - 1, 1))
    return gap * (study.slams.index(slam) - 0.5 * (len(study.slams) - 1))


def _dots(
    ax: Axes, study: Study, scene: str, level: float, slam: str, metric: Metric, at: float,
    color: str,
) -> None:  # fmt: skip
    values = [number(row, metric.key) for row in study.runs(scene, level, slam)]
    shown = [v * metric.factor for v in values if v is not None and math.isfinite(v)]
    ax.plot([level + at] * len(shown), shown, ".", color=color, ms=3.4, alpha=0.4, mew=0, zorder=1)


def _finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def _axes(ax: Axes, study: Study, metric: Metric) -> None:
    ax.set_xlabel("dynamism")
    ax.set_ylabel(metric.heading)
    ax.set_xticks(study.levels)
    ax.set_xticklabels([f"{level:g}" for level in study.levels])
    if metric.key == "nees_over_3":
        ax.axhline(1.0, color=style.TRUTH, lw=1.0, ls="--", zorder=0)
        style.remark(ax, 1.0, "honest", style.TRUTH)
    if metric.log:
        style.log_axis(ax)
    else:
        ax.set_ylim(bottom=0.0, top=100.0 if metric.unit == "%" else None)
        ax.yaxis.set_major_locator(MaxNLocator(5))
