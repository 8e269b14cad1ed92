# SPDX-License-Identifier: Apache-2.0
"""How every figure of the report looks, and a figure as SVG that sits in the page."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from scripts import figures

Point = tuple[float, float, float, float]
"""x, value, and the ends of its interval; NaN for what is not there."""

INK, MUTED, RULE = "#20242c", "#6b7280", "#d9dce1"
TRUTH = figures.COLORS["truth"]
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
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


def marker(slam: str, slams: Sequence[str]) -> str:
    """One marker per SLAM, for those who print in black or see colours otherwise."""
    return _MARKERS[list(slams).index(slam) % len(_MARKERS)]


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


def apart(slam: str, slams: Sequence[str], levels: Sequence[float]) -> float:
    """How far beside a level a SLAM is drawn, so that intervals do not hide each other."""
    span = max(levels) - min(levels) or 1.0
    gap = 0.02 * span * min(1.0, 4.0 / max(len(levels) - 1, 1), 6.0 / len(slams))
    return gap * (list(slams).index(slam) - 0.5 * (len(slams) - 1))


def line(ax: Axes, points: Sequence[Point], color: str, mark: str, label: str = "") -> None:
    """Values with their intervals; a cross at the top stands for an infinite one."""
    shown = [(x, value) for x, value, _, _ in points if math.isfinite(value)]
    ax.plot([x for x, _ in shown], [y for _, y in shown], color=color, marker=mark, ms=5.0, lw=1.6,
            mec="white", mew=0.6, zorder=3, label=label)  # fmt: skip
    for x, value, low, high in points:
        if math.isfinite(low) and high == math.inf:  # past the axes, which do not grow for it
            bar = Line2D([x, x], [low, 1e12], color=color, lw=3.2, alpha=0.3, zorder=2)
            bar.set_clip_path(ax.patch)
            ax.add_artist(bar)
        elif math.isfinite(low) and math.isfinite(high):
            ax.plot([x, x], [low, high], color=color, lw=3.2, alpha=0.3, solid_capstyle="round",
                    zorder=2)  # fmt: skip
        if value == math.inf:
            ax.plot([x], [0.99], marker="x", ms=7, mew=1.8, color=color, clip_on=False,
                    transform=ax.get_xaxis_transform())  # fmt: skip


def level_axis(ax: Axes, levels: Sequence[float], axis: str = "dynamism") -> None:
    """What the levels are of, a tick for each level."""
    ax.set_xlabel(axis)
    ax.set_xticks(levels)
    ax.set_xticklabels([f"{level:g}" for level in levels])


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
