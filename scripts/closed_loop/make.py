# SPDX-License-Identifier: Apache-2.0
"""Closed-loop drives as a whole: drive, write tables and pictures; what is there already stays."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from scenes import registry
from scripts.closed_loop import pictures, tables
from scripts.closed_loop.folder import LEVELS, TABLE
from scripts.closed_loop.plan import RUNS, SCHEMA, Plan
from scripts.closed_loop.runs import Driven, load
from scripts.comparison.csv_files import write_checked, write_csv
from scripts.console import level_table
from scripts.jobs import run_jobs, try_names
from scripts.machine import machine
from scripts.output import result_folder
from slam.errors import UnknownNameError
from slam.evaluation.lost import FOUND_RULE, LOST_RULE
from slam.files import write_text


def carry_out(plan: Plan, out: Path, *, jobs: int = 1) -> list[dict[str, Any]]:
    """Drive what is missing, write tables and pictures; the rows of ``levels.csv``."""
    built = registry.build(plan.scene)  # wrong names are told before anything starts
    for name in plan.goals if isinstance(plan.goals, tuple) else ():
        if name not in built.goals:
            known = ", ".join(sorted(built.goals))
            raise UnknownNameError(f"scene '{plan.scene}' has no goal '{name}'. Known: {known}.")
    try_names(plan.slams, (), out)
    out = out.absolute()
    settings = {
        "drive_schema": SCHEMA, **asdict(plan), "lost_rule": LOST_RULE, "found_rule": FOUND_RULE,
        "machine": machine(),
    }  # fmt: skip
    with result_folder(out, "drive", settings) as written:
        wanted = list(plan.jobs())
        files = run_jobs([j for _, j in wanted], out / RUNS, processes=jobs, title="driving")
        runs = [load(files[job.name], identity) for identity, job in wanted]
        with written() as staged:
            return _write(staged, plan, runs)


def _write(out: Path, plan: Plan, runs: list[Driven]) -> list[dict[str, Any]]:
    goals = [row for run in runs for row in tables.goal_rows(run)]
    rows = [tables.run_row(run) for run in runs]
    summary = tables.levels(goals, rows)
    write_csv(out / "goals.csv", goals, tables.GOAL_COLUMNS, plan.axis)
    write_csv(out / "runs.csv", rows, tables.RUN_COLUMNS, plan.axis)
    write_checked(out / LEVELS, summary, TABLE, plan.axis)
    whole = [
        {plan.axis if k == "dynamism" else k: v for k, v in row.items()} | {"results": run.goals}
        for row, run in zip(rows, runs, strict=True)
    ]
    text = json.dumps({"schema": SCHEMA, "runs": whole}, indent=1, allow_nan=False)
    write_text(out / "runs.json", text + "\n")
    pictures.curves(out / "closed_loop.png", summary, plan.axis)
    shown = dict.fromkeys((plan.levels[0], plan.levels[-1]))
    picked = [
        [r for r in runs if (r.identity["dynamism"], r.identity["seed"]) == (level, plan.seeds[0])]
        for level in shown
    ]
    pictures.paths(out / "paths.png", picked, plan.axis)
    return summary


def said(plan: Plan, rows: list[dict[str, Any]]) -> list[str]:
    """Goals reached by each SLAM at the lowest and the highest level."""
    lines = []
    for level in dict.fromkeys((plan.levels[0], plan.levels[-1])):
        own = [row for row in rows if row["dynamism"] == level]
        told = ", ".join(f"`{r['slam']}` reached {r['reached']} of {r['goals']} goals" for r in own)
        lines.append(f"At {plan.axis} {level:g} {told}.")
    return lines


def success_table(plan: Plan, rows: list[dict[str, Any]]) -> Table:
    """Success and precision, to be printed."""
    at = {(row["dynamism"], row["slam"]): row for row in rows}
    title = f"{plan.scene}: goals reached, %; median precision, cm; runs lost"
    caption = f"reached: within {plan.loop.tolerance_m:g} m in truth; lost: {LOST_RULE}"
    return level_table(
        title, caption, plan.levels, plan.slams, lambda level, slam: _cell(at[level, slam]),
        plan.axis,
    )  # fmt: skip


def _cell(row: dict[str, Any]) -> str:
    precise = "-" if row["precision_m"] is None else f"{100.0 * row['precision_m']:.0f}"
    return f"{100.0 * row['success']:.0f} %; {precise}; {row['runs_lost']} of {row['runs']}"
