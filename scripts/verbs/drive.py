# SPDX-License-Identifier: Apache-2.0
"""``mobilia drive``: a robot steered by its SLAM's estimate, goal by goal, in rooms that move."""

import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from scripts import options
from scripts.console import console, say
from scripts.names import check, scene_name
from scripts.spec import REQUIRED, SCENES, SLAMS, argument, command_line, option, part, spec
from slam.errors import InvalidValueError
from slam.set_numbers import with_set

if TYPE_CHECKING:
    from scripts.closed_loop.plan import DrivePlan


@spec
class Drive:
    """Drive to a goal in every room, steered by each SLAM's estimate; truth only scores.

    Every SLAM gets the same worlds. If it is killed, the same command continues.

    [bold]mobilia drive arena --slam shunting odometry --dynamism 0:1:0.5 --seeds 3 --out
    out/drive[/bold]
    """

    scene: str = argument("A scene by name, or module:function.", REQUIRED, complete=SCENES)
    slam: list[str] = option(
        "SLAMs by name or module:Class: --slam A B C.", REQUIRED, complete=SLAMS,
        fills=("Plan.slams",),
    )  # fmt: skip
    out: Path = option("Folder of the runs and their tables.", REQUIRED, writes=True)
    levels: options.Levels = part(
        options.Levels, without=("people",), dynamism=option(
            "Levels, start:stop:step or one by one; 0:1:0.25.", fills=("Plan.levels",)
        ),
    )  # fmt: skip
    seeds: list[str] | None = option("How many seeds, from 100 on; or several seeds.")
    plan_on: str = option("Plan paths on the layout, or on the SLAM's own map.", "layout")
    seconds: float = option("Time limit of each goal, s.", 90.0, fills=("LoopConfig.limit_s",))
    goals: list[str] | None = option("How many goals, or which by name; default all.")
    every: int | None = option(
        "Use one scan in N; default about 9.4 a second.", fills=("LoopConfig.scans",)
    )
    scanner: str = options.SCANNER()
    work: options.Work = part(options.Work, without=("cluster",))
    set_: list[str] | None = options.SET()

    def plan(self) -> "DrivePlan":
        """What is to be driven; ``InvalidValueError`` for what cannot be."""
        slams = with_set(options.named(self.slam), self.set_ or [])
        check(slams, self.scene)
        from scripts import workers
        from scripts.closed_loop.plan import DrivePlan
        from sim.loop import LoopConfig

        workers.check_jobs(self.work.jobs)
        at = self.levels.of_plan()
        scans, goals = (
            options.every_of(self.scanner, self.every, 4),
            options.named(self.goals or []),
        )
        return DrivePlan(
            scene=self.scene,
            slams=slams,
            **at,
            seeds=_seeds(options.named(self.seeds or ["5"])),
            goals=int(goals[0]) if len(goals) == 1 and goals[0].isdecimal() else goals,
            loop=LoopConfig(plan_on=self.plan_on, limit_s=self.seconds, scans=scans),
            scanner=self.scanner,
        )

    def __call__(self) -> None:
        plan, out, jobs = self.plan(), self.out, self.work.jobs
        from scripts import engine, pace
        from scripts.closed_loop.make import check_goals, said, study, success_table
        from scripts.closed_loop.plan import RUNS
        from scripts.pages.page import Page, Part, publish

        check_goals(plan)
        asked = study(plan)
        engine.refuse(asked, out)
        missing = [job for _, job in plan.jobs() if not (out / RUNS / job.file_name()).exists()]
        pace.announce(f"{len(missing)} drives", [job.work() for job in missing], jobs)
        if self.work.plan_only:
            return
        started = time.perf_counter()
        rows = engine.carry_out(asked, out, jobs=jobs)
        table = success_table(plan, rows)
        console.print(table)
        parts = [
            Part(title="Goals reached", picture="closed_loop.png", table=table),
            Part(title="Ways driven", picture="paths.png"),
        ]
        compared = f"out/compare-{scene_name(plan.scene)}"
        held = {"motion": plan.motion, "change": plan.change, plan.axis: plan.levels}
        tour = command_line(
            "compare", slam=plan.slams, scene=plan.scene, **held, crowd=plan.crowd,
            seeds=max(plan.seeds) - min(plan.seeds) + 1, first_seed=min(plan.seeds),
            scanner=plan.scanner, out=compared,
        )  # fmt: skip
        publish(out, Page(
            title=f"{plan.scene}: steered by its SLAM", said=said(plan, rows), parts=parts,
            next={
                "The same rooms on a tour that its errors do not steer:": tour,
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
