# SPDX-License-Identifier: Apache-2.0
"""From runs to ``goals.csv``, ``runs.csv`` and ``levels.csv``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from scripts.closed_loop.plan import IDENTITY
from scripts.closed_loop.runs import Driven
from scripts.comparison.tables import grouped
from slam.evaluation.statistics import median_interval, quantile, share_interval

Row = dict[str, Any]
OUTCOMES = ("reached", "wrong", "given up", "failed")
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
LEVEL_COLUMNS = (
    "scene", "dynamism", "slam", "runs", "goals", "reached", "success", "success_low",
    "success_high", "wrong", "given_up", "failed", "given_up_taken", "precision_m",
    "precision_m_low", "precision_m_high", "precision_rad", "time_s", "collisions_per_km",
    "near_misses_per_km", "runs_lost", "runs_recovered",
)  # fmt: skip


def goal_rows(run: Driven) -> list[Row]:
    """A row for each goal."""
    rows = []
    for order, goal in enumerate(run.goals):
        tally = goal["tally"]
        rows.append({
            **run.identity, **{k: goal[k] for k in GOAL_COLUMNS if k in goal}, "order": order,
            "by_robot": tally["by_robot"], "by_others": tally["by_others"],
            "collisions": tally["by_robot"] + tally["by_others"],
            "near_misses": tally["near_misses"], "touched": " ".join(tally["touched"]),
            "taken_by": goal["taken"],
        })  # fmt: skip
    return rows


def run_row(run: Driven) -> Row:
    """A row for a whole run; precisions are medians over the goals believed reached."""
    goals, offset = goal_rows(run), run.arrays["believed"] - run.arrays["true"]
    squared = offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1]
    lost_s, found_s, (failure, words) = (run.rest[k] for k in ("lost_s", "found_s", "failure"))
    counts = {o.replace(" ", "_"): sum(g["outcome"] == o for g in goals) for o in OUTCOMES}
    sums = ("time_s", "driven_m", "collisions", "by_robot", "by_others", "near_misses")
    return {
        **run.identity, "goals": len(goals), **counts, "success": counts["reached"] / len(goals),
        **_precisions(goals), **{name: sum(g[name] for g in goals) for name in sums},
        "ate_m": math.sqrt(float(squared.mean())) if len(squared) else None,
        "lost_s": lost_s, "recovered_s": found_s,
        "recovered": None if lost_s is None else int(found_s is not None),
        "not_trusted_share": float(1.0 - np.mean(run.arrays["trusted"])) if len(squared) else None,
        "failure": failure, "failure_words": words,
    }  # fmt: skip


def _precisions(goals: Sequence[Row]) -> Row:
    arrived = [g for g in goals if g["precision_m"] is not None]
    if not arrived:
        return {"precision_m": None, "precision_rad": None}
    return {
        "precision_m": quantile([g["precision_m"] for g in arrived], 0.5),
        "precision_rad": quantile([abs(g["precision_rad"]) for g in arrived], 0.5),
    }


def levels(goals: Sequence[Row], runs: Sequence[Row]) -> list[Row]:
    """A row for each scene, level and SLAM, in the order they come.

    Success has Wilson's 95 % interval over the goals, the median precision over the goals believed
    reached a bootstrap interval.
    """
    keys = ("scene", "dynamism", "slam")
    by_key = grouped(goals, keys)
    return [_level(key, by_key.get(key, []), own) for key, own in grouped(runs, keys).items()]


def _level(key: tuple[Any, ...], goals: list[Row], runs: list[Row]) -> Row:
    counts = {o.replace(" ", "_"): sum(g["outcome"] == o for g in goals) for o in OUTCOMES}
    low, high = share_interval(counts["reached"], len(goals))
    arrived = [g["precision_m"] for g in goals if g["precision_m"] is not None]
    near, far = median_interval(arrived)
    km = sum(g["driven_m"] for g in goals) / 1e3
    return {
        **dict(zip(("scene", "dynamism", "slam"), key, strict=True)),
        "runs": len(runs), "goals": len(goals), **counts,
        "success": counts["reached"] / len(goals), "success_low": low, "success_high": high,
        "given_up_taken": sum(g["outcome"] == "given up" and g["taken_by"] != "" for g in goals),
        **_precisions(goals), "precision_m_low": near, "precision_m_high": far,
        "time_s": quantile([g["time_s"] for g in goals if g["outcome"] == "reached"], 0.5),
        "collisions_per_km": sum(g["collisions"] for g in goals) / km if km else None,
        "near_misses_per_km": sum(g["near_misses"] for g in goals) / km if km else None,
        "runs_lost": sum(r["lost_s"] is not None for r in runs),
        "runs_recovered": sum(r["recovered"] == 1 for r in runs),
    }  # fmt: skip
