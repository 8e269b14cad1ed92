# SPDX-License-Identifier: Apache-2.0
"""The runs, tables and figures that the experiments in rooms share."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from scripts.paper import rooms
from scripts.paper.report import COLORS, Report, new_figure
from scripts.paper.rooms import FAILED_M, FAILED_RAD, SYSTEMS
from scripts.paper.runs import Plan, Run, SignTest, job, sign_test, spread
from slam.frames import Float

NAMES = tuple(SYSTEMS)
SECONDS = 60.0  # of a tour
RULE = (
    f"Failed: RMSE above {FAILED_M} m or {FAILED_RAD} rad, or the SLAM itself says at the end that "
    "it is lost. “Shunting” sees the beams, with its own preset and with the paper's; “shunting, "
    "features” and “shunting, paper preset” see point features (the EKF's corners) with IPJC."
)


def run_all(
    report: Report, plan: Plan, scene: str, dynamism: float, variants: Mapping[str, dict[str, Any]]
) -> dict[str, list[Run]]:
    """Every variant (name -> options of the scene) over all seeds."""
    seconds = 8.0 if plan.quick else SECONDS
    seeds = plan.seed_list()
    runs = report.run(
        job(
            f"{variant}-seed-{seed}",
            rooms.run_one,
            scene=scene,
            options=options,
            dynamism=dynamism,
            seed=seed,
            seconds=seconds,
            keep=seed == seeds[0],
        )
        for variant, options in variants.items()
        for seed in seeds
    )
    report.systems(SYSTEMS)
    return {v: [runs[f"{v}-seed-{seed}"] for seed in seeds] for v in variants}


def score_table(report: Report, runs: Sequence[Run]) -> None:
    """RMSE, heading and failures of every SLAM, and who wins against the EKF."""
    rows = []
    theirs = [run.numbers["EKF"]["rmse_m"] for run in runs]
    for name in NAMES:
        numbers = [run.numbers[name] for run in runs]
        mine = [n["rmse_m"] for n in numbers]
        test = "" if name == "EKF" else sign_test(mine, theirs).text()
        rows.append(
            [
                name,
                spread(mine).text("{:.4f}"),
                f"{max(mine):.4f}",
                spread(n["heading_rmse_rad"] for n in numbers).text("{:.4f}"),
                f"{sum(n['failed'] for n in numbers)} of {len(numbers)}",
                spread(n["ms"] for n in numbers).text("{:.1f}"),
                test,
            ]
        )
    head = ["", "RMSE, m", "worst, m", "heading RMSE, rad", "failed", "CPU per scan, ms"]
    report.table([*head, "seeds won : lost against the EKF"], rows, quote=True)


def verdict(runs: Sequence[Run]) -> str:
    """Whether the shunting SLAM beats our EKF as the project wants it to: 17 of 20 seeds."""
    mine = [run.numbers["shunting"]["rmse_m"] for run in runs]
    test: SignTest = sign_test(mine, [run.numbers["EKF"]["rmse_m"] for run in runs])
    told = f"Shunting on beams against our EKF: {test.text()}"
    if len(runs) < 20:
        return f"{told}; the target is 17 of 20 seeds, these are too few to say."
    met = test.wins >= math.ceil(0.85 * len(runs))
    return f"{told}; the target (17 of 20) is met." if met else f"**{told}: target missed.**"


def fig_rmse(groups: Mapping[str, Sequence[Run]]) -> Any:
    """RMSE of each seed, one column of dots for each SLAM."""
    figure, axes = new_figure(5.2 * len(groups), 4.4, columns=len(groups), sharey=True)
    for ax, (title, runs) in zip(axes, groups.items(), strict=True):
        for k, name in enumerate(NAMES):
            values = np.array([run.numbers[name]["rmse_m"] for run in runs])
            x = k + 0.25 * np.linspace(-1.0, 1.0, len(values)) if len(values) > 1 else np.array([k])
            ax.plot(x, values, "o", color=COLORS[name], ms=3.5, alpha=0.7)
            ax.plot([k - 0.35, k + 0.35], [np.median(values)] * 2, color=COLORS[name], lw=2.0)
        ax.set(yscale="log", title=title)
        ax.set_xticks(range(len(NAMES)), [n.replace(" ", "\n") for n in NAMES], fontsize=7)
        ax.axhline(FAILED_M, color="black", lw=0.7, ls=":")
    axes[0].set(ylabel="RMSE of the position in m (dotted: failed)")
    return figure


def path_length(poses: Float) -> float:
    """Metres along (n, 3) poses."""
    return sum(float(np.hypot(*(b - a)[:2])) for a, b in pairwise(poses))


def seconds_of(run: Run) -> float:
    """How long a tour was."""
    return float(run.arrays["seconds"][-1])
