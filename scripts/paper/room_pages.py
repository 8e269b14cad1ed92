# SPDX-License-Identifier: Apache-2.0
"""The runs, tables and figures that the experiments in rooms share."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from scripts.paper import rooms
from scripts.paper.report import COLORS, Report, new_figure
from scripts.paper.rooms import FAILED_M, FAILED_RAD, SYSTEMS
from scripts.paper.runs import Plan, Run, beaten, job, sign_test, spread_text
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
    cases = {(v, seed): f"{v}-seed-{seed}" for v in variants for seed in seeds}
    room = {"scene": scene, "dynamism": dynamism, "seconds": seconds}
    runs = report.run(
        job(name, rooms.run_one, **room, options=variants[v], seed=seed, keep=seed == seeds[0])
        for (v, seed), name in cases.items()
    )
    report.systems(SYSTEMS)
    return {v: [runs[cases[v, seed]] for seed in seeds] for v in variants}


def score_table(report: Report, runs: Sequence[Run]) -> None:
    """RMSE, heading and failures of every SLAM, and who wins against the EKF."""
    rows = []
    for name in NAMES:
        numbers = [run.numbers[name] for run in runs]
        rmse = [n["rmse_m"] for n in numbers]
        rows.append(
            [
                name,
                spread_text(rmse, ".4f"),
                f"{max(rmse):.4f}",
                spread_text((n["heading_rmse_rad"] for n in numbers), ".4f"),
                f"{sum(n['failed'] for n in numbers)} of {len(numbers)}",
                spread_text((n["ms"] for n in numbers), ".1f"),
                "" if name == "EKF" else against_ekf(name, runs)[1],
            ]
        )
    head = ["", "RMSE, m", "worst, m", "heading RMSE, rad", "failed", "CPU per scan, ms"]
    report.table([*head, "seeds won : lost against the EKF"], rows, quote=True)


def against_ekf(name: str, runs: Sequence[Run]) -> tuple[int, str]:
    """``sign_test`` of the RMSE."""
    return sign_test(*([run.numbers[of]["rmse_m"] for run in runs] for of in (name, "EKF")))


def verdict(runs: Sequence[Run]) -> str:
    """Whether the shunting SLAM beats our EKF as the project wants it to: 17 of 20 seeds."""
    wins, words = against_ekf("shunting", runs)
    told = f"Shunting on beams against our EKF: {words}"
    if len(runs) < 20:
        return f"{told}; the target is 17 of 20 seeds, these are too few to say."
    met = beaten(wins, len(runs))
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
