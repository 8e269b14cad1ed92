# SPDX-License-Identifier: Apache-2.0
"""From runs to ``goals.csv``, ``runs.csv`` and ``levels.csv``."""

import math
from collections.abc import Sequence

import numpy as np

from scripts.closed_loop.plan import IDENTITY
from scripts.closed_loop.runs import DrivenRun
from scripts.comparison.rules import Columns, Table, number, word
from scripts.comparison.tables import Row, grouped
from slam.evaluation.statistics import median_interval, quantile, share_interval

OUTCOMES = ("reached", "wrong", "given up", "failed")
_KEY = ("scene", "dynamism", "slam")
GOAL_COLUMNS = (
    *IDENTITY, "order", "goal", "outcome", "reason", "precision_m", "precision_rad", "time_s",
    "driven_m", "collisions", "by_robot", "by_others", "near_misses", "taken_by", "touched",
)  # fmt: skip
RUN_COLUMNS = (
    *IDENTITY, "goals", *(outcome.replace(" ", "_") for outcome in OUTCOMES), "success",
    "precision_m", "precision_rad", "time_s", "driven_m", "collisions", "by_robot", "by_others",
    "near_misses", "ate_m", "lost_s", "recovered", "recovered_s", "not_trusted_share", "failure",
    "failure_words",
)  # fmt: skip


def goal_rows(run: DrivenRun) -> list[Row]:
    """A row for each goal."""
    rows = []
    for order, goal in enumerate(run.goals):
        row = {**run.identity, **goal, **goal["tally"], "order": order, "taken_by": goal["taken"]}
        row["collisions"] = row["by_robot"] + row["by_others"]
        rows.append(row | {"touched": " ".join(row["touched"])})
    return rows


def run_row(run: DrivenRun) -> Row:
    """A row for a whole run; precisions are medians over the goals believed reached."""
    goals, offset = goal_rows(run), run.arrays["believed"] - run.arrays["true"]
    squared = offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1]
    lost_s, found_s, (failure, words) = (run.rest[k] for k in ("lost_s", "found_s", "failure"))
    sums = ("time_s", "driven_m", "collisions", "by_robot", "by_others", "near_misses")
    return {
        **run.identity, **_outcomes(goals), **{name: sum(g[name] for g in goals) for name in sums},
        "ate_m": math.sqrt(float(squared.mean())) if len(squared) else None,
        "lost_s": lost_s, "recovered_s": found_s,
        "recovered": None if lost_s is None else int(found_s is not None),
        "not_trusted_share": float(1.0 - np.mean(run.arrays["trusted"])) if len(squared) else None,
        "failure": failure, "failure_words": words,
    }  # fmt: skip


def _outcomes(goals: Sequence[Row]) -> Row:
    """How many there are, of each outcome, the share reached, and how precisely."""
    counts = {o.replace(" ", "_"): sum(g["outcome"] == o for g in goals) for o in OUTCOMES}
    arrived = [g for g in goals if g["precision_m"] is not None]
    precisions = {
        name: quantile([abs(g[name]) for g in arrived], 0.5) if arrived else None
        for name in ("precision_m", "precision_rad")
    }
    success = counts["reached"] / len(goals)
    return {"goals": len(goals), **counts, "success": success, **precisions}


def levels(goals: Sequence[Row], runs: Sequence[Row]) -> list[Row]:
    """A row for each scene, level and SLAM, in the order they come.

    Success has Wilson's 95 % interval over the goals, the median precision over the goals believed
    reached a bootstrap interval.
    """
    by_key, keys = grouped(goals, _KEY), grouped(runs, _KEY).items()
    return [{**dict(zip(_KEY, k, strict=True)), **_level(by_key[k], own)} for k, own in keys]


def _level(goals: list[Row], runs: list[Row]) -> Row:
    reached = [g["time_s"] for g in goals if g["outcome"] == "reached"]
    low, high = share_interval(len(reached), len(goals))
    arrived = [g["precision_m"] for g in goals if g["precision_m"] is not None]
    near, far = median_interval(arrived)
    km = sum(g["driven_m"] for g in goals) / 1e3
    return {
        **_outcomes(goals), "runs": len(runs), "success_low": low, "success_high": high,
        "given_up_taken": sum(g["outcome"] == "given up" and g["taken_by"] != "" for g in goals),
        "precision_m_low": near, "precision_m_high": far, "time_s": quantile(reached, 0.5),
        "collisions_per_km": sum(g["collisions"] for g in goals) / km if km else None,
        "near_misses_per_km": sum(g["near_misses"] for g in goals) / km if km else None,
        "runs_lost": sum(r["lost_s"] is not None for r in runs),
        "runs_recovered": sum(r["recovered"] == 1 for r in runs),
    }  # fmt: skip


LEVELS = "levels.csv"
_COUNT, _SHARE = number(most=1e9, whole=True), number(most=1.0)
_SOME = number(least=1.0, most=1e9, whole=True)
_MAYBE = number(optional=True)
_COLUMNS: Columns = {
    "scene": word(), "dynamism": _SHARE, "slam": word(), "runs": _SOME, "goals": _SOME,
    "reached": _COUNT, "success": _SHARE, "success_low": _SHARE, "success_high": _SHARE,
    "wrong": _COUNT, "given_up": _COUNT, "failed": _COUNT, "given_up_taken": _COUNT,
    **dict.fromkeys(
        ("precision_m", "precision_m_low", "precision_m_high", "precision_rad", "time_s",
         "collisions_per_km", "near_misses_per_km"), _MAYBE,
    ),
    "runs_lost": _COUNT, "runs_recovered": _COUNT,
}  # fmt: skip
TABLE = Table(
    columns=_COLUMNS, key=_KEY,
    parts=(
        *((outcome, "goals") for outcome in ("reached", "wrong", "given_up", "failed")),
        ("runs_lost", "runs"), ("runs_recovered", "runs_lost"),
    ),
)  # fmt: skip
"""``levels.csv``."""
