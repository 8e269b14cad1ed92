# SPDX-License-Identifier: Apache-2.0
"""The leaderboard: ``leaderboard.json``, ``.csv`` and ``.md``, and the sentence on top."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from scripts.benchmark.scores import COLUMNS, SILENT, TRACKING, Row, scores
from scripts.benchmark.tracks import LEVELS, Track
from scripts.comparison.csv_files import write_csv
from scripts.comparison.schema import FAILED
from scripts.metrics.row import digits
from scripts.report.answer import ODOMETRY, against, answer, standing
from scripts.report.study import LEAST_RUNS
from scripts.result_files import write as write_results
from slam.evaluation.lost import EXCUSED_S, LOST_RULE
from slam.files import write_text

SCHEMA = 1
NAMES = ("leaderboard.json", "leaderboard.csv", "leaderboard.md")
NEVER = "never"  # not at any level, nor does the interval hold one
ABOVE = f"> {LEVELS[-1]:g}"
CM, PERCENT = 100.0, 100.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Board:
    """What was run, and what came out.

    subject  the SLAM that the sentence on top is about
    head     how it was made: command, seeds, versions, machine
    runs     by track: rows as of ``runs.csv``, of every SLAM and control
    missing  SLAMs that are not installed, and how to get them
    merged   of each submission of others: its SLAM, and what it was made with
    days     the table over days for ``leaderboard.json``, and ``days_page`` its section
             (``scripts.benchmark.days``); empty where it was not asked for
    """

    subject: str
    head: Mapping[str, Any]
    tracks: Sequence[Track]
    runs: Mapping[str, Sequence[Row]]
    missing: Mapping[str, str] = field(default_factory=dict)
    merged: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    days: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    days_page: str = ""

    @cached_property
    def _scores(self) -> dict[str, tuple[Row, list[Row]]]:
        return {track.name: scores(track, self.runs[track.name]) for track in self.tracks}

    @property
    def fair(self) -> Mapping[str, Row]:
        """By track: whether it counts, and why."""
        return {name: fair for name, (fair, _) in self._scores.items()}

    @property
    def rows(self) -> list[Row]:
        """One for each track and SLAM."""
        return [row for _, rows in self._scores.values() for row in rows]

    @property
    def slams(self) -> list[str]:
        """The subject first, the controls last."""
        named = list(dict.fromkeys(row["slam"] for row in self.rows))
        controls = {name for track in self.tracks for name in track.controls} - {self.subject}
        return sorted(named, key=lambda name: (name in controls, name != self.subject))

    def row(self, track: str, slam: str) -> Row | None:
        """Of the leaderboard; None where that SLAM was not on that track."""
        found = (row for row in self.rows if (row["track"], row["slam"]) == (track, slam))
        return next(found, None)

    def failures(self) -> list[str]:
        """One line for each SLAM and track where it raised, hung or answered nonsense."""
        return [f"{head}: {told}" for head, told in self._failures()]

    def _failures(self) -> Iterator[tuple[str, str]]:
        """Who failed where, and what was told of the first."""
        for track, rows in self.runs.items():
            for slam in self.slams:
                own = [r for r in rows if r["slam"] == slam and r["outcome"] in FAILED]
                if own:
                    told = str(own[0]["failure"]).partition("\n")[0][:300]
                    yield f"{slam} failed in {len(own)} runs of {track}", told

    def said(self) -> list[str]:
        """What the reader asked: from which level the subject is lost, on which track."""
        every = self._of(self.subject)
        few = min((row["seeds"] for row in every), default=0)
        own = [row for row in every if row["counts"]]
        if few < LEAST_RUNS:
            return self._seen(few)
        out = []
        lost = sorted((r for r in own if math.isfinite(r["lost_from"])), key=_lost_from)
        if lost:
            listed = "; ".join(f"{r['track']} from level {_from(r)} on" for r in lost)
            out.append(f"`{self.subject}` is lost half of the time in {listed}.")
        if kept := [row["track"] for row in own if math.isinf(row["lost_from_low"])]:
            so = "It is" if lost else f"`{self.subject}` is"
            out.append(f"{so} not lost half of the time at any level of {', '.join(kept)}.")
        open_ = [r for r in own if math.isinf(r["lost_from"]) and math.isfinite(r["lost_from_low"])]
        if open_:
            listed = ", ".join(f"{r['track']} {_from(r)}" for r in open_)
            out.append(f"Whether half of its runs are lost cannot be told in {listed}.")
        worse = [row["track"] for row in own if self._worse_than_wheels(row["track"])]
        if worse and self.subject != ODOMETRY:
            out.append(
                f"At level 0 it is already worse than its own odometry in {', '.join(worse)}: "
                "what moves is not its problem there."
            )
        if unfair := [row["track"] for row in every if not row["counts"]]:
            out.append(
                f"Left out, because its oracle was lost or more than 2 cm off: {', '.join(unfair)}."
            )
        return out

    def _seen(self, few: int) -> list[str]:
        """Of too few runs for an interval of the level: what was seen in each track."""
        said = [
            answer(standing([row | {"scene": track} for row in rows], self.subject, track, "level"))
            for track, rows in self.runs.items()
            if any(row["slam"] == self.subject for row in rows)
        ]
        return [*said, f"{LEAST_RUNS} seeds tell from which level on; these are {few}."]

    def _worse_than_wheels(self, track: str) -> bool:
        rows = [row for row in self.runs[track] if row["dynamism"] == LEVELS[0]]
        return against(rows, self.subject, ODOMETRY) == -1

    def write(self, folder: Path) -> None:
        """The three files."""
        write_csv(folder / NAMES[1], self.rows, COLUMNS)
        head = {
            "schema": SCHEMA, **self.head, "subject": self.subject, "said": self.said(),
            "lost_rule": LOST_RULE, "excused_s": EXCUSED_S, "missing": dict(self.missing),
            "merged": dict(self.merged),
        }  # fmt: skip
        tracks = {
            t.name: {
                "about": t.about, "scene": t.scene, "axis": t.axis, "levels": list(LEVELS),
                "says": list(t.says), "world": t.world, "sha256": t.sha256, **self.fair[t.name],
            }
            for t in self.tracks
        }  # fmt: skip
        rows = {f"{row['track']} {row['slam']}": {k: row[k] for k in COLUMNS} for row in self.rows}
        shares = {
            f"{track} {slam}": self._shares(track, slam)
            for track in self.runs for slam in self.slams if self.row(track, slam)
        }  # fmt: skip
        tables: dict[str, Mapping[str, Any]] = {
            "tracks": tracks, "leaderboard": rows, "lost_shares": shares,
        }  # fmt: skip
        if self.days:
            tables["days"] = self.days
        write_results(folder / NAMES[0], head, tables)
        write_text(folder / NAMES[2], self.markdown())

    def _shares(self, track: str, slam: str) -> Row:
        """Level by level the share of runs lost, for the picture."""
        found: dict[float, list[int]] = {}
        for run in self.runs[track]:
            if run["slam"] == slam:
                found.setdefault(float(run["dynamism"]), []).append(int(run["lost"]))
        levels = sorted(found)
        return {"levels": levels, "lost": [sum(found[at]) / len(found[at]) for at in levels]}

    def markdown(self) -> str:
        """The page."""
        parts = ["# Leaderboard", *self.said(), *self._notes(), "## Lost from which level", _LOST]
        heads = ["track", "counts", *self.slams]
        lines = [
            [t.name, "yes" if self.fair[t.name]["counts"] else "no",
             *(lost_from_words(self.row(t.name, slam)) for slam in self.slams)]
            for t in self.tracks
        ]  # fmt: skip
        parts.append(markdown_table(heads, lines, left=1))
        for track in self.tracks:
            parts += self._section(track)
        parts += [self.days_page] if self.days_page else []
        return "\n\n".join(parts) + "\n"

    def _notes(self) -> list[str]:
        lines = [f"- {key}: {value}" for key, value in self.head.items() if key in _SHOWN]
        lines += [f"- not installed: `{name}` ({why})" for name, why in self.missing.items()]
        silent = [s for s in self.slams if all(row[SILENT] is None for row in self._of(s))]
        if silent:
            named = ", ".join(f"`{name}`" for name in silent)
            lines.append(f"- no silent failures can be counted without a covariance: {named}")
        lines += [f"- {head}: {_code(told)}" for head, told in self._failures()]
        lines += [
            f"- `{name}` was submitted, as SLAM {_code(one['slam'])}, and its results are the "
            f"submitter's word. Made with {_code(one['made_with'])}"
            for name, one in self.merged.items()
        ]
        return ["\n".join(lines)]

    def _of(self, slam: str) -> list[Row]:
        return [row for row in self.rows if row["slam"] == slam]

    def _section(self, track: Track) -> list[str]:
        fair = self.fair[track.name]
        sentences = (
            f"{track.about[0].upper()}{track.about[1:]} (scene {track.scene}).",
            f"Level: {track.axis};",
            ", ".join(f"{at:g} = {word}" for at, word in zip(LEVELS, track.says, strict=True))
            + ".",
            f"It {'counts' if fair['counts'] else 'does not count'}:",
            f"`{track.oracle}` was lost in {fair['oracle_lost']} of {fair['oracle_runs']} runs,",
            f"and off by {digits(CM * fair['oracle_error_m'])} cm at its worst level.",
        )
        rows = [row for slam in self.slams if (row := self.row(track.name, slam))]
        lines = [[row["slam"], *(show(row) for _, show in _CELLS)] for row in rows]
        return [
            f"## {track.name}",
            " ".join(sentences),
            markdown_table(["SLAM", *(name for name, _ in _CELLS)], lines, left=1),
        ]


def _code(words: str) -> str:
    """Somebody else's words in Markdown, as they are: nothing in them is a link, tag or picture."""
    return "`" + " ".join(words.replace("`", "'").split()) + "`"


_SHOWN = ("seeds", "world", "quick", "seconds")
_LOST = (
    "The level from which half of the runs are lost, with its 95 % interval (bootstrap over the "
    "seeds, isotonic regression); levels go from 0 to 1. It is `never` where the whole interval is "
    f"above 1, and has no interval with fewer than {LEAST_RUNS} seeds. A track "
    "counts while its oracle is never lost, and at most 2 cm off."
)


def _lost_from(row: Row) -> float:
    return float(row["lost_from"])


def _from(row: Row) -> str:
    """The level with its interval; without where there are too few runs for one."""
    value, low, high = row["lost_from"], row["lost_from_low"], row["lost_from_high"]
    if row["seeds"] < LEAST_RUNS:
        return _level(value)
    if math.isinf(low):
        return NEVER
    sure = math.isnan(low) or low == high == value
    return _level(value) + ("" if sure else f" [{_level(low)}, {_level(high)}]")


def _level(value: float) -> str:
    return ABOVE if math.isinf(value) else f"{value:.2g}"


def _number(key: str, factor: float = 1.0) -> Callable[[Row], str]:
    def show(row: Row) -> str:
        value = row[key]
        return "–" if value is None or math.isnan(value) else digits(value * factor)

    return show


_CELLS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("lost from", _from),
    ("lost runs", lambda row: f"{row['lost_runs']} of {row['runs']}"),
    ("error while not lost, cm", _number(TRACKING, CM)),
    ("of runs", lambda row: str(row[f"{TRACKING}_runs"])),
    ("silent failures, % of scans", _number(SILENT, PERCENT)),
    ("rank correlation", _number("spearman")),
    ("ms a scan, p50", _number("ms_per_scan_p50")),
    ("p99.9", _number("ms_per_scan_p999")),
    ("memory, MB", _number("peak_memory_mb")),
)


def lost_from_words(row: Row | None) -> str:
    """A cell of the first table: "0.43 [0.31, 0.6]", "> 1 [0.9, > 1]", "never", or a dash."""
    return "–" if row is None else _from(row)


def markdown_table(heads: Sequence[str], lines: Sequence[Sequence[str]], *, left: int) -> str:
    """A table whose first ``left`` columns are words."""
    rule = [*["---"] * left, *["---:"] * (len(heads) - left)]
    rows = ("| " + " | ".join(word.replace("|", "/") for word in row) + " |"
            for row in (heads, rule, *lines))  # fmt: skip
    return "\n".join(rows)
