# SPDX-License-Identifier: Apache-2.0
"""``mobilia compare``: which SLAM bears how much dynamism, on the same frames for everyone."""

from __future__ import annotations

import re
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
from scripts.verbs.generate import sweep
from slam.errors import InvalidValueError
from slam.guests.limits import Limits
from slam.variants import PIPE, with_set

if TYPE_CHECKING:
    from scripts.comparison.plan import Plan
    from scripts.jobs import Job

BETWEEN = re.compile(r",(?![^{]*\})")  # a comma outside braces


def compare(
    slam: Annotated[
        list[str], typer.Option(help="SLAMs, by name, module:Class or pipe:COMMAND: --slam A B C.")
    ],
    out: Annotated[Path, typer.Option(help="Folder of the comparison.")],
    scene: Annotated[list[str] | None, typer.Option(help="Scenes; default arena office.")] = None,
    dynamism: Annotated[
        list[str] | None, typer.Option(help="Levels, as start:stop:step or one by one.")
    ] = None,
    seeds: Annotated[int, typer.Option(help="Seeds at every level, the same at each.")] = 10,
    first_seed: Annotated[
        int, typer.Option(help="The first of them; the SLAMs here were tuned on 0 to 19.")
    ] = 100,
    seconds: Annotated[float, typer.Option(help="Length of a run, s.")] = 60.0,
    every: Annotated[
        int | None, typer.Option(help="One scan in so many is used; default about 4.7 a second.")
    ] = None,
    scanner: Scanner = "full",
    scan_limit: Annotated[
        float, typer.Option(help="After which a SLAM from outside counts as hung at a scan, s.")
    ] = Limits.scan_s,
    jobs: Annotated[int, typer.Option(help="Processes of this machine.")] = 1,
    cluster: Annotated[
        str | None, typer.Option(help="Or a Dask scheduler, tcp://host:port, that shares --out.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", help="[SLAM.]PATH=VALUE, see mobilia config SLAM; repeatable."),
    ] = None,
) -> None:
    """Run SLAMs on the same simulated runs and write tables of how they bear dynamism.

    Killed at any time, the same command goes on from there; so does one with a SLAM more.

    [bold]mobilia compare --slam shunting ekf odometry --scene arena --dynamism 0:1:0.5 --seeds 3
    --out out/compare[/bold]
    """
    if isinstance(seeds, bool) or not 1 <= seeds <= 10_000:
        raise InvalidValueError(f"--seeds must be 1 to 10000, got {seeds}")
    slams, rooms = with_set(named(slam), set_ or []), named(scene or ["arena", "office"])
    check(slams, *rooms)
    from scripts import workers
    from scripts.comparison.plan import Plan

    workers.check_jobs(jobs)
    plan = Plan(
        slams=slams,
        scenes=rooms,
        levels=levels(dynamism or ["0:1:0.25"]),
        seeds=tuple(range(first_seed, first_seed + seeds)),
        seconds=seconds,
        every=every_of(scanner, every, 8),
        scanner=scanner,
        scan_limit_s=scan_limit,
    )
    started = time.perf_counter()
    rows = carry_out(plan, out, jobs=jobs, cluster=cluster)
    spent_s = time.perf_counter() - started
    for name in plan.scenes:
        console.print(_table(plan, name, rows))
    console.print(
        f"{escape(str(out))}: runs.csv, levels.csv, paired.csv, runs/ ({spent_s:.0f} s)",
        soft_wrap=True,
    )


def named(values: list[str]) -> tuple[str, ...]:
    """Words may also be joined by commas, but for the command of a pipe, which may hold some, and
    inside the braces of a variant."""
    parts = ([value] if value.startswith(PIPE) else BETWEEN.split(value) for value in values)
    return tuple(word for words in parts for word in words if word)


def levels(values: list[str]) -> tuple[float, ...]:
    """``["0:1:0.5"]`` or ``["0", "0.5,1"]`` -> (0, 0.5, 1)."""
    found: list[float] = []
    for word in named(values):
        if ":" in word:
            found += sweep(word, "--dynamism")
            continue
        try:
            found.append(float(word))
        except ValueError:
            raise InvalidValueError(
                f"--dynamism must be numbers or start:stop:step, got {word!r}"
            ) from None
    return tuple(found)


def carry_out(
    plan: Plan, out: Path, *, jobs: int = 1, cluster: str | None = None
) -> list[dict[str, Any]]:
    """Make what is missing and write the tables; the rows of ``runs.csv``."""
    from scripts.comparison import folder as files
    from scripts.comparison import tables
    from scripts.comparison.columns import COLUMNS
    from scripts.comparison.plan import ENTRIES, RECORDINGS
    from scripts.jobs import run_jobs
    from scripts.output import RECIPE, locked_folder, machine, together, write_recipe
    from slam.evaluation.lost import LOST_RULE
    from slam.guests import limited

    for name in plan.scenes:
        registry.build(name)  # wrong names are told before anything starts
    for name in plan.slams:
        limited(name, Limits())
    out = out.absolute()
    with locked_folder(out):
        settings = {"compare_schema": files.SCHEMA, **asdict(plan), "lost_rule": LOST_RULE}
        settings["machine"] = machine()
        if not (out / RECIPE).exists():  # else that of the tables there stays with them
            write_recipe(out, "compare", settings)
        simulations, entries = plan.recordings(), list(plan.entries())
        ways: dict[str, Any] = {"processes": jobs, "cluster": cluster}
        recordings = run_jobs(simulations.values(), out / RECORDINGS, title="simulating", **ways)
        only: list[Job] = [job for _, _, job in entries]
        done = run_jobs(only, out / ENTRIES, title="running SLAMs", **ways)
        with together(out) as staged:
            rows: list[dict[str, Any]] = []
            for run in plan.runs():
                own = {name: done[job.name] for its, name, job in entries if its == run}
                merged = files.merge(staged / "runs" / f"{run.name}.npz", recordings[run.name], own)
                about = asdict(run) | _about(recordings[run.name])
                rows += [about | row for row in merged]
            files.write_csv(staged / files.RUNS, rows, COLUMNS)
            files.write_json(staged / files.RUNS_JSON, rows)
            files.write_csv(staged / files.LEVELS, tables.levels(rows), tables.LEVEL_COLUMNS)
            files.write_csv(staged / files.PAIRED, tables.pairs(rows), tables.PAIRED_COLUMNS)
            write_recipe(staged, "compare", settings)
    return rows


def _about(recording: Path) -> dict[str, float]:
    """What a run itself was like: the columns ``DRIVES``."""
    from scripts.comparison.recording import load
    from scripts.metrics.table import DRIVES
    from slam.frames import BeamClass

    drive = load(recording)
    truth = drive.truth()
    values = (
        float(truth.stamps_ns[-1] - truth.stamps_ns[0]) / 1e9,
        truth.length_m(),
        drive.share_of_returns(BeamClass.MOVING),
        drive.share_of_returns(BeamClass.SEMI_STATIC),
    )
    return dict(zip(DRIVES, values, strict=True))


def _table(plan: Plan, scene: str, rows: list[dict[str, Any]]) -> Table:
    """Median error and runs lost."""
    from scripts.comparison import tables
    from slam.evaluation.lost import LOST_RULE

    summary = {
        (row["dynamism"], row["slam"], row["metric"]): row["value"]
        for row in tables.levels([row for row in rows if row["scene"] == scene])
    }

    def cell(level: float, slam: str) -> str:
        ate_cm = 100.0 * summary[level, slam, "ate_unaligned_m"]
        lost = round(summary[level, slam, "lost"] * len(plan.seeds))
        return f"{ate_cm:.2f} ({lost})"

    title = f"{scene}: median unaligned ATE in cm (runs lost of {len(plan.seeds)})"
    return level_table(title, f"lost: {LOST_RULE}", plan.levels, plan.slams, cell)
