# SPDX-License-Identifier: Apache-2.0
"""Closed-loop drives as a study (``scripts.engine``): their tables and pictures."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.table import Table

import scenes
from scenes import registry
from scenes.scene import Scene
from scripts import engine, figures
from scripts.closed_loop import tables
from scripts.closed_loop.plan import RUNS, SCHEMA, DrivePlan
from scripts.closed_loop.runs import DrivenRun, load
from scripts.closed_loop.tables import LEVELS, TABLE
from scripts.comparison.tables import Row, write_checked, write_csv
from scripts.console import level_table
from scripts.engine import Files, Stage, Study
from scripts.figures import COLORS, color_of, save, styled
from sim.view.draw import Picture
from sim.view.mapview import MapView
from sim.world.world import World
from slam.errors import UnknownNameError
from slam.evaluation.lost import FOUND_RULE, LOST_RULE
from slam.frames import Float

PX_PER_M = 40
PALE = 0.35  # of the colour of what can move
MARKS = {"reached": "#168c5a", "wrong": "#ce2c3c", "given up": "#8a8f98", "failed": "#20242c"}


def carry_out(plan: DrivePlan, out: Path, *, jobs: int = 1) -> list[Row]:
    """Drive what is missing, write tables and pictures; the rows of ``levels.csv``."""
    check_goals(plan)
    return engine.carry_out(study(plan), out, jobs=jobs)


def check_goals(plan: DrivePlan) -> None:
    """``UnknownNameError`` for a goal that the scene has not."""
    names = plan.goals if isinstance(plan.goals, tuple) else ()
    known = registry.build(plan.scene).goals if names else ()
    for name in names:
        if name not in known:
            raise UnknownNameError(
                f"scene '{plan.scene}' has no goal '{name}'. Known: {', '.join(sorted(known))}."
            )


def study(plan: DrivePlan) -> Study[list[Row]]:
    """All of a drive."""
    wanted = list(plan.jobs())

    def write(folder: Path, done: Files) -> list[Row]:
        return _write(folder, plan, [load(done[job.name], who) for who, job in wanted])

    rules = {"lost_rule": LOST_RULE, "found_rule": FOUND_RULE}
    return Study(
        command="drive",
        settings={"drive_schema": SCHEMA, **asdict(plan), **rules},
        slams=plan.slams,
        scenes=(plan.scene,),
        stages=[Stage(title="driving", folder=RUNS, jobs=[job for _, job in wanted])],
        write=write,
    )


def _write(out: Path, plan: DrivePlan, runs: list[DrivenRun]) -> list[Row]:
    goals = [row for run in runs for row in tables.goal_rows(run)]
    rows = [tables.run_row(run) for run in runs]
    summary = tables.levels(goals, rows)
    write_csv(out / "goals.csv", goals, tables.GOAL_COLUMNS, plan.axis)
    write_csv(out / "runs.csv", rows, tables.RUN_COLUMNS, plan.axis)
    write_checked(out / LEVELS, summary, TABLE, plan.axis)
    curves(out / "closed_loop.png", summary, plan.axis)
    shown = dict.fromkeys((plan.levels[0], plan.levels[-1]))
    picked = [
        [r for r in runs if (r.identity["dynamism"], r.identity["seed"]) == (level, plan.seeds[0])]
        for level in shown
    ]
    paths(out / "paths.png", picked, plan.axis)
    return summary


def said(plan: DrivePlan, rows: list[Row]) -> list[str]:
    """Goals reached by each SLAM at the lowest and the highest level."""
    lines = []
    for level in dict.fromkeys((plan.levels[0], plan.levels[-1])):
        own = [row for row in rows if row["dynamism"] == level]
        told = ", ".join(f"`{r['slam']}` reached {r['reached']} of {r['goals']} goals" for r in own)
        lines.append(f"At {plan.axis} {level:g} {told}.")
    return lines


def success_table(plan: DrivePlan, rows: list[Row]) -> Table:
    """Success and precision, to be printed."""
    at = {(row["dynamism"], row["slam"]): row for row in rows}
    title = f"{plan.scene}: goals reached, %; median precision, cm; runs lost"
    caption = f"reached: within {plan.loop.tolerance_m:g} m in truth; lost: {LOST_RULE}"
    return level_table(
        title, caption, plan.levels, plan.slams, lambda level, slam: _cell(at[level, slam]),
        plan.axis,
    )  # fmt: skip


def _cell(row: Row) -> str:
    precise = "-" if row["precision_m"] is None else f"{100.0 * row['precision_m']:.0f}"
    return f"{100.0 * row['success']:.0f} %; {precise}; {row['runs_lost']} of {row['runs']}"


@styled()
def curves(path: Path, levels: Sequence[Row], axis: str = "dynamism") -> None:
    """``closed_loop.png``: a panel each for success and precision, with 95 % intervals."""
    scene, names = levels[0]["scene"], list(dict.fromkeys(row["slam"] for row in levels))
    ticks = sorted({row["dynamism"] for row in levels})
    figure = Figure(figsize=(10.0, 4.2))
    panels = (
        ("success", "goals reached, %", 100.0, 103.0),
        ("precision_m", "distance to the goal when believed reached, m", 1.0, None),
    )
    for ax, (key, label, factor, top) in zip(figure.subplots(1, 2), panels, strict=True):
        for name in names:
            points = [
                (row["dynamism"] + figures.apart(name, names, ticks),
                 *(factor * row[f"{key}{end}"] for end in ("", "_low", "_high")))
                for row in levels
                if row["slam"] == name and row[key] is not None
            ]  # fmt: skip
            figures.line(ax, points, color_of(name, names), figures.marker(name, names), name)
        figures.level_axis(ax, ticks, axis)
        ax.set(ylim=(0.0, top), ylabel=label, title=f"{scene}: with 95 % intervals")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=len(names), frameon=False, fontsize=9
    )
    save(figure, path)


@styled({"axes.grid": False})
def paths(path: Path, rows: Sequence[Sequence[DrivenRun]], axis: str = "dynamism") -> None:
    """``paths.png``: runs as panels, true path over the room as it was at the start."""
    first = rows[0][0].identity
    scene = scenes.build(first["scene"], 0)
    xmin, ymin, xmax, ymax = scene.bounds
    wide = min(7.0, 20.0 / len(rows[0]))
    high = wide * (ymax - ymin) / (xmax - xmin) + 0.5
    figure = Figure(figsize=(wide * len(rows[0]), high * len(rows) + 0.4))
    axes = np.atleast_2d(figure.subplots(len(rows), len(rows[0]), squeeze=False))
    for r, runs in enumerate(rows):
        world = World(runs[0].identity["scene"], seed=runs[0].identity["seed"], dynamism=0.0)
        size = (round((xmax - xmin + 0.6) * PX_PER_M), round((ymax - ymin + 0.6) * PX_PER_M))
        plan = MapView(world.scene, *size)
        room = _room(plan, world.mover_poses())
        for c, run in enumerate(runs):
            _panel(axes[r, c], run, room, plan, world.scene)
            who = run.identity
            level = f"{axis} {who['dynamism']:g}"
            axes[r, c].set_title(f"{who['slam']}, {level}, seed {who['seed']}", fontsize=9)
    figure.legend(handles=_legend(), loc="outside lower center", ncols=7, frameon=False)
    save(figure, path)


def _room(view: MapView, poses: Float) -> Picture:
    """What stays, and pale what may not: it stood there at the start, the robot drove later."""
    still = view.draw(np.full_like(poses, np.nan)).astype(np.float64)
    whole = view.draw(poses).astype(np.float64)
    return np.round(still + PALE * (whole - still)).astype(np.uint8)


def _panel(ax: Axes, run: DrivenRun, room: Any, plan: MapView, scene: Scene) -> None:
    ax.imshow(room, interpolation="antialiased", alpha=0.75)
    for name, dashes in (("believed", ":"), ("true", "-")):
        if len(run.arrays[name]):
            pixels = plan.to_pixels(run.arrays[name][:, :2].copy())
            color = "#1f61be" if name == "believed" else COLORS["truth"]
            ax.plot(pixels[:, 0], pixels[:, 1], dashes, color=color, lw=1.2)
    for k, goal in enumerate(run.goals):
        place = np.array([scene.goals[goal["goal"]]], dtype=np.float64)
        x, y = plan.to_pixels(place)[0].tolist()
        ax.plot(x, y, "o", color=MARKS[goal["outcome"]], ms=11, mec="white")
        ax.text(x, y, str(k + 1), color="white", ha="center", va="center", fontsize=8)
    ax.set(xlim=(0, room.shape[1]), ylim=(room.shape[0], 0))
    ax.axis("off")


def _legend() -> list[Line2D]:
    lines = [
        Line2D([], [], color=COLORS["truth"], label="true path"),
        Line2D([], [], color="#1f61be", ls=":", label="believed path"),
    ]
    lines += [Line2D([], [], ls="", label="pale: what can move, at the start")]
    return lines + [
        Line2D([], [], color=color, marker="o", ls="", label=outcome)
        for outcome, color in MARKS.items()
    ]
