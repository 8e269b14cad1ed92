# SPDX-License-Identifier: Apache-2.0
"""The share of lost runs against the level, over the tracks that count: one picture."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.benchmark.scores import Row
from scripts.figures import save, styled
from scripts.report.answer import ODOMETRY
from slam.variants import ORACLE

PERCENT = 100.0
APART = 4.2  # percent between two names at the ends of their lines
_COLORS = ("#ce2c3c", "#1f61be", "#7a3fb0", "#0b8c96", "#8c6d1f", "#5d8a1e", "#b8418f", "#2f9fd0",
           "#a0583c", "#3b2f7d", "#59616e", "#de6e18")  # fmt: skip
_CONTROL = "#9a9a9a"
_MARKERS = "osD^vP*Xh<>d"


def _look(slam: str, k: int) -> dict[str, Any]:
    if slam.startswith(ORACLE):
        return {"color": "#202020", "ls": "--", "marker": "", "lw": 1.6}
    if slam == ODOMETRY:
        return {"color": _CONTROL, "ls": ":", "marker": "", "lw": 1.6}
    wide = 2.4 if slam == "shunting" else 1.4
    return {"color": _COLORS[k % len(_COLORS)], "ls": "-", "lw": wide, "ms": 4.5, "mec": "white",
            "mew": 0.5, "marker": _MARKERS[k % len(_MARKERS)]}  # fmt: skip


@styled({"grid.alpha": 0.3})
def overall(ranked: Sequence[Row], title: str, path: Path) -> None:
    """Of rows of ``scores.ranking`` the shares lost, each SLAM named at the end of its line."""
    figure = Figure(figsize=(8.2, 4.6))
    ax: Axes = figure.subplots()
    levels = [float(level) for level in ranked[0]["levels"]]
    named = sorted((row["slam"] for row in ranked), key=lambda slam: (slam != "shunting", slam))
    last, right = levels[-1], 0.03 * (levels[-1] - levels[0])
    places = spread([PERCENT * row["lost_shares"][-1] for row in ranked])
    for row, at in zip(ranked, places, strict=True):
        shares = [PERCENT * share for share in row["lost_shares"]]
        look = _look(row["slam"], named.index(row["slam"]))
        ax.plot(levels, shares, **look)
        ax.plot([last, last + right], [shares[-1], at], color=look["color"], lw=0.6, clip_on=False)
        ax.text(last + 1.3 * right, at, f"{row['slam']}  {shares[-1]:.0f} %", color=look["color"],
                va="center", fontsize=8.5, clip_on=False)  # fmt: skip
    ax.set_xticks(levels)
    ax.set(xlim=(levels[0], last), ylim=(-7.0, 107.0), yticks=np.arange(0.0, 101.0, 25.0))
    ax.set(xlabel="level of a track, 0 (nothing of its trouble) to 1 (all)")
    ax.set_ylabel("share of runs lost, %")
    ax.set_title(title, loc="left", fontsize=10)
    path.parent.mkdir(parents=True, exist_ok=True)
    save(figure, path)


def spread(ends: Sequence[float]) -> list[float]:
    """Places for names at these heights: in their order, ``APART`` or more apart, within the axes.

    They are put from the bottom up, then pushed down from 100 where they do not fit.
    """
    order = np.argsort(np.asarray(ends), kind="stable").tolist()
    places = np.asarray(ends, dtype=np.float64)
    for below, k in pairwise(order):
        places[k] = max(places[k], places[below] + APART)
    top = max(PERCENT, APART * (len(ends) - 1))
    for k in reversed(order):
        places[k] = min(places[k], top)
        top = float(places[k]) - APART
    return [float(place) for place in places]
