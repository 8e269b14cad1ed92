# SPDX-License-Identifier: Apache-2.0
"""Section 4.2: points, some of which move (Figs. 8 and 9, Table 2), and how many may.

The paper shows one run and does not say how many of its points moved; its numbers are put beside
ours at 25 %.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from scripts.figures import styled
from scripts.paper import report as pages
from scripts.paper.census import GATE_M, PEAK
from scripts.paper.point_runs import SHUNTING, run_one
from scripts.paper.runs import Plan, Run, beaten, job, sign_test, spread, spread_text
from slam.frames import Float

SHARES = (0.0, 0.10, 0.25, 0.50, 0.75, 0.90)
PAPER_SHARE = 0.25
TARGET = (0.10, 0.50)  # shares of moving points at which the EKF is to be beaten
NAMES = ("odometry", "EKF", "shunting", "known associations")


@styled()
def reproduce(plan: Plan) -> None:
    """The sweep, the two figures, the table."""
    report = pages.Report("landmarks", plan)
    steps = 60 if plan.quick else 220
    shares = (0.0, PAPER_SHARE, 0.75) if plan.quick else SHARES
    seeds = plan.seed_list()
    single = (PAPER_SHARE, seeds[0])  # the run that is shown as the paper's
    cases = {
        (share, seed): f"moving-{round(100 * share):02d}-seed-{seed}"
        for share in shares
        for seed in seeds
    }
    runs = report.run(
        job(name, run_one, moving=share, seed=seed, steps=steps, keep=(share, seed) == single)
        for (share, seed), name in cases.items()
    )
    by_share = {share: [runs[cases[share, seed]] for seed in seeds] for share in shares}
    shown = runs[cases[single]]
    _table_2(report, by_share[PAPER_SHARE])
    _sweep(report, by_share)
    report.figure("fig8", fig8(shown), "Fig. 8: maps, single run, 25 % moving")
    errors = {n: shown.arrays[f"errors {n}"] for n in ("EKF", "shunting", "known associations")}
    title = "Simulated landmarks, 25 % moving, single run"
    figure = pages.error_axes(shown.arrays["seconds"], errors, title)
    report.figure("fig9", figure, "Fig. 9: errors over time")
    report.figure("sweep", fig_sweep(by_share), "RMSE against the share of points that move")
    report.systems(
        {"EKF": ("ekf", {"preset": "points"}), "shunting": ("shunting-features", SHUNTING)}
    )
    report.finish("Simulated landmarks (paper: section 4.2, Figs. 8 and 9, Table 2)")


def _table_2(report: pages.Report, runs: Sequence[Run]) -> None:
    report.heading("Table 2, at 25 % moving")
    report.say(
        "Eq. (14)'s 0.1, 0.03 and 0.001 are taken as standard deviations (m, rad per 0.5 m step; "
        "m, rad per point). The paper does not say how many of its points moved."
    )
    numbers = [run.numbers for run in runs]
    names = ("EKF", "shunting", "known associations")
    pages.paper_table(report, "Table 2, 25 % moving", pages.TABLE_2, numbers, names)
    told = "; ".join(pages.below_printed(pages.TABLE_2, numbers, "shunting"))
    report.say(f"Table 2, shunting, median, against the paper's “Our”: {told}.")


def _sweep(report: pages.Report, by_share: Mapping[float, Sequence[Run]]) -> None:
    report.heading("How many may move")
    report.say(
        "RMSE of the position, m, unaligned, medians with quartiles; the last columns: seeds won "
        "and lost against the EKF, and the two-sided probability of that by chance.",
        quote=True,
    )
    rows = []
    for share, runs in by_share.items():
        rmse = {name: _each(runs, name, "rmse_m") for name in NAMES}
        row = [f"{share:.0%}", *(spread_text(rmse[name], ".4f") for name in NAMES)]
        rows.append(row + [sign_test(rmse[name], rmse["EKF"])[1] for name in NAMES[2:]])
    head = ["moving", *NAMES, "shunting : EKF", "known associations : EKF"]
    report.table(head, rows, quote=True)
    report.say(_verdict(by_share), quote=True)
    report.say(
        f"Landmarks in the end, medians: true static ones seen twice or more; missed, spurious "
        f"(no true one within {GATE_M} m), deleted by mistake (once in the map, in the end none "
        "near and none left that once was it). "
        f"Of the shunting map: peaks of activity from {PEAK} on, between neurons.",
        quote=True,
    )
    columns = {
        f"{key.replace('misses', 'missed')}, {name}": (name, key)
        for key in ("misses", "spurious", "deleted by mistake")
        for name in ("EKF", "shunting")
    }
    rows = []
    for share, runs in by_share.items():
        each = [_each(runs, *of) for of in (("EKF", "true landmarks"), *columns.values())]
        rows.append([f"{share:.0%}", *map(spread_text, each)])
    report.table(["moving", "true", *columns], rows, quote=True)


def _each(runs: Sequence[Run], name: str, key: str) -> list[float]:
    return [run.numbers[name][key] for run in runs]


def _verdict(by_share: Mapping[float, Sequence[Run]]) -> str:
    """Whether the shunting SLAM beats our EKF where the project wants it to: 17 of 20 seeds."""
    told = []
    for share in (share for share in by_share if TARGET[0] <= share <= TARGET[1]):
        runs = by_share[share]
        wins, _ = sign_test(*(_each(runs, name, "rmse_m") for name in ("shunting", "EKF")))
        words = f"{share:.0%} moving {wins} of {len(runs)}"
        told.append(words if beaten(wins, len(runs)) else f"**{words}: missed**")
    few = "" if len(by_share[PAPER_SHARE]) >= 20 else " These are too few seeds to say."
    return f"Seeds in which shunting beats our EKF, target 17 of 20: {'; '.join(told)}.{few}"


def fig_sweep(by_share: Mapping[float, Sequence[Run]]) -> Any:
    """Median and quartiles of the RMSE over the moving share."""
    figure, axes = pages.new_figure(7.5, 4.5)
    x = [100.0 * share for share in by_share]
    for name in NAMES:
        each = (spread(_each(runs, name, "rmse_m")) for runs in by_share.values())
        median, low, high = zip(*each, strict=True)
        color = pages.COLORS[name]
        axes[0].plot(x, median, "o-", color=color, ms=4, label=name)
        axes[0].fill_between(x, low, high, color=color, alpha=0.15, lw=0.0)
    axes[0].set(yscale="log", xlabel="moving points in %", ylabel="RMSE of the position in m",
                title="Median and quartiles over the seeds")  # fmt: skip
    axes[0].legend(frameon=False)
    return figure


TITLES = ("(a) EKF, IPJC and lifecycle", "(b) shunting on features", "(c) EKF", "(d) shunting")


def fig8(run: Run) -> Any:
    """(a) EKF with 3 sigma ellipses, (b) activities of the shunting map; (c), (d) one point of
    them: whole maps show ellipses of centimetres as dots."""
    a, green, middle = run.arrays, pages.COLORS["truth"], _typical(run)

    def also(ax: Axes, name: str, below: bool) -> None:
        ax.plot(*a["true"].T, "+", color=green, ms=7, mew=1.0, label="true static point")
        ax.plot(*a["truth"].T[:2], "-", color=green, lw=0.9, label="true path")
        ax.plot(*a[f"poses {name}"].T[:2], "--", color="#1f61be", lw=1.0, label="estimated path")
        title = TITLES[2 * below + (name == "shunting")]
        ax.set(title=f"{title}, one point" if below else title)
        if not below:
            ax.plot(*middle, "o", ms=14, mfc="none", mec="#ce2c3c", label="shown in (c), (d)")

    shown = [a["true"], a["truth"], a["ellipses"], pages.active(*pages.drawn(run))]
    whole, part = pages.window_over(shown), pages.window_about(middle, 0.15)
    return pages.both_maps({"EKF": run, "shunting": run}, whole, part, also, width=11.0)


def _typical(run: Run) -> Float:
    """Where the landmark of median uncertainty is; without any, a true point."""
    ellipses = run.arrays["ellipses"]
    order = np.argsort(ellipses[:, 2])
    middle: Float = ellipses[order[len(order) // 2], :2] if len(order) else run.arrays["true"][0]
    return middle
