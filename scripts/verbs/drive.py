# SPDX-License-Identifier: Apache-2.0
"""``mobilia drive``: a robot steered by its SLAM's estimate, goal by goal, in rooms that move."""

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from scripts import options
from scripts.console import console, say
from scripts.names import check
from slam.errors import InvalidValueError
from slam.set_numbers import with_set


def drive(
    scene: Annotated[str, typer.Argument(help="A scene by name, or module:function.")],
    slam: Annotated[list[str], typer.Option(help="SLAMs by name or module:Class: --slam A B C.")],
    out: Annotated[Path, typer.Option(help="Folder of the runs and their tables.")],
    dynamism: Annotated[
        list[str] | None, typer.Option(help="Levels, start:stop:step or one by one; 0:1:0.25.")
    ] = None,
    motion: options.MotionLevels = None,
    change: options.ChangeLevels = None,
    crowd: options.CrowdOption = None,
    seeds: Annotated[
        list[str] | None, typer.Option(help="How many seeds, from 100 on; or several seeds.")
    ] = None,
    plan_on: Annotated[
        str, typer.Option(help="Plan paths on the layout, or on the SLAM's own map.")
    ] = "layout",
    seconds: Annotated[float, typer.Option(help="Time limit of each goal, s.")] = 90.0,
    goals: Annotated[
        list[str] | None, typer.Option(help="How many goals, or which by name; default all.")
    ] = None,
    every: Annotated[
        int | None, typer.Option(help="Use one scan in N; default about 9.4 a second.")
    ] = None,
    scanner: options.Scanner = "full",
    jobs: options.Jobs = 1,
    plan_only: options.PlanOnly = False,
    set_: options.Set = None,
) -> None:
    """Drive to a goal in every room, steered by each SLAM's estimate; truth only scores.

    Every SLAM gets the same worlds. If it is killed, the same command continues.

    [bold]mobilia drive arena --slam shunting odometry --dynamism 0:1:0.5 --seeds 3 --out
    out/drive[/bold]
    """
    slams = with_set(options.named(slam), set_ or [])
    check(slams, scene)
    from scripts import pace, workers
    from scripts.closed_loop.make import carry_out, said, success_table
    from scripts.closed_loop.plan import RUNS, Plan
    from scripts.pages.page import Page, Part, command, publish
    from sim.loop import LoopConfig

    workers.check_jobs(jobs)
    axis, at, held = options.axis_levels(dynamism, motion, change)
    scans, wanted = options.every_of(scanner, every, 4), options.named(goals or [])
    plan = Plan(
        scene=scene,
        slams=slams,
        axis=axis,
        levels=at,
        **held,
        crowd=crowd,
        seeds=_seeds(options.named(seeds or ["5"])),
        goals=int(wanted[0]) if len(wanted) == 1 and wanted[0].isdecimal() else wanted,
        loop=LoopConfig(plan_on=plan_on, limit_s=seconds, scans=scans),
        scanner=scanner,
    )
    missing = [job for _, job in plan.jobs() if not (out / RUNS / job.file_name()).exists()]
    pace.announce(f"{len(missing)} drives", [job.work() for job in missing], jobs)
    if plan_only:
        return
    started = time.perf_counter()
    rows = carry_out(plan, out, jobs=jobs)
    table = success_table(plan, rows)
    console.print(table)
    parts = [
        Part(title="Goals reached", picture="closed_loop.png", table=table),
        Part(title="Ways driven", picture="paths.png"),
    ]
    publish(out, Page(
        title=f"{scene}: steered by its SLAM", said=said(plan, rows), parts=parts,
        next={
            "The same rooms on a tour that its errors do not steer:": command(
                "compare", "--slam", *slams, "--scene", scene, "--out", "out/compare"
            ),
            "Both in one report:": command("report", "out/compare", "--drive", out),
        },
        settings=asdict(plan),
    ))  # fmt: skip
    say(f"{escape(str(out))} ({time.perf_counter() - started:.0f} s)")


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
        options.whole("--seeds", numbers[0], 1, 10_000)
        return tuple(range(100, 100 + numbers[0]))
    return numbers
