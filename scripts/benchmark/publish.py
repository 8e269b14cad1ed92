# SPDX-License-Identifier: Apache-2.0
"""Put a leaderboard into the docs: ``python -m scripts.benchmark.publish out/benchmark``.

Copies ``leaderboard.json`` to ``docs/results`` and writes ``leaderboard.csv`` beside it, takes the
beginning of ``leaderboard.md`` to ``docs`` (without the tables of the tracks: the CSV has them),
draws the two pictures of ``scripts.benchmark.picture``, and writes a row for each SLAM and each
track into docs/benchmark.md.

Scores over days (``days.json``) go to ``docs/results`` too, and as ``days.csv``; the section of
docs/leaderboard.md is made from that file. A folder of ``scripts.benchmark.days`` has nothing else,
and the rest stays.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from scripts.benchmark import days, picture, published
from scripts.benchmark.board import RANKED_HEADS, Board, markdown_table
from scripts.benchmark.published import Published
from scripts.benchmark.scores import COLUMNS, SILENT, TRACKING, lost_from
from scripts.benchmark.tracks import LEVELS, TRACKS
from scripts.comparison.csv_files import write_csv
from scripts.days.scores import LEVEL_COLUMNS, levels
from scripts.marks import fill_page
from scripts.metrics.row import digits
from scripts.result_files import RESULTS, ROOT
from slam.errors import InvalidValueError, MobiliaError
from slam.evaluation.statistics import quantile
from slam.files import write_text

DOCS = ROOT / "docs"
PAGE, MARK, BOARD = "benchmark.md", "leaderboard", "leaderboard.md"
CM, PERCENT = 100.0, 100.0
HEADS = (
    "SLAM", "lost from", "tracks on which half of the runs are lost", "lost at level 1, %",
    "error while not lost, cm", "silent, % of scans", "rank correlation ≥ 0.9 on", "ms a scan, p50",
)  # fmt: skip


def tracks_table(board: dict[str, Any]) -> str:
    """A row for each track of the board that is declared here."""
    table = []
    for track in (TRACKS[name] for name in board["tracks"] if name in TRACKS):
        says = f"{track.axis}: {', '.join(word.split(' ', 1)[0] for word in track.says)}"
        words = [f"`{track.name}`", track.about, says, track.scene]
        table.append([*words, f"{track.seconds:g}", str(track.world)])
    levels = f"level {', '.join(f'{at:g}' for at in LEVELS)}"
    return markdown_table(("track", "what happens", levels, "scene", "s", "world"), table, left=4)


def rows(board: dict[str, Any]) -> list[list[str]]:
    """A row for each SLAM over the tracks that count, by the level it is lost from, then error."""
    counting = {name for name, track in board["tracks"].items() if track["counts"]}
    own: dict[str, list[dict[str, Any]]] = {}
    for row in board["leaderboard"].values():
        if row["track"] in counting:
            slam = picture.shown_name(row["slam"])
            own.setdefault(slam, []).append(row)
    if not own:
        raise InvalidValueError("no track of the leaderboard counts")
    at = {slam: _lost_from(board, found) for slam, found in own.items()}

    def rank(item: tuple[str, list[dict[str, Any]]]) -> tuple[float, float, float]:
        slam, found = item
        return -at[slam], _mean(found, "lost_at_top"), _middle(found, TRACKING)

    return [_row(slam, at[slam], found) for slam, found in sorted(own.items(), key=rank)]


def _lost_from(board: dict[str, Any], found: Sequence[dict[str, Any]]) -> float:
    """The level from which half of the runs of all these tracks are lost."""
    of = [board["lost_shares"][f"{row['track']} {row['slam']}"] for row in found]
    each = zip(*(shares["lost"] for shares in of), strict=True)
    return lost_from(of[0]["levels"], [sum(level) / len(level) for level in each])


def _row(slam: str, at: float, found: Sequence[dict[str, Any]]) -> list[str]:
    broken = sum(math.isfinite(float(row["lost_from"])) for row in found)
    ranked = [float(row["spearman"]) for row in found if row["spearman"] is not None]
    return [
        f"`{slam}`",
        f"{at:.2g}" if math.isfinite(at) else f"> {LEVELS[-1]:g}",
        f"{broken} of {len(found)}",
        f"{PERCENT * _mean(found, 'lost_at_top'):.0f}",
        _median(found, TRACKING, CM),
        "–"
        if all(row[SILENT] is None for row in found)
        else f"{PERCENT * _mean(found, SILENT):.1f}",
        f"{sum(value >= 0.9 for value in ranked)} of {len(ranked)}",
        _median(found, "ms_per_scan_p50", 1.0),
    ]


def _values(found: Sequence[dict[str, Any]], key: str) -> list[float]:
    return [float(row[key]) for row in found if row[key] is not None]


def _mean(found: Sequence[dict[str, Any]], key: str) -> float:
    values = _values(found, key)
    return sum(values) / len(values) if values else math.inf


def _middle(found: Sequence[dict[str, Any]], key: str) -> float:
    values = _values(found, key)
    return quantile(values, 0.5) if values else math.inf


def _median(found: Sequence[dict[str, Any]], key: str, factor: float) -> str:
    value = _middle(found, key)
    return digits(factor * value) if math.isfinite(value) else "–"


def told(board: dict[str, Any]) -> str:
    """The table and how it was made."""
    counting = [name for name, track in board["tracks"].items() if track["counts"]]
    left = [f"`{name}`" for name in board["tracks"] if name not in counting]
    made = (
        f"{len(counting)} tracks that count, {len(board['levels_run'])} levels, "
        f"{len(board['seeds'])} seeds from {min(board['seeds'])}. Errors and times are medians of "
        "the tracks, the rest are means."
    )
    if left:
        made += f" Left out, because the oracle was lost or off there: {', '.join(left)}."
    return f"{markdown_table(HEADS, rows(board), left=1)}\n\n{made}\n\n{_broken(board)}"


def _broken(board: dict[str, Any]) -> str:
    """How many SLAMs lose half of their runs at the top, track by track; controls aside."""
    by_track: dict[str, list[bool]] = {}
    for row in board["leaderboard"].values():
        if not picture.is_control(picture.shown_name(row["slam"])):
            by_track.setdefault(row["track"], []).append(float(row["lost_at_top"]) >= 0.5)
    said = (f"`{name}` {sum(lost)} of {len(lost)}" for name, lost in by_track.items())
    return f"SLAMs that lose half of their runs or more at level 1: {', '.join(said)}."


def shipped(of: Published) -> str:
    """The ranking of the runs that ship with the package, and what they are."""
    tracks = [track for track in TRACKS.values() if track.counts and track.name in of.runs]
    runs = {
        track.name: of.rows(track.name, {at: own[0] for at, own in of.runs[track.name].items()}, ())
        for track in tracks
    }
    board = Board(subject="shunting", head={}, tracks=tracks, runs=runs)
    asked = [at for own in of.runs.values() for at in own]
    levels, seeds = (sorted({at[k] for at in asked}) for k in (0, 1))
    made, on = of.made_with, of.made_with["machine"]["processor"]
    return (
        f"{markdown_table(RANKED_HEADS, board.ranked(), left=2)}\n\n"
        f"{board.ranking[0]['runs']} runs: {len(tracks)} tracks, levels "
        f"{', '.join(f'{level:g}' for level in levels)}, seeds {', '.join(map(str, seeds))}; "
        f"commit {made['commit']}, {on}, MuJoCo {made['versions']['mujoco']}."
    )


def publish(folder: Path, docs: Path, results: Path, commit: str) -> None:
    """Copy, draw and fill; raises ``LogFormatError`` for what is no leaderboard."""
    source, aged = folder / "leaderboard.json", folder / days.NAMES[1]
    if aged.exists():
        days.read(aged)
    if source.exists() or not aged.exists():
        _publish_board(folder, docs, results, commit)
    if aged.exists():
        _copy(aged, results / aged.name, commit, _made_days)
    _publish_days(docs / BOARD, results / aged.name)


def _publish_board(folder: Path, docs: Path, results: Path, commit: str) -> None:
    source = folder / "leaderboard.json"
    lost = picture.read(source)
    board = json.loads(source.read_text(encoding="utf-8"))
    text, tracks = told(board), tracks_table(board)
    _copy(source, results / "leaderboard.json", commit, _made_board)
    rows = list(json.loads(source.read_text(encoding="utf-8"))["leaderboard"].values())
    write_csv(results / "leaderboard.csv", rows, COLUMNS)
    write_text(docs / BOARD, beginning((folder / BOARD).read_text(encoding="utf-8"), lost.tracks))
    picture.overall(lost, docs / "pictures" / "benchmark.png")
    picture.by_track(lost, docs / "pictures" / "benchmark_tracks.png")
    fill_page(docs / PAGE, MARK, text, most=len(text))  # the table of the page, however many SLAMs
    fill_page(docs / PAGE, "tracks", tracks, most=len(tracks))
    fill_page(docs / PAGE, "shipped", ships := shipped(published.read()), most=len(ships))


def beginning(page: str, tracks: Iterable[str]) -> str:
    """``leaderboard.md`` without what it says of each track: that is in the CSV."""
    cuts = [at for name in tracks if (at := page.find(f"\n## {name}\n")) >= 0]
    return f"{page[: min(cuts)].rstrip()}\n\n{_EACH}\n" if cuts else page


_EACH = (
    "Errors, silent failures, times and memory of each SLAM on each track are in "
    "[leaderboard.csv](results/leaderboard.csv) ([its columns](benchmark.md#what-the-leaderboard-"
    "says)), the levels of each track in [benchmark](benchmark.md#the-tracks)."
)

_DAYS = (
    "All scores with their intervals: [days.csv](results/days.csv); of each building: "
    "[days.json](results/days.json)."
)


def _copy(source: Path, copy: Path, commit: str, made: Callable[[dict[str, Any]], str]) -> None:
    """The file, with the command that makes it and the commit on top if there is a commit."""
    text = source.read_text(encoding="utf-8")
    if commit:
        command = json.dumps(made(json.loads(text)))
        head = f'{{\n "command": {command},\n "commit": {json.dumps(commit)},\n'
        text = text.replace("{\n", head, 1)
    write_text(copy, text)


def _made_board(board: dict[str, Any]) -> str:
    return f"mobilia benchmark --slam {' '.join(board['slams'])}"


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


def main(arguments: Sequence[str] | None = None) -> int:
    """Publish one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of mobilia benchmark, or of benchmark.days")
    parser.add_argument("--docs", type=Path, default=DOCS)
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--commit", default="", help="of the code that ran")
    wanted = parser.parse_args(arguments)
    try:
        publish(wanted.folder, wanted.docs, wanted.results, wanted.commit)
    except (MobiliaError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
