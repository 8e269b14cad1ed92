# SPDX-License-Identifier: Apache-2.0
"""How every figure of the report looks, and a figure as SVG that sits in the page."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts import figures

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
