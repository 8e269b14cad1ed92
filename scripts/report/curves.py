# SPDX-License-Identifier: Apache-2.0
"""Degradation curves: a number against the level, a line with its intervals for each SLAM."""

import io
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from scripts import figures
from scripts.closed_loop.tables import Driven
from scripts.comparison.tables import Row, number
from scripts.figures import log_axis
from scripts.metrics.table import METRICS, Metric
from scripts.report.study import LEAST_RUNS, Study

INK, MUTED, RULE = "#20242c", "#6b7280", "#d9dce1"
TRUTH = figures.COLORS["truth"]
_GLYPHS = ("●", "■", "▲", "◆", "▼", "✚", "✖")
_RC: dict[str, Any] = {
    "font.family": "sans-serif", "font.size": 9.0, "axes.labelsize": 9.0, "axes.titlesize": 9.5,
    "axes.titleweight": "bold", "axes.titlelocation": "left", "axes.edgecolor": MUTED,
    "axes.labelcolor": INK, "text.color": INK, "xtick.color": MUTED, "ytick.color": MUTED,
    "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.7,
    "axes.grid": True, "axes.grid.axis": "y", "grid.color": RULE, "grid.linewidth": 0.6,
    "axes.axisbelow": True, "legend.frameon": False,
    "svg.fonttype": "none", "svg.hashsalt": "mobilia", "axes.unicode_minus": True,
}  # fmt: skip


def color(slam: str, slams: Sequence[str]) -> str:
    """One colour per SLAM, the same as in every figure of a run."""
    return figures.color_of(slam, slams)


def glyph(slam: str, slams: Sequence[str]) -> str:
    """That marker as a letter."""
    return _GLYPHS[list(slams).index(slam) % len(_GLYPHS)]


def new_figure(width: float, height: float, *, margins: bool = True) -> Figure:
    """Inches of 96 pixels; save it with ``svg``, under the same style."""
    with mpl.rc_context(_RC):
        figure = Figure(figsize=(width, height), layout="constrained" if margins else None)
        figure.patch.set_alpha(0.0)
        return figure


def styled() -> Any:
    """The context in which axes are made and drawn."""
    return mpl.rc_context(_RC)


def remark(ax: Axes, y: float, words: str, tint: str) -> None:
    """Small words at the right end of a horizontal line, outside."""
    ax.annotate(words, (1.0, y), xycoords=("axes fraction", "data"), xytext=(3, 0),
                textcoords="offset points", va="center", color=tint, fontsize=8)  # fmt: skip


def svg(figure: Figure, title: str) -> str:
    """The figure as an ``<svg>`` element: scales with the page, its text is text."""
    written = io.StringIO()
    with styled():
        figure.savefig(written, format="svg", metadata={"Date": None, "Creator": None})
    text = written.getvalue()
    text = text[text.index("<svg") :].rstrip()
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
    escaped = title.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    return text.replace("<svg ", f'<svg role="img" aria-label="{escaped}" ', 1)


WIDTH, HEIGHT = 4.0, 2.8  # inches
SUCCESS = ("success", "success_low", "success_high")
PRECISION = ("precision_m", "precision_m_low", "precision_m_high")
_OF = {SUCCESS: ("goals",), PRECISION: ("reached", "wrong")}  # whose sum each is of
Lines = Mapping[str, Sequence[figures.Point]]
"""By SLAM, its points at the levels."""


def curve(study: Study, scene: str, key: str) -> str:
    """The SVG of one scene and metric: medians (shares), 95 % intervals, single runs as dots."""
    metric = METRICS[key]
    lines = {slam: _points(study, scene, slam, metric) for slam in study.slams}
    figure = new_figure(WIDTH, HEIGHT)
    with styled():
        ax = figure.subplots()
        if metric.key != "lost":
            _runs(ax, study, scene, metric)
        _draw(ax, lines, study.levels, study.axis, study.slams)
        _y_axis(ax, metric)
    return svg(figure, f"{metric.name} against {study.axis} in {scene}")


def of_drive(drive: Driven, slams: Sequence[str]) -> list[tuple[str, str]]:
    """(name, SVG) of goals reached and of precision against the level; ``slams`` give colours."""
    return [
        ("goals reached", _of_drive(drive, slams, SUCCESS, "goals truly reached, %")),
        ("precision", _of_drive(drive, slams, PRECISION, "distance from the goal, cm")),
    ]


def _of_drive(drive: Driven, slams: Sequence[str], keys: tuple[str, str, str], label: str) -> str:
    lines = {
        slam: [_point(row, keys, 100.0, few=few_goals(row, keys)) for row in drive.of(slam)]
        for slam in drive.slams
    }
    figure = new_figure(WIDTH, HEIGHT)
    with styled():
        ax = figure.subplots()
        _draw(ax, lines, drive.levels, drive.axis, slams)
        ax.set_ylabel(label)
        ax.set_ylim(0.0, 103.0 if keys == SUCCESS else None)
        ax.yaxis.set_major_locator(MaxNLocator(5))
    return svg(figure, f"{label} against {drive.axis} in {drive.scene}")


def few_goals(row: Row, keys: tuple[str, str, str]) -> bool:
    """Whether it is of too few goals for an interval."""
    return sum(float(row[column]) for column in _OF[keys]) < LEAST_RUNS


def _draw(ax: Axes, lines: Lines, levels: Sequence[float], axis: str, slams: Sequence[str]) -> None:
    """Each SLAM's line a little beside the level, in its colour and mark among ``slams``."""
    for slam, points in lines.items():
        aside = figures.apart(slam, list(lines), levels)
        moved = [(at + aside, value, low, high) for at, value, low, high in points]
        figures.line(ax, moved, color(slam, slams), figures.marker(slam, slams))
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
            ax.plot([level + aside] * len(shown), shown, ".", color=color(slam, study.slams),
                    ms=3.4, alpha=0.4, mew=0, zorder=1)  # fmt: skip


def _y_axis(ax: Axes, metric: Metric) -> None:
    ax.set_ylabel(metric.heading)
    if metric.key == "nees_over_3":
        ax.axhline(1.0, color=TRUTH, lw=1.0, ls="--", zorder=0)
        remark(ax, 1.0, "honest", TRUTH)
    if metric.log:
        log_axis(ax)
    else:
        ax.set_ylim(bottom=0.0, top=100.0 if metric.shown == "%" else None)
        ax.yaxis.set_major_locator(MaxNLocator(5))
