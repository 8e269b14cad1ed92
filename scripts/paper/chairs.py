# SPDX-License-Identifier: Apache-2.0
"""Section 4.3: an arena in which all things are chairs that get pushed (Figs. 10-12, Table 3)."""

from typing import Any

from scripts.figures import styled
from scripts.paper import report as pages
from scripts.paper.room_pages import RULE, fig_rmse, run_all, score_table, seconds_of, verdict
from scripts.paper.runs import Plan, Run

VARIANTS: dict[str, dict[str, Any]] = {"walls": {"walls": "visible"}, "no-walls": {"walls": "none"}}
TITLES = {"walls": "walls visible", "no-walls": "walls out of range"}
DYNAMISM = 1.0  # each chair is shoved once in 7 s on average
LIMITS = {"x": (0.05, 0.01), "y": (0.05, 0.01), "θ": (0.03, 0.01)}


@styled()
def reproduce(plan: Plan) -> None:
    """With walls and without, every SLAM, every seed."""
    report = pages.Report("chairs", plan)
    by_variant = run_all(report, plan, "arena", DYNAMISM, VARIANTS)
    report.say(
        f"16 chairs in 10 x 8 m, each shoved every 7 s on average (0.25 to 1.5 m/s), "
        f"{seconds_of(by_variant['walls'][0]):.0f} s of driving among them, LMS-221 at 7.5 Hz "
        "with all its effects; truth as the ceiling tags of the paper would have it, "
        "without their error. The paper does not say whether its laser saw the walls: both are "
        "here."
    )
    report.say(RULE)
    for variant, runs in by_variant.items():
        report.heading(f"Table 3, {TITLES[variant]}")
        numbers = [run.numbers for run in runs]
        names = ("EKF", "shunting", "shunting, paper preset")
        pages.paper_table(report, f"Table 3, {TITLES[variant]}", pages.TABLE_3, numbers, names)
        told = "; ".join(pages.below_printed(pages.TABLE_3, numbers, "shunting", limits=LIMITS))
        report.say(
            f"Table 3, {TITLES[variant]}: shunting on beams, medians, against the project's "
            f"targets: {told}."
        )
        report.say("RMSE, medians with quartiles:", quote=True)
        score_table(report, runs)
        report.say(verdict(runs), quote=True)
    lines = ("odometry", "EKF", "shunting", "shunting, paper preset")
    for variant, (single, *_) in by_variant.items():
        errors = {name: single.arrays[f"errors {name}"] for name in lines}
        title = f"Chairs, {TITLES[variant]}, single run"
        report.figure(f"fig11-{variant}", fig11(single, title), f"Fig. 11: maps, {TITLES[variant]}")
        figure = pages.error_axes(single.arrays["seconds"], errors, title)
        report.figure(f"fig12-{variant}", figure, f"Fig. 12: errors, {TITLES[variant]}")
    figure = fig_rmse({TITLES[v]: runs for v, runs in by_variant.items()})
    report.figure("rmse", figure, "RMSE of every seed; bars are medians")
    report.finish("Chairs (paper: section 4.3, Figs. 10 to 12, Table 3)")


def fig11(run: Run, title: str) -> Any:
    """(a) EKF, (b) shunting on beams, (c) on features with the paper preset."""
    a = run.arrays
    names = ("EKF", "shunting", "shunting, paper preset")
    maps = {name: pages.drawn(run, name) for name in names if f"activities {name}" in a}
    things = [a["truth"], a["ellipses EKF"], *(a[f"poses {name}"] for name in names)]
    whole = pages.window_over([*things, *(pages.active(*drawn) for drawn in maps.values())])
    figure, axes = pages.map_panels([whole], columns=3, width=14.0)
    for ax, letter, name in zip(axes, "abc", names, strict=True):
        if name == "EKF":
            pages.draw_ellipses(ax, a["ellipses EKF"], label="landmark, 3 σ", dot=1.0)
        elif name in maps:
            image = pages.draw_activities(ax, *maps[name], "Greys")
            figure.colorbar(image, ax=ax, label="activity", shrink=0.8)
        ax.plot(*a["truth"].T[:2], "-", color=pages.COLORS["truth"], lw=1.0, label="true path")
        ax.plot(*a[f"poses {name}"].T[:2], "--", color="#1f61be", lw=1.0, label="estimated path")
        pages.show(ax, whole)
        ax.set(title=f"({letter}) {name}")
    pages.legend_below(figure, axes)
    figure.suptitle(title)
    return figure
