# SPDX-License-Identifier: Apache-2.0
"""``mobilia compare``: which SLAM bears how much dynamism, on the same frames for everyone."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from scripts.checked import whole
from scripts.console import console, fact
from scripts.knobs import ChangeLevels, CrowdOption, MotionLevels, chosen
from scripts.names import check
from scripts.oracle_option import Oracles, with_oracles
from scripts.process_options import Cluster, Jobs
from scripts.scanner_option import Scanner, every_of
from scripts.set_option import Set
from scripts.verbs.generate import sweep
from slam.errors import InvalidValueError
from slam.guests.limits import Limits
from slam.variants import ORACLE, PIPE

if TYPE_CHECKING:
    from scripts.comparison.plan import Plan

BETWEEN = re.compile(r",(?![^{]*\}|[^(]*\))")  # a comma outside braces and brackets


def compare(
    slam: Annotated[
        list[str], typer.Option(help="SLAMs, by name, module:Class or pipe:COMMAND: --slam A B C.")
    ],
    out: Annotated[Path, typer.Option(help="Folder of the comparison.")],
    oracle: Oracles = None,
    scene: Annotated[list[str] | None, typer.Option(help="Scenes; default arena office.")] = None,
    dynamism: Annotated[
        list[str] | None, typer.Option(help="Levels, as start:stop:step or one by one.")
    ] = None,
    motion: MotionLevels = None,
    change: ChangeLevels = None,
    crowd: CrowdOption = None,
    seeds: Annotated[int, typer.Option(help="Seeds at every level, the same at each.")] = 10,
    first_seed: Annotated[
        int, typer.Option(help="The first of them; the SLAMs here were tuned on 0 to 19.")
    ] = 100,
    seconds: Annotated[float, typer.Option(help="Length of a run, s.")] = 60.0,
    every: Annotated[
        int | None, typer.Option(help="Use one scan in N; default about 4.7 a second.")
    ] = None,
    scanner: Scanner = "full",
    scan_limit: Annotated[
        float, typer.Option(help="Time limit of a scan for a SLAM from outside, s.")
    ] = Limits.scan_s,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    set_: Set = None,
) -> None:
    """Run SLAMs on the same simulated runs; write tables of error against dynamism.

    With levels of --motion or --change instead, the other of the two is at 0 unless it is given.
    It ends with a sentence about the SLAM named first: from which level on it is lost.
    If it is killed, the same command continues. With a SLAM added, only that SLAM runs.

    [bold]mobilia compare --slam shunting ekf odometry --scene arena --dynamism 0:1:0.5 --seeds 3
    --out out/compare[/bold]
    """
    whole("--seeds", seeds, 1, 10_000)
    slams = with_oracles(named(slam), oracle, set_)
    rooms = named(scene or ["arena", "office"])
    check(slams, *rooms)
    from scripts import workers
    from scripts.comparison.make import carry_out
    from scripts.comparison.plan import Plan

    workers.check_jobs(jobs)
    axis, at, held = axis_levels(dynamism, motion, change)
    plan = Plan(
        slams=slams,
        scenes=rooms,
        axis=axis,
        levels=at,
        **held,
        crowd=crowd,
        seeds=tuple(range(first_seed, first_seed + seeds)),
        seconds=seconds,
        every=every_of(scanner, every, 8),
        scanner=scanner,
        scan_limit_s=scan_limit,
    )
    started = time.perf_counter()
    rows = carry_out(plan, out, jobs=jobs, cluster=cluster)
    spent_s = time.perf_counter() - started
    tell(plan, rows)
    console.print(
        f"{escape(str(out))}: runs.csv, levels.csv, paired.csv, runs/ ({spent_s:.0f} s)",
        soft_wrap=True,
    )


def tell(plan: Plan, rows: list[dict[str, Any]]) -> None:
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


def named(values: list[str]) -> tuple[str, ...]:
    """Words may also be joined by commas, but for the command of a pipe, which may hold some, and
    inside the braces of a variant and the brackets of an oracle."""
    whole = (PIPE, ORACLE + PIPE)
    parts = ([value] if value.startswith(whole) else BETWEEN.split(value) for value in values)
    return tuple(word for words in parts for word in words if word)


def axis_levels(
    dynamism: list[str] | None, motion: list[str] | None, change: list[str] | None
) -> tuple[str, tuple[float, ...], dict[str, Any]]:
    """The axis, its levels and what is held, from the three options; default 0 to 1 dynamism."""
    given = {"dynamism": dynamism, "motion": motion, "change": change}
    axis, at, held = chosen(*(levels(values or [], f"--{k}") for k, values in given.items()))
    return axis, at or levels(["0:1:0.25"]), dict(held)


def levels(values: list[str], option: str = "--dynamism") -> tuple[float, ...]:
    """``["0:1:0.5"]`` or ``["0", "0.5,1"]`` -> (0, 0.5, 1)."""
    found: list[float] = []
    for word in named(values):
        if ":" in word:
            found += sweep(word, option)
            continue
        try:
            found.append(float(word))
        except ValueError:
            raise InvalidValueError(
                f"{option} must be numbers or start:stop:step, got {word!r}"
            ) from None
    return tuple(found)
