# SPDX-License-Identifier: Apache-2.0
"""``mobilia benchmark``: all tracks, every SLAM, one leaderboard."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from scripts.console import console, note, say
from scripts.names import check
from scripts.options import Cluster, Jobs, PlanOnly, Set, named
from slam.errors import MissingPathError
from slam.set_numbers import with_set

if TYPE_CHECKING:
    from scripts.benchmark.board import Board

UNFAIR = "* does not count: no oracle holds there"
MOST_COLUMNS = 5  # SLAMs in the table of the terminal; the page has all


def benchmark(
    out: Annotated[Path, typer.Option(help="Folder of the benchmark.")] = Path("out/benchmark"),
    slam: Annotated[
        list[str] | None,
        typer.Option(
            help="SLAMs, by name, module:Class or pipe:COMMAND: --slam A B C; default all that are "
            "installed. odometry and an oracle are always there."
        ),
    ] = None,
    subject: Annotated[
        str | None,
        typer.Option(help="The SLAM that the sentence on top is about; default the first."),
    ] = None,
    tracks: Annotated[
        list[str] | None, typer.Option(help="Tracks, by name: --tracks A B C; default all.")
    ] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Three levels, one seed of the tracks that ship, the subject alone: minutes.",
        ),
    ] = False,
    train: Annotated[
        bool, typer.Option("--train", help="On the seeds for tuning, not on those that count.")
    ] = False,
    seeds: Annotated[
        int | None, typer.Option(help="Seeds at every level; default 6, with --quick 1.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Length of a run, s, to try out; default the track's own.")
    ] = None,
    days: Annotated[
        bool,
        typer.Option("--days", help="Also in buildings that go on over sessions: days.csv."),
    ] = False,
    submit: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Also write OUT/submission_NAME.json of the subject."),
    ] = None,
    merge: Annotated[
        list[Path] | None,
        typer.Option(help="Submissions of others, or published runs, to put into the leaderboard."),
    ] = None,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    plan_only: PlanOnly = False,
    set_: Set = None,
) -> None:
    """Find out on which track, and from which level on, a SLAM gets lost.

    Writes leaderboard.json, leaderboard.csv and leaderboard.md, and a folder of mobilia compare for
    each track, which mobilia report, render and blame take. If it is killed, the same command
    continues. With a SLAM added, only that SLAM runs.

    [bold]mobilia benchmark --quick --slam my_package:MySlam --jobs 2[/bold]
    """
    slams = named(slam or [])
    check((*slams, *([subject] if subject else [])))
    from scripts import pace, workers
    from scripts.benchmark import runs_file
    from scripts.benchmark.make import QUICK_SEEDS, SEEDS, carry_out, plans_of, wanted_of
    from scripts.benchmark.tracks import chosen
    from scripts.comparison.plan import ahead

    workers.check_jobs(jobs)
    for path in merge or ():
        if not path.exists():
            raise MissingPathError(path, "no such file")
    given = [runs_file.read(path) for path in merge or ()]
    others = [one for one in given if one.name]
    ship = next((one for one in reversed(given) if not one.name), None) or runs_file.read()
    count = seeds if seeds is not None else QUICK_SEEDS if quick else SEEDS
    runs = tuple(dict.fromkeys((*slams, *([subject] if subject else []))))
    numbered = dict(zip(runs, with_set(runs, set_ or []), strict=True))
    asked = chosen(named(tracks or []))
    if quick and not tracks:
        asked = ship.quick(asked) or asked
    wanted = wanted_of(
        asked, [numbered[name] for name in slams],
        None if subject is None else numbered[subject],
        train=train, seeds=count, quick=quick, seconds=seconds, submit=submit, days=days,
    )  # fmt: skip
    parts = [ahead(plan, out / name) for name, plan in plans_of(wanted, ship).items()]
    works = [job.work() for missing, _ in parts for job in missing]
    what = f"{len(works)} of {sum(count for _, count in parts)} jobs, tracks: {len(parts)}"
    pace.announce(what + (", buildings over days besides" if days else ""), works, jobs)
    if plan_only:
        return
    started = time.perf_counter()
    board = carry_out(wanted, out, jobs=jobs, cluster=cluster, merge=others, shared=ship)
    _tell(board, out, time.perf_counter() - started)


def _tell(board: "Board", out: Path, spent_s: float) -> None:
    from scripts.benchmark.board import lost_from_words
    from scripts.pages.page import Page, Part, command, publish

    table = Table(
        title="level from which half of the runs are lost", title_justify="left",
        caption=None if all(fair["counts"] for fair in board.fair.values()) else UNFAIR,
        caption_justify="left",
    )  # fmt: skip
    table.add_column("track", no_wrap=True)
    shown = board.slams if len(board.slams) <= MOST_COLUMNS else [board.subject]
    for name in shown:
        table.add_column(escape(name), justify="right", overflow="fold")
    for track in board.tracks:
        mark = "" if board.fair[track.name]["counts"] else " *"
        cells = (escape(lost_from_words(board.row(track.name, name))) for name in shown)
        table.add_row(track.name + mark, *cells)
    console.print(table)
    for name, why in board.missing.items():
        note(f"{name} is not installed: {why}")
    for name, one in board.merged.items():
        note(f"{name} was submitted, as SLAM {one['slam']}: its results are the submitter's word")
    for failure in board.failures():
        note(failure)
    unfair = f"{table.caption}." if table.caption else ""
    parts = [Part(title="Lost from which level", note=unfair, table=table)]
    places = _places(board)
    if places is not None:
        console.print(places)
        parts.insert(0, Part(title=f"Ranking {places.title}", table=places))
    say(f"To cite: {escape(board.cite())}")
    if board.days_page:
        _tell_days(out)
    reports = [command("report", out / track.name) for track in board.tracks[:3]]
    publish(out, Page(
        title=f"{board.subject} on {len(board.tracks)} track{'s' * (len(board.tracks) > 1)}",
        said=board.said(), parts=parts,
        next={
            "A track run by run, and what misled it:": "\n".join(reports),
            "Hand it in:": command("benchmark", "--slam", board.subject, "--submit", "NAME"),
        },
        settings={key: board.head[key] for key in ("seeds_of", "seeds", "levels_run", "world")},
    ))  # fmt: skip
    say(f"{escape(str(out))} ({spent_s:.0f} s)")


def _places(board: "Board") -> Table | None:
    from scripts.benchmark.board import RANKED_HEADS

    rows = board.ranked()
    if len(rows) < 2:
        return None
    table = Table(title=f"on the same {board.ranking[0]['runs']} runs", title_justify="left")
    for k, head in enumerate(RANKED_HEADS):
        table.add_column(head, justify="left" if k == 1 else "right")
    for row in rows:
        table.add_row(*map(escape, row), style="bold" if row[1] == board.subject else None)
    return table


def _tell_days(out: Path) -> None:
    from scripts.benchmark.days import NAMES, read
    from scripts.report import score_tables

    for group, rows in score_tables.groups(read(out / NAMES[1])).items():
        console.print(f"Over days, {score_tables.where(group)}, {score_tables.size(rows)}:")
        for line in score_tables.sentences(rows):
            say(escape(line))
