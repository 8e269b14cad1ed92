# SPDX-License-Identifier: Apache-2.0
"""``mobilia compare``: which SLAM bears how much dynamism, on the same frames for everyone."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from scripts import options
from scripts.console import console, fact, say
from scripts.names import check
from slam.guests import Limits

if TYPE_CHECKING:
    from scripts.comparison.plan import Plan


def compare(
    slam: Annotated[
        list[str], typer.Option(help="SLAMs, by name, module:Class or pipe:COMMAND: --slam A B C.")
    ],
    out: Annotated[Path, typer.Option(help="Folder of the comparison.")],
    oracle: options.Oracles = None,
    scene: Annotated[list[str] | None, typer.Option(help="Scenes; default arena office.")] = None,
    dynamism: Annotated[
        list[str] | None, typer.Option(help="Levels, as start:stop:step or one by one.")
    ] = None,
    motion: options.MotionLevels = None,
    change: options.ChangeLevels = None,
    people: options.PeopleLevels = None,
    crowd: options.CrowdOption = None,
    seeds: Annotated[int, typer.Option(help="Seeds at every level, the same at each.")] = 10,
    first_seed: Annotated[
        int, typer.Option(help="The first of them; the SLAMs here were tuned on 0 to 19.")
    ] = 100,
    seconds: Annotated[float, typer.Option(help="Length of a run, s.")] = 60.0,
    every: Annotated[
        int | None, typer.Option(help="Use one scan in N; default about 4.7 a second.")
    ] = None,
    scanner: options.Scanner = "full",
    sessions: Annotated[
        int | None,
        typer.Option(
            help="Also let the SLAMs live in buildings of N sessions, one beside each run. From "
            "each session to the next the share --change of what can move is put elsewhere.",
            metavar="N",
        ),
    ] = None,
    scan_limit: Annotated[
        float, typer.Option(help="Time limit of a scan for a SLAM from outside, s.")
    ] = Limits.scan_s,
    jobs: options.Jobs = 1,
    cluster: options.Cluster = None,
    plan_only: options.PlanOnly = False,
    set_: options.Set = None,
) -> None:
    """Run SLAMs on the same simulated runs; write tables of error against dynamism.

    With levels of --motion or --change instead, the other of the two is at 0 unless it is given;
    with --people, motion is 0.5 and change 0.
    It ends with a sentence about the SLAM named first: from which level on it is lost.
    If it is killed, the same command continues. With a SLAM added, only that SLAM runs.
    With --sessions it also says how the SLAMs do in a map some sessions old.

    [bold]mobilia compare --slam shunting ekf odometry --scene arena --dynamism 0:1:0.5 --seeds 3
    --out out/compare[/bold]
    """
    options.whole("--seeds", seeds, 1, 10_000)
    slams = options.with_oracles(options.named(slam), oracle, set_)
    rooms = options.named(scene or ["arena", "office"])
    check(slams, *rooms)
    from scripts import pace, workers
    from scripts.comparison.make import carry_out
    from scripts.comparison.plan import Plan, ahead

    workers.check_jobs(jobs)
    axis, at, held = options.axis_levels(dynamism, motion, change, people)
    plan = Plan(
        slams=slams,
        scenes=rooms,
        axis=axis,
        levels=at,
        **held,
        crowd=crowd,
        seeds=tuple(range(first_seed, first_seed + seeds)),
        seconds=seconds,
        every=options.every_of(scanner, every, 8),
        scanner=scanner,
        scan_limit_s=scan_limit,
        sessions=sessions,
    )
    missing, every_job = ahead(plan, out)
    runs = f"{len(plan.runs())} runs, {len(slams)} SLAMs on each"
    beside_ = ", buildings besides" if sessions is not None else ""
    pace.announce(
        f"{runs}: {len(missing)} of {every_job} jobs are to do{beside_}",
        [job.work() for job in missing], jobs,
    )  # fmt: skip
    if plan_only:
        return
    started = time.perf_counter()
    ways: dict[str, Any] = {"jobs": jobs, "cluster": cluster}
    if sessions is not None:
        from scripts.days.buildings import beside

        ways["more"] = beside(plan)
    rows = carry_out(plan, out, **ways)
    spent_s = time.perf_counter() - started
    tell(plan, rows)
    more = tell_ages(out) if sessions is not None else ""
    say(f"{escape(str(out))}: runs.csv, levels.csv, paired.csv, runs/{more} ({spent_s:.0f} s)")


def tell(plan: "Plan", rows: list[dict[str, Any]]) -> None:
    """Print the table of each scene, who failed and where, and the answer about the first SLAM."""
    from scripts.comparison.make import median_errors
    from scripts.report.answer import answer, failed, standing

    for name in plan.scenes:
        console.print(median_errors(plan, name, rows))
    for line in failed(rows, plan.axis):
        fact(line, bad=True)
    said = (answer(standing(rows, plan.slams[0], name, plan.axis)) for name in plan.scenes)
    for line in dict.fromkeys(said):
        fact(line)


def tell_ages(out: Path) -> str:
    """Print the scores of age of each scene and level; the names of their files."""
    from scripts.comparison.folder import read
    from scripts.comparison.schema import AGES, AGES_LEVELS
    from scripts.report import score_tables

    for group, rows in score_tables.groups(read(out).ages).items():
        console.print(score_tables.printed(group, rows))
        for line in score_tables.sentences(rows):
            fact(line)
    return f", {AGES}, {AGES_LEVELS}"
