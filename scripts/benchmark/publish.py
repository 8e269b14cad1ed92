# SPDX-License-Identifier: Apache-2.0
"""Fill the pages from the runs that ship: ``python -m scripts.benchmark.publish [out/days]``.

docs/benchmark.md gets the tracks and the ranking, docs/leaderboard.md what was lost at the top of
each track, docs/pictures both as pictures, docs/results every run as CSV. The folder of
``scripts.benchmark.days`` goes to ``docs/results``, as ``days.json`` and ``days.csv``; the section
at the end of docs/leaderboard.md is made from it.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scripts.benchmark import days, picture
from scripts.benchmark.board import RANKED_HEADS, Board
from scripts.benchmark.runs_file import MS, Results, read
from scripts.benchmark.scores import Row, lost_of
from scripts.benchmark.tracks import LEVELS, Track, newest
from scripts.comparison.tables import write_csv
from scripts.console import ended
from scripts.days.scores import LEVEL_COLUMNS, levels
from scripts.marks import fill_page, table
from scripts.pages.table import NONE
from scripts.result_files import RESULTS, ROOT
from slam.files import write_text

DOCS = ROOT / "docs"
_COUNTS = {True: "yes", False: "no", None: "open"}
PAGE, BOARD = "benchmark.md", "leaderboard.md"
LEAST = 10  # runs of a SLAM at level 1: of fewer no cell is shown
TABLE = "benchmark.csv"
COLUMNS = ("SLAM", "track", "level", "seed", "commit", "lost", "error_m", "ms")


def tracks_of(of: Results) -> list[Track]:
    """The newest version of each that it has runs of."""
    return [track for track in newest().values() if track.name in of.runs]


def tracks_table(tracks: Sequence[Track]) -> str:
    """A row for each."""
    rows = []
    for track in tracks:
        says = f"{track.axis}: {', '.join(word.split(' ', 1)[0] for word in track.says)}"
        words = [f"`{track.name}`", track.about, says, track.scene, f"{track.seconds:g}"]
        rows.append([*words, _COUNTS[track.counts]])
    heads = ("track", "what happens", f"level {_list(LEVELS)}", "scene", "s", "counts")
    return table(heads, rows, left=4)


def board_of(of: Results) -> Board:
    """What ships, as a board."""
    runs = {track.name: of.rows(track.name) for track in tracks_of(of)}
    return Board(subject="shunting", head={}, tracks=tracks_of(of), runs=runs)


def shipped(of: Results) -> str:
    """The ranking, with the share lost at each level, and what it is of."""
    board = board_of(of)
    one, made = board.ranking[0], of.made_with
    lost = {
        row["slam"]: [f"{100.0 * s:.0f} %" for s in row["lost_shares"]] for row in board.ranking
    }
    rows = [[*cells, *lost[cells[1]]] for cells in board.ranked()]
    heads = [*RANKED_HEADS, *(f"level {level:g}" for level in one["levels"])]
    return (
        f"{table(heads, rows, left=2)}\n\n"
        f"The last columns are the share lost at each level, of {_list(one['runs_at'])} runs: the "
        f"first seeds of the tracks that count. Code {made['commit']}; "
        f"{made['machine']['processor']}, MuJoCo {made['versions']['mujoco']}."
    )


def at_the_top(of: Results) -> dict[str, dict[str, tuple[int, int]]]:
    """By track and SLAM the runs lost at level 1, and all; only where there are ``LEAST``."""
    board = board_of(of)
    found = {}
    for track in board.tracks:
        rows = board.one_oracle(track, track.oracle)
        top = (row for row in rows if row["dynamism"] == LEVELS[-1])
        found[board.head_of(track)] = lost_of(top, LEAST)
    return found


def top_table(of: Results) -> str:
    """A row for each track, a column for each SLAM."""
    lost = at_the_top(of)
    ranked = [row["slam"] for row in board_of(of).ranking]
    there = {slam for own in lost.values() for slam in own}
    slams = sorted(there, key=lambda slam: ranked.index(slam) if slam in ranked else len(ranked))
    lines = [
        [track, *("{} of {}".format(*own[s]) if s in own else NONE for s in slams)]
        for track, own in lost.items()
    ]
    return table(["track", *slams], lines)


def runs_table(of: Results) -> list[Row]:
    """A row for each run and SLAM of the file that ships."""
    return [
        {
            "SLAM": slam, "track": track, "level": f"{at[0]:g}", "seed": at[1],
            "commit": of.made_with["commit"], "lost": row["lost"],
            "error_m": row["error_tracking_m"], "ms": row[MS],
        }
        for track, runs in of.runs.items() for at, (_, slams) in runs.items()
        for slam, row in slams.items()
    ]  # fmt: skip


def _list(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def publish(docs: Path, results: Path, aged: Path | None, commit: str) -> None:
    """Draw and fill; raises ``LogFormatError`` for a folder without scores over days."""
    if aged is not None:
        days.read(aged / days.NAMES[1])
        # the file, with the command that makes it and the commit on top if there is a commit
        source = aged / days.NAMES[1]
        copy = results / days.NAMES[1]
        text = source.read_text(encoding="utf-8")
        if commit:
            command = json.dumps(_made_days(json.loads(text)))
            head = f'{{\n "command": {command},\n "commit": {json.dumps(commit)},\n'
            text = text.replace("{\n", head, 1)
        write_text(copy, text)
    of = read()
    board, where = board_of(of), f"level {LEVELS[-1]:g}"
    drawn = picture.drawn(at_the_top(of), board.ranking, board.subject, where)
    for name, svg in drawn.items():
        write_text(docs / "pictures" / name, svg)
    write_csv(results / TABLE, runs_table(of), COLUMNS)
    for page, mark, told in (
        (PAGE, "tracks", tracks_table(list(newest().values()))),
        (PAGE, "shipped", shipped(of)),
        (BOARD, "top", top_table(of)),
    ):
        fill_page(docs / page, mark, told, most=len(told))  # the table of the page, however long
    _publish_days(docs / BOARD, results / days.NAMES[1])


_DAYS = (
    "All scores with their intervals: [days.csv](results/days.csv); of each building: "
    "[days.json](results/days.json)."
)


def _made_days(told: dict[str, Any]) -> str:
    words = ["python -m scripts.benchmark.days out/days --slam", *told["slams"]]
    return " ".join([*words, "--seeds", str(len(told["seeds"]))])


def _publish_days(page: Path, results: Path) -> None:
    """The section at the end of the leaderboard's page, from the results; none without them."""
    if not results.exists() or not page.exists():
        return
    before, _, _ = page.read_text(encoding="utf-8").partition(f"\n{days.HEADING}\n")
    rows = days.read(results)
    write_csv(results.with_suffix(".csv"), levels(rows), LEVEL_COLUMNS)
    write_text(page, f"{before.rstrip()}\n\n{days.section(rows, tables=False)}\n\n{_DAYS}\n")


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Publish."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("days", type=Path, nargs="?", help="a folder of benchmark.days")
    parser.add_argument("--docs", type=Path, default=DOCS)
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--commit", default="", help="of the code that ran the days")
    wanted = parser.parse_args(arguments)
    publish(wanted.docs, wanted.results, wanted.days, wanted.commit)


if __name__ == "__main__":
    sys.exit(main())
