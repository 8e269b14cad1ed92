# SPDX-License-Identifier: Apache-2.0
"""Tables and the learning curve of ``train_policy``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binomtest

from scripts.experiments.measured import table
from scripts.figures import save, styled

POSES = ("truth", "shunting", "odometry")
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
DRIVER, RULE = "driver", "rule"
MEAN_OF = 100  # episodes of the mean in the curve
NAMES = {
    DRIVER: "driver without avoidance, true pose",
    RULE: "reactive rule alone, true pose", "truth": "policy, true pose",
    "shunting": "policy, `shunting`", "odometry": "policy, odometry",
}  # fmt: skip

Row = dict[str, Any]


def tables(cells: dict[str, Row], n: int) -> str:
    """Both tables; ``cells`` by "who level", of ``n`` seeds each."""
    return (
        f"{shares(cells, n)}\n\n"
        "What is reached more than by the driver, in percentage points: mean over the same "
        f"seeds and its 95 % interval.\n\n{differences(cells)}"
    )


def share_interval(k: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share, of ``k`` in ``n``."""
    interval = binomtest(k, n).proportion_ci(confidence_level=0.95, method="wilson")
    return float(interval.low), float(interval.high)


def paired(policy: str, driver: str) -> tuple[float, float]:
    """Mean difference of the shares reached, seed by seed, and half its 95 % interval (normal).

    policy, driver  the first letter of the outcome of each seed, in the same order
    """
    n = min(len(policy), len(driver))
    return _mean_of([(policy[k] == "r") - (driver[k] == "r") for k in range(n)])


def _mean_of(values: Sequence[float]) -> tuple[float, float]:
    if len(values) < 2:
        return float(np.mean(values)), float("inf")
    return float(np.mean(values)), float(1.96 * np.std(values, ddof=1) / np.sqrt(len(values)))


def differences(cells: dict[str, Row]) -> str:
    """The table of what is reached more than by the driver, in percentage points."""
    rows = []
    for name in (RULE, *POSES):
        told, by_seed = [NAMES[name]], []
        for level in LEVELS:
            own, other = (cells[f"{who} {level:g}"]["outcomes"] for who in (name, DRIVER))
            mean, half = paired(own, other)
            told.append(f"{100 * mean:+.0f} ± {100 * half:.0f}")
            by_seed.append([(a == "r") - (b == "r") for a, b in zip(own, other, strict=True)])
        mean, half = _mean_of(np.mean(by_seed, axis=0).tolist())
        rows.append([*told, f"{100 * mean:+.0f} ± {100 * half:.0f}"])
    return table(["dynamism", *(f"{level:g}" for level in LEVELS), "all"], rows)


def shares(cells: dict[str, Row], n: int) -> str:
    """The table: share of goals reached in %, with its interval, and in brackets collisions."""
    rows = []
    for name, words in NAMES.items():
        told = [words]
        for level in LEVELS:
            cell = cells[f"{name} {level:g}"]
            told.append(
                f"{cell['reached'] / n:.0%} ({cell['low']:.0%} to {cell['high']:.0%}), "
                f"{cell['collided'] / n:.0%}"
            )
        rows.append(told)
    return table(["dynamism", *(f"{level:g}" for level in LEVELS)], rows)


@styled()
def picture(episodes: Sequence[Row], path: Path) -> None:
    """The learning curve: share of goals reached, and reward, over the last episodes."""
    figure = Figure(figsize=(6.4, 3.4))
    axes = figure.add_subplot()
    steps = np.array([row["step"] for row in episodes]) / 1e3
    reached = _mean([100.0 * row["reached"] for row in episodes])
    reward = _mean([row["r"] for row in episodes])
    axes.plot(steps, reached, color="#168c5a", label="goals reached, %")
    axes.set(xlabel="steps of training, thousands", ylabel="goals reached, %", ylim=(0, 100))
    beside = axes.twinx()
    beside.plot(steps, reward, color="#1f61be", label="reward of an episode")
    beside.set_ylabel("reward of an episode")
    beside.grid(visible=False)
    beside.spines["right"].set_visible(True)
    handles = [*axes.get_legend_handles_labels()[0], *beside.get_lines()]
    axes.legend(handles, [str(each.get_label()) for each in handles], loc="lower right")
    axes.set_title(f"means of {MEAN_OF} episodes, as driven while learning", fontsize=9)
    save(figure, path)


def _mean(values: Sequence[float]) -> Any:
    """Of each value and those before it, ``MEAN_OF`` at most."""
    sums = np.cumsum(np.concatenate([[0.0], values]))
    ends = np.arange(1, len(values) + 1)
    starts = np.maximum(0, ends - MEAN_OF)
    return (sums[ends] - sums[starts]) / (ends - starts)
