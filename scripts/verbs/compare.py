# SPDX-License-Identifier: Apache-2.0
"""``mobilia compare``: which SLAM bears how much dynamism, on the same frames for everyone."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from scripts import options
from scripts.console import console, fact, say
from scripts.names import check
from scripts.spec import REQUIRED, SCENES, SLAMS, option, part, spec
from slam.guests import Limits

if TYPE_CHECKING:
    from scripts.comparison.plan import Plan


@spec
class Compare:
    """Run SLAMs on the same simulated runs; write tables of error against dynamism.

    With levels of --motion or --change instead, the other of the two is at 0 unless it is given;
    with --people, motion is 0.5 and change 0.
    It ends with a sentence about the SLAM named first: from which level on it is lost.
    If it is killed, the same command continues. With a SLAM added, only that SLAM runs.
    With --sessions it also says how the SLAMs do in a map some sessions old.

    [bold]mobilia compare --slam shunting ekf odometry --scene arena --dynamism 0:1:0.5 --seeds 3
    --out out/compare[/bold]
    """

    slam: list[str] = option(
        "SLAMs, by name, module:Class or pipe:COMMAND: --slam A B C.", REQUIRED,
        complete=SLAMS, fills=("Plan.slams",),
    )  # fmt: skip
    out: Path = option("Folder of the comparison.", REQUIRED, writes=True)
    oracle: list[str] | None = options.ORACLES()
    scene: list[str] | None = option(
        "Scenes; default arena office.", complete=SCENES, fills=("Plan.scenes",)
    )
    levels: options.Levels = part(options.Levels)
    seeds: int = option("Seeds at every level, the same at each.", 10)
    first_seed: int = option(
        "The first of them; the SLAMs here were tuned on 0 to 19.", 100,
        fills=("Seeds.seed",),
    )  # fmt: skip
    seconds: float = option("Length of a run, s.", 60.0)
    every: int | None = option("Use one scan in N; default about 4.7 a second.")
    scanner: str = options.SCANNER()
    sessions: int | None = option(
        "Also let the SLAMs live in buildings of N sessions, one beside each run. From "
        "each session to the next the share --change of what can move is put elsewhere.",
        metavar="N",
    )
    scan_limit: float = option(
        "Time limit of a scan for a SLAM from outside, s.", Limits.scan_s,
        fills=("Limits.scan_s",),
    )  # fmt: skip
    work: options.Work = part(options.Work)
    set_: list[str] | None = options.SET()

    def plan(self) -> "Plan":
        """What is to be compared; ``InvalidValueError`` for what cannot be."""
        options.whole("--seeds", self.seeds, 1, 10_000)
        slams = options.with_oracles(options.named(self.slam), self.oracle, self.set_)
        rooms = options.named(self.scene or ["arena", "office"])
        check(slams, *rooms)
        from scripts import workers
        from scripts.comparison.plan import Plan

        workers.check_jobs(self.work.jobs)
        return Plan(
            slams=slams,
            scenes=rooms,
            **self.levels.of_plan(),
            seeds=tuple(range(self.first_seed, self.first_seed + self.seeds)),
            seconds=self.seconds,
            every=options.every_of(self.scanner, self.every, 8),
            scanner=self.scanner,
            scan_limit_s=self.scan_limit,
            sessions=self.sessions,
        )

    def __call__(self) -> None:
        plan = self.plan()
        from scripts import engine, pace
        from scripts.comparison.make import study
        from scripts.comparison.plan import ahead
        from scripts.days.buildings import beside

        asked = study(plan, beside(plan) if plan.sessions is not None else None)
        engine.refuse(asked, self.out)
        missing, every_job = ahead(plan, self.out)
        n = len(plan.slams)
        runs = f"{len(plan.runs())} runs, {n} SLAM{'s' if n > 1 else ''} on each"
        besides = ", buildings besides" if plan.sessions is not None else ""
        told = f"{runs}: {len(missing)} of {every_job} jobs are to do{besides}"
        pace.announce(told, [job.work() for job in missing], self.work.jobs)
        if self.work.plan_only:
            return
        started = time.perf_counter()
        work = self.work
        rows = engine.carry_out(asked, self.out, jobs=work.jobs, cluster=work.cluster)
        spent_s = time.perf_counter() - started
        tell(plan, rows)
        more = tell_ages(self.out) if plan.sessions is not None else ""
        files = f"runs.csv, levels.csv, paired.csv, runs/{more}"
        say(f"{escape(str(self.out))}: {files} ({spent_s:.0f} s)")


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
