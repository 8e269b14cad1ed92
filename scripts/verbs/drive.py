# SPDX-License-Identifier: Apache-2.0
"""``mobilia drive``: a robot steered by its SLAM's estimate, goal by goal, in rooms that move."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from scenes import registry
from scripts.console import console, level_table
from scripts.names import check
from scripts.scanner_option import Scanner, every_of
from scripts.verbs.compare import levels, named
from slam.errors import InvalidValueError, UnknownNameError
from slam.files import write_text
from slam.variants import with_set

if TYPE_CHECKING:
    from scripts.closed_loop.plan import Plan
    from scripts.closed_loop.runs import Driven


def drive(
    scene: Annotated[str, typer.Argument(help="A scene by name, or module:function.")],
    slam: Annotated[list[str], typer.Option(help="SLAMs by name or module:Class: --slam A B C.")],
    out: Annotated[Path, typer.Option(help="Folder of the runs and their tables.")],
    dynamism: Annotated[
        list[str] | None, typer.Option(help="Levels, start:stop:step or one by one; 0:1:0.25.")
    ] = None,
    seeds: Annotated[
        list[str] | None, typer.Option(help="How many seeds from 100 on; several words: which.")
    ] = None,
    plan_on: Annotated[
        str, typer.Option(help="Ways are planned on the layout, or on the SLAM's own map.")
    ] = "layout",
    seconds: Annotated[float, typer.Option(help="Limit of each goal, s.")] = 90.0,
    goals: Annotated[
        list[str] | None, typer.Option(help="How many, or which by name; default all rooms'.")
    ] = None,
    every: Annotated[
        int | None, typer.Option(help="One scan in so many is used; default about 9.4 a second.")
    ] = None,
    scanner: Scanner = "full",
    jobs: Annotated[int, typer.Option(help="Processes of this machine.")] = 1,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", help="[SLAM.]PATH=VALUE, see mobilia config SLAM; repeatable."),
    ] = None,
) -> None:
    """Drive to a goal in every room, steered by what each SLAM believes; truth only scores.

    Every SLAM gets the same worlds. Killed at any time, the same command goes on from there.

    [bold]mobilia drive arena --slam shunting odometry --dynamism 0:1:0.5 --seeds 3 --out
    out/drive[/bold]
    """
    slams = with_set(named(slam), set_ or [])
    check(slams, scene)
    from scripts import workers
    from scripts.closed_loop.plan import Plan
    from sim.loop.config import LoopConfig

    workers.check_jobs(jobs)
    plan = Plan(
        scene=scene,
        slams=slams,
        levels=levels(dynamism or ["0:1:0.25"]),
        seeds=_seeds(named(seeds or ["5"])),
        goals=_goals(named(goals or [])),
        loop=LoopConfig(plan_on=plan_on, limit_s=seconds, scans=every_of(scanner, every, 4)),
        scanner=scanner,
    )
    started = time.perf_counter()
    rows = carry_out(plan, out, jobs=jobs)
    console.print(_table(plan, rows))
    console.print(
        f"{escape(str(out))}: closed_loop.png, paths.png, goals.csv, runs.csv, levels.csv "
        f"({time.perf_counter() - started:.0f} s)",
        soft_wrap=True,
    )


def _seeds(words: tuple[str, ...]) -> tuple[int, ...]:
    """``("5",)`` is five seeds from 100 on, ``("3", "4")`` are these, as is ``("3:5",)``."""
    try:
        if len(words) == 1 and ":" in words[0]:
            first, end = (int(word) for word in words[0].split(":"))
            return tuple(range(first, end))
        numbers = tuple(int(word) for word in words)
    except ValueError:
        raise InvalidValueError(
            f"--seeds must be a number, several, or first:end, got {' '.join(words)!r}"
        ) from None
    if len(numbers) == 1:
        if not 1 <= numbers[0] <= 10_000:
            raise InvalidValueError(f"--seeds must be 1 to 10000, got {numbers[0]}")
        return tuple(range(100, 100 + numbers[0]))
    return numbers


def _goals(words: tuple[str, ...]) -> tuple[str, ...] | int:
    return int(words[0]) if len(words) == 1 and words[0].isdecimal() else words


def carry_out(plan: Plan, out: Path, *, jobs: int = 1) -> list[dict[str, Any]]:
    """Drive what is missing, write tables and pictures; the rows of ``levels.csv``."""
    from scripts.closed_loop.plan import RUNS, SCHEMA
    from scripts.closed_loop.runs import load
    from scripts.jobs import run_jobs
    from scripts.output import RECIPE, locked_folder, machine, together, write_recipe
    from slam.evaluation.lost import FOUND_RULE, LOST_RULE
    from slam.guests import Limits, limited

    built = registry.build(plan.scene)  # wrong names are told before anything starts
    for name in plan.goals if isinstance(plan.goals, tuple) else ():
        if name not in built.goals:
            known = ", ".join(sorted(built.goals))
            raise UnknownNameError(f"scene '{plan.scene}' has no goal '{name}'. Known: {known}.")
    for name in plan.slams:
        limited(name, Limits())
    out = out.absolute()
    with locked_folder(out):
        settings = {"drive_schema": SCHEMA, **asdict(plan)}
        rules = {"lost_rule": LOST_RULE, "found_rule": FOUND_RULE}
        settings |= {**rules, "machine": machine()}
        if not (out / RECIPE).exists():  # else that of the tables there stays with them
            write_recipe(out, "drive", settings)
        wanted = list(plan.jobs())
        files = run_jobs([j for _, j in wanted], out / RUNS, processes=jobs, title="driving")
        runs = [load(files[job.name], identity) for identity, job in wanted]
        with together(out) as staged:
            write_recipe(staged, "drive", settings)
            return _write(staged, plan, runs)


def _write(out: Path, plan: Plan, runs: list[Driven]) -> list[dict[str, Any]]:
    from scripts.closed_loop import pictures, tables
    from scripts.closed_loop.plan import SCHEMA
    from scripts.comparison.folder import write_csv

    goals = [row for run in runs for row in tables.goal_rows(run)]
    rows = [tables.run_row(run) for run in runs]
    summary = tables.levels(goals, rows)
    write_csv(out / "goals.csv", goals, tables.GOAL_COLUMNS)
    write_csv(out / "runs.csv", rows, tables.RUN_COLUMNS)
    write_csv(out / "levels.csv", summary, tables.LEVEL_COLUMNS)
    whole = [row | {"results": run.goals} for row, run in zip(rows, runs, strict=True)]
    text = json.dumps({"schema": SCHEMA, "runs": whole}, indent=1, allow_nan=False)
    write_text(out / "runs.json", text + "\n")
    pictures.curves(out / "closed_loop.png", summary)
    shown = dict.fromkeys((plan.levels[0], plan.levels[-1]))
    picked = [
        [r for r in runs if (r.identity["dynamism"], r.identity["seed"]) == (level, plan.seeds[0])]
        for level in shown
    ]
    pictures.paths(out / "paths.png", picked)
    return summary


def _table(plan: Plan, rows: list[dict[str, Any]]) -> Table:
    """Success and precision."""
    from slam.evaluation.lost import LOST_RULE

    at = {(row["dynamism"], row["slam"]): row for row in rows}
    title = f"{plan.scene}: goals reached, %; median precision, cm; runs lost"
    caption = f"reached: within {plan.loop.tolerance_m:g} m in truth; lost: {LOST_RULE}"
    return level_table(
        title, caption, plan.levels, plan.slams, lambda level, slam: _cell(at[level, slam])
    )


def _cell(row: dict[str, Any]) -> str:
    precise = "-" if row["precision_m"] is None else f"{100.0 * row['precision_m']:.0f}"
    return f"{100.0 * row['success']:.0f} %; {precise}; {row['runs_lost']} of {row['runs']}"
