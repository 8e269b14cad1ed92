# SPDX-License-Identifier: Apache-2.0
"""Fill the pages from the runs that ship: ``python -m scripts.benchmark.publish [out/days]``.

Each number of the benchmark on a page stands between marks, and all of them are filled here: in
README.md one sentence, in docs/benchmark.md the tracks and the ranking, in docs/leaderboard.md the
days. docs/pictures gets what was lost, by track and by level, docs/results every run as CSV,
and the folder of ``scripts.benchmark.days`` as ``days.json`` and ``days.csv``.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from scripts.benchmark import days, picture
from scripts.benchmark.board import RANKED_HEADS, Board
from scripts.benchmark.runs_file import MS, Results, read
from scripts.benchmark.scores import Row, lost_of, ranking
from scripts.benchmark.tracks import LEVELS, Track, newest
from scripts.comparison.tables import write_csv
from scripts.console import ended
from scripts.days.scores import LEVEL_COLUMNS, levels
from scripts.marks import fill_page, table
from scripts.result_files import RESULTS, ROOT
from slam.files import write_text
from slam.system import OWN

DOCS = ROOT / "docs"
_COUNTS = {True: "yes", False: "no", None: "open"}
FRONT, PAGE, BOARD = "../README.md", "benchmark.md", "leaderboard.md"
_OURS = ("shunting", "occupancy", "ekf")
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


@lru_cache(1)
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


def in_a_sentence(of: Results) -> str:
    """Who is lost in how many of the runs at level 1 that most SLAMs made, where tracks count."""
    board = board_of(of)
    counting = (track for track in board.tracks if board.fair[track.name]["counts"])
    top = {t.name: [r for r in board.runs[t.name] if r["dynamism"] == LEVELS[-1]] for t in counting}
    ranked = ranking(top, board.subject)
    lost, runs = {row["slam"]: row["lost_runs"] for row in ranked}, ranked[0]["runs"]
    public = [n for slam, n in lost.items() if OWN.get(slam, "").startswith("slam.guests.")]
    ours = ", ".join(f"`{slam}` {lost[slam]}" for slam in _OURS if slam in lost)
    return (
        f"Runs lost, of the same {runs} at level 1 of the [benchmark](docs/benchmark.md): {ours}, "
        f"{len(public)} public SLAMs {min(public)} to {max(public)} each "
        "([track by track](docs/leaderboard.md))."
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


_DAYS = (
    "All scores with their intervals: [days.csv](results/days.csv); of each building: "
    "[days.json](results/days.json)."
)


def blocks(of: Results, aged: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Every marked place: its page, seen from docs, its name and what stands there.

    aged  rows of ``days.read``
    """
    return [
        (FRONT, "benchmark", in_a_sentence(of)),
        (PAGE, "tracks", tracks_table(list(newest().values()))),
        (PAGE, "shipped", shipped(of)),
        (BOARD, "days", f"{days.section(aged, tables=False)}\n\n{_DAYS}"),
    ]


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
    of, rows = read(), days.read(results / days.NAMES[1])
    board, where = board_of(of), f"level {LEVELS[-1]:g}"
    drawn = picture.drawn(at_the_top(of), board.ranking, board.subject, where)
    for name, svg in drawn.items():
        write_text(docs / "pictures" / name, svg)
    write_csv(results / days.NAMES[0], levels(rows), LEVEL_COLUMNS)
    write_csv(results / TABLE, runs_table(of), COLUMNS)
    for page, mark, told in blocks(of, rows):
        fill_page(docs / page, mark, told, most=len(told))  # the table of the page, however long


def _made_days(told: dict[str, Any]) -> str:
    words = ["python -m scripts.benchmark.days out/days --slam", *told["slams"]]
    return " ".join([*words, "--seeds", str(len(told["seeds"]))])


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
