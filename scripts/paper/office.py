# SPDX-License-Identifier: Apache-2.0
"""Section 4.3, last paragraph: an ordinary office (Fig. 13)."""

from typing import Any

import numpy as np

from scripts.figures import styled
from scripts.paper import room_pages
from scripts.paper.report import Report, draw_activities, drawn, new_figure
from scripts.paper.runs import Plan, Run

DYNAMISM = 0.5


@styled()
def reproduce(plan: Plan) -> None:
    """The office, every SLAM, every seed; the paper gives a picture and no numbers."""
    report = Report("office", plan)
    runs = room_pages.run_all(report, plan, "office", DYNAMISM, {"office": {}})["office"]
    driven = room_pages.path_length(runs[0].arrays["truth"])
    report.say(
        f"20 x 12 m: 24 chairs, 6 people, doors and bins, each with a mobility of its own, "
        f"{room_pages.seconds_of(runs[0]):.0f} s ({driven:.0f} m in the single run) with the "
        "LMS-221 at 7.5 Hz with all its effects. The paper shows a map and no numbers."
    )
    report.say(room_pages.RULE)
    room_pages.score_table(report, runs)
    report.say(room_pages.verdict(runs), quote=True)
    for name, file in (("shunting", "fig13"), ("shunting, paper preset", "fig13-paper")):
        report.figure(file, fig13(runs[0], name), f"Fig. 13: office, {name}, single run")
    figure = room_pages.fig_rmse({"office": runs})
    report.figure("rmse", figure, "RMSE of every seed; bars are medians")
    report.finish("Office (paper: section 4.3, Fig. 13)")


def fig13(run: Run, name: str) -> Any:
    """In the paper's style: raw LIDAR blue, trajectory black, activities coloured."""
    a = run.arrays
    figure, axes = new_figure(10.5, 6.5)
    ax = axes[0]
    ax.grid(visible=False)
    # beneath the activities, which cover it only as far as they are high
    ax.plot(*a["raw"].T, ".", color="#1f61be", ms=6.0, mew=0.0, label="raw LIDAR", zorder=1)
    activities, origin, cell = drawn(run, name)
    image = draw_activities(ax, activities, origin, cell, "YlOrRd")
    image.set(zorder=2, alpha=np.clip(0.3 + 1.5 * activities.astype(np.float32), 0.0, 1.0))
    ax.plot(*a[f"poses {name}"].T[:2], "k.", ms=2.0, label="trajectory", zorder=4)
    low, high = a["raw"].min(axis=0) - 0.5, a["raw"].max(axis=0) + 0.5
    ax.set(xlabel="x in m", ylabel="y in m", aspect="equal", title=f"Office, {name}")
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    figure.colorbar(image, ax=ax, shrink=0.7, label="activity")
    ax.legend(loc="upper right", fontsize=8, markerscale=2.0)
    return figure
