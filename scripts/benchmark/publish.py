# SPDX-License-Identifier: Apache-2.0
"""Fill the pages from the runs that ship: ``python -m scripts.benchmark.publish [out/days]``.

Each number of the benchmark on a page stands between marks, and all of them are filled here: in
README.md one sentence, in docs/benchmark.md the tracks and the ranking, in docs/leaderboard.md what
was lost at the top of each track, and the days. The folder of ``scripts.benchmark.days`` goes to
``docs/results``, as ``days.json`` and ``days.csv``.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.benchmark import days
from scripts.benchmark.board import RANKED_HEADS, Board
from scripts.benchmark.runs_file import Results, read
from scripts.benchmark.scores import Row, ranking
from scripts.benchmark.tracks import LEVELS, Track, newest
from scripts.comparison.tables import write_csv
from scripts.console import ended
from scripts.days.scores import LEVEL_COLUMNS, levels
from scripts.figures import save, styled
from scripts.marks import fill_page, table
from scripts.report.answer import ODOMETRY
from scripts.result_files import RESULTS, ROOT
from slam.files import write_text
from slam.system import OWN
from slam.variants import ORACLE

DOCS = ROOT / "docs"
_COUNTS = {True: "yes", False: "no", None: "open"}
FRONT, PAGE, BOARD = "../README.md", "benchmark.md", "leaderboard.md"
_OURS = ("shunting", "occupancy", "ekf")
PERCENT = 100.0
SHORT = 8  # digits of a commit
APART = 4.2  # percent between two names at the ends of their lines
_COLORS = ("#ce2c3c", "#1f61be", "#7a3fb0", "#0b8c96", "#8c6d1f", "#5d8a1e", "#b8418f", "#2f9fd0",
           "#a0583c", "#3b2f7d", "#59616e", "#de6e18")  # fmt: skip
_CONTROL = "#9a9a9a"
_MARKERS = "osD^vP*Xh<>d"


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
    """The ranking, and what it is of."""
    board = board_of(of)
    made, on = of.made_with, of.made_with["machine"]["processor"]
    rows = [
        [*cells, ", ".join(commit[:SHORT] for commit in of.commits(cells[1], board.tracks))]
        for cells in board.ranked()
    ]
    return (
        f"{table([*RANKED_HEADS, 'commits'], rows, left=2)}\n\n{_ranked_runs(board)}; "
        f"{on}, MuJoCo {made['versions']['mujoco']}. Commits are those that made that SLAM's rows, "
        "of all runs that ship, the first the most."
    )


def _ranked_runs(board: Board) -> str:
    one, counting = board.ranking[0], len(read().quick(board.tracks))
    return f"{one['runs']} runs: {counting} tracks that count, levels {_list(one['levels'])}"


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


def at_the_top(of: Results) -> str:
    """Runs lost at level 1, of how many: a row for each track, a column for each SLAM."""
    board = board_of(of)
    rows = {track.name: board.one_oracle(track, track.oracle) for track in board.tracks}
    there = [row["slam"] for own in rows.values() for row in own]
    slams = list(dict.fromkeys([*(row["slam"] for row in board.ranking), *there]))
    lines = [
        [track.name, _COUNTS[track.counts], *(_lost(rows[track.name], s) for s in slams)]
        for track in board.tracks
    ]
    return table(["track", "counts", *slams], lines, left=2)


def _lost(rows: Sequence[Row], slam: str) -> str:
    own = [row["lost"] for row in rows if (row["slam"], row["dynamism"]) == (slam, LEVELS[-1])]
    return f"{sum(own)} of {len(own)}" if own else "–"


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
        (BOARD, "top", at_the_top(of)),
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
    write_csv(results / days.NAMES[0], levels(rows), LEVEL_COLUMNS)
    board = board_of(of)
    overall(board.ranking, _ranked_runs(board), docs / "pictures" / "benchmark.png")
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


def _look(slam: str, k: int) -> dict[str, Any]:
    if slam.startswith(ORACLE):
        return {"color": "#202020", "ls": "--", "marker": "", "lw": 1.6}
    if slam == ODOMETRY:
        return {"color": _CONTROL, "ls": ":", "marker": "", "lw": 1.6}
    wide = 2.4 if slam == "shunting" else 1.4
    return {"color": _COLORS[k % len(_COLORS)], "ls": "-", "lw": wide, "ms": 4.5, "mec": "white",
            "mew": 0.5, "marker": _MARKERS[k % len(_MARKERS)]}  # fmt: skip


@styled({"grid.alpha": 0.3})
def overall(ranked: Sequence[Row], title: str, path: Path) -> None:
    """Of rows of ``scores.ranking`` the shares lost, each SLAM named at the end of its line."""
    figure = Figure(figsize=(8.2, 4.6))
    ax: Axes = figure.subplots()
    levels = [float(level) for level in ranked[0]["levels"]]
    named = sorted((row["slam"] for row in ranked), key=lambda slam: (slam != "shunting", slam))
    last, right = levels[-1], 0.03 * (levels[-1] - levels[0])
    places = spread([PERCENT * row["lost_shares"][-1] for row in ranked])
    for row, at in zip(ranked, places, strict=True):
        shares = [PERCENT * share for share in row["lost_shares"]]
        look = _look(row["slam"], named.index(row["slam"]))
        ax.plot(levels, shares, **look)
        ax.plot([last, last + right], [shares[-1], at], color=look["color"], lw=0.6, clip_on=False)
        ax.text(last + 1.3 * right, at, f"{row['slam']}  {shares[-1]:.0f} %", color=look["color"],
                va="center", fontsize=8.5, clip_on=False)  # fmt: skip
    ax.set_xticks(levels)
    ax.set(xlim=(levels[0], last), ylim=(-7.0, 107.0), yticks=np.arange(0.0, 101.0, 25.0))
    ax.set(xlabel="level of a track, 0 (nothing of its trouble) to 1 (all)")
    ax.set_ylabel("share of runs lost, %")
    ax.set_title(title, loc="left", fontsize=10)
    path.parent.mkdir(parents=True, exist_ok=True)
    save(figure, path)


def spread(ends: Sequence[float]) -> list[float]:
    """Places for names at these heights: in their order, ``APART`` or more apart, within the axes.

    They are put from the bottom up, then pushed down from 100 where they do not fit.
    """
    order = np.argsort(np.asarray(ends), kind="stable").tolist()
    places = np.asarray(ends, dtype=np.float64)
    for below, k in pairwise(order):
        places[k] = max(places[k], places[below] + APART)
    top = max(PERCENT, APART * (len(ends) - 1))
    for k in reversed(order):
        places[k] = min(places[k], top)
        top = float(places[k]) - APART
    return [float(place) for place in places]


if __name__ == "__main__":
    sys.exit(main())
