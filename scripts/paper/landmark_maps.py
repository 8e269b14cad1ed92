# SPDX-License-Identifier: Apache-2.0
"""Fig. 8: the maps of points that both SLAMs made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from scripts.paper.map_figures import active, legend_below, map_panels, window_about, window_over
from scripts.paper.report import COLORS, draw_activities, draw_ellipses
from scripts.paper.runs import Run
from slam.frames import Float


def fig8(run: Run) -> Any:
    """(a) EKF with 3 sigma ellipses, (b) activities of the shunting map; (c), (d) one point of
    them: whole maps show ellipses of centimetres as dots."""
    a = run.arrays
    drawn = (a["activities"], a["origin"], float(a["cell"]))
    whole = window_over([a["true"], a["truth"], a["ellipses"], active(*drawn)])
    part = window_about(_typical(a), 0.15)
    figure, axes = map_panels([whole, part], columns=2, width=11.0)
    for k, ax in enumerate(axes):
        name = ("EKF", "shunting")[k % 2]
        if name == "EKF":
            draw_ellipses(ax, a["ellipses"], label="landmark, 3 σ")
        else:
            image = draw_activities(ax, *drawn, "Greys", swell=k < 2)
        ax.plot(*a["true"].T, "+", color=COLORS["truth"], ms=7, mew=1.0, label="true static point")
        ax.plot(*a["truth"].T[:2], "-", color=COLORS["truth"], lw=0.9, label="true path")
        ax.plot(*a[f"poses {name}"].T[:2], "--", color="#1f61be", lw=1.0, label="estimated path")
        (part if k >= 2 else whole).show(ax)
        titles = ("EKF, IPJC and lifecycle", "shunting on features", "EKF", "shunting")
        ax.set(title=f"({'abcd'[k]}) {titles[k]}{', one point' if k >= 2 else ''}")
    for ax in axes[:2]:
        ax.plot(*_typical(a), "o", ms=14, mfc="none", mec="#ce2c3c", label="shown in (c), (d)")
    figure.colorbar(image, ax=list(axes), shrink=0.5, aspect=40, label="activity")
    legend_below(figure, axes)
    return figure


def _typical(a: Mapping[str, Any]) -> Float:
    """Where the landmark of median uncertainty is; without any, a true point."""
    order = np.argsort(a["ellipses"][:, 2])
    middle: Float = a["ellipses"][order[len(order) // 2], :2] if len(order) else a["true"][0]
    return middle
