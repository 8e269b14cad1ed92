# SPDX-License-Identifier: Apache-2.0
"""``mobilia benchmark``: all tracks, every SLAM, one leaderboard."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from scripts import options
from scripts.console import console, fact, note, say
from scripts.names import check
from scripts.options import named
from scripts.spec import SLAMS, command_line, names_of, option, part, spec
from slam.errors import MissingPathError
from slam.set_numbers import with_set

if TYPE_CHECKING:
    from scripts.benchmark.board import Board
    from scripts.pages.page import Part


UNFAIR = "* does not count: when it was published no oracle held there"
SAID = 2  # sentences over the pictures: the answer and the place; the rest is by the last table
MOST_COLUMNS = 5  # SLAMs in the table of the terminal; the page has all


@spec
class Benchmark:
    """Find out on which track, and from which level on, a SLAM gets lost.

    Writes leaderboard.json, leaderboard.csv and leaderboard.md, and a folder of mobilia compare for
    each track, which mobilia report, render and blame take. If it is killed, the same command
    continues. With a SLAM added, only that SLAM runs.

    [bold]mobilia benchmark --quick --slam my_package:MySlam --jobs 2[/bold]
    """

    out: Path = option("Folder of the benchmark.", Path("out/benchmark"), writes=True)
    slam: list[str] | None = option(
        "SLAMs, by name, module:Class or pipe:COMMAND: --slam A B C; default all that are "
        "installed. odometry and an oracle are always there.",
        complete=SLAMS,
        fills=("Plan.slams",),
    )
    subject: str | None = option(
        "The SLAM that the sentence on top is about; default the first.", complete=SLAMS
    )
    tracks: list[str] | None = option(
        "Tracks, by name: --tracks A B C; default all.",
        complete=names_of("scripts.benchmark.tracks:TRACKS"),
    )
    quick: bool = option(
        "Three levels, one seed of the tracks that ship, the subject alone: minutes.", False
    )
    train: bool = option("On the seeds for tuning, not on those that count.", False)
    seeds: int | None = option("Seeds at every level; default 6, with --quick 1.")
    seconds: float | None = option("Length of a run, s, to try out; default the track's own.")
    days: bool = option("Also in buildings that go on over sessions: days.csv.", False)
    submit: str | None = option(
        "Also write OUT/submission_NAME.json of the subject.", metavar="NAME"
    )
    merge: list[Path] | None = option(
        "Submissions of others, or published runs, to put into the leaderboard."
    )
    work: options.Work = part(options.Work)
    set_: list[str] | None = options.SET()

    def __call__(self) -> None:
        slams = named(self.slam or [])
        runs = tuple(dict.fromkeys((*slams, *([self.subject] if self.subject else []))))
        check(runs)
        from scripts import pace, workers
        from scripts.benchmark import runs_file
        from scripts.benchmark.make import QUICK_SEEDS, SEEDS, carry_out, plans_of, wanted_of
        from scripts.benchmark.tracks import chosen
        from scripts.comparison.plan import ahead
        from scripts.jobs import try_names
        from scripts.output import refuse_others

        workers.check_jobs(self.work.jobs)
        merge = self.merge or []
        for path in merge:
            if not path.exists():
                raise MissingPathError(path, "no such file")
        given = [runs_file.read(path) for path in merge]
        others = [one for one in given if one.name]
        ship = next((one for one in reversed(given) if not one.name), None) or runs_file.read()
        usual = QUICK_SEEDS if self.quick else SEEDS
        numbered = dict(zip(runs, with_set(runs, self.set_ or []), strict=True))
        asked = chosen(named(self.tracks or []))
        if self.quick and not self.tracks:
            asked = ship.quick(asked) or asked
        wanted = wanted_of(
            asked, [numbered[name] for name in slams],
            None if self.subject is None else numbered[self.subject],
            train=self.train, seeds=usual if self.seeds is None else self.seeds,
            quick=self.quick, seconds=self.seconds, submit=self.submit, days=self.days,
        )  # fmt: skip
        try_names(wanted.slams, ())
        refuse_others(self.out, "benchmark")
        parts = [ahead(plan, self.out / name) for name, plan in plans_of(wanted, ship).items()]
        works = [job.work() for missing, _ in parts for job in missing]
        what = f"{len(works)} of {sum(count for _, count in parts)} jobs, tracks: {len(parts)}"
        besides = ", buildings over days besides" if self.days else ""
        pace.announce(what + besides, works, self.work.jobs)
        if self.work.plan_only:
            return
        started = time.perf_counter()
        board = carry_out(
            wanted, self.out, jobs=self.work.jobs, cluster=self.work.cluster, merge=others,
            shared=ship,
        )  # fmt: skip
        _tell(board, self.out, time.perf_counter() - started)


def _tell(board: "Board", out: Path, spent_s: float) -> None:
    from scripts.benchmark.board import lost_from_words
    from scripts.pages.page import Part

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
        cells = (escape(lost_from_words(board.row(track.name, name))) for name in shown)
        table.add_row(board.head_of(track), *cells)
    console.print(table)
    for name, why in board.missing.items():
        note(f"{name} is not installed: {why}")
    for name, one in board.merged.items():
        note(f"{name} was submitted, as SLAM {one['slam']}: its results are the submitter's word")
    for failure in board.failures():
        note(failure)
    said, more = board.said()[:SAID], board.said()[SAID:]
    for line in more:
        fact(line)
    if table.caption:
        more.append(f"{table.caption}.")
    titles = ("On which track", "From which level on")
    parts = [Part(title=of, picture=p) for of, p in zip(titles, board.pictures, strict=False)]
    places = _places(board)
    if places is not None:
        console.print(places)
        parts.append(Part(title=f"Ranking {places.title}", table=places))
    parts.append(Part(title="Lost from which level", note=" ".join(more), table=table))
    say(f"To cite: {escape(board.cite())}")
    if board.days_page:
        _tell_days(out)
    _page(board, out, said, parts)
    say(f"{escape(str(out))} ({spent_s:.0f} s)")


def _page(board: "Board", out: Path, said: list[str], parts: list["Part"]) -> None:
    from scripts.benchmark.scores import worst
    from scripts.pages.page import Page, publish

    head = board.head
    then = {}
    if head["seconds"] is None and head["seeds_of"] == "test":  # else it is for trying out
        then["Hand it in:"] = command_line("benchmark", slam=board.subject, submit="NAME", out=out)
    reports = [
        command_line("report", folder=out / name) for name in worst(board.of(board.subject))[:3]
    ]
    publish(out, Page(
        title=f"{board.subject} on {len(board.tracks)} track{'s' * (len(board.tracks) > 1)}",
        said=said, parts=parts,
        next={
            "Run by run, and what misled it, where it did worst:": "\n".join(reports), **then,
        },
        settings={key: head[key] for key in ("seeds_of", "seeds", "levels_run", "world")},
    ))  # fmt: skip


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
