# SPDX-License-Identifier: Apache-2.0
"""The leaderboard: ``leaderboard.json``, ``.csv`` and ``.md``, and the sentence on top."""

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from scripts.benchmark import picture
from scripts.benchmark.scores import (
    COLUMNS,
    RANKED,
    SILENT,
    TRACKING,
    Row,
    lost_by_track,
    ranking,
    scores,
)
from scripts.benchmark.tracks import LEVELS, Track
from scripts.comparison.schema import FAILED
from scripts.comparison.tables import write_csv
from scripts.marks import table
from scripts.metrics.table import digits
from scripts.report.answer import ODOMETRY, against, answer, listed, standing
from scripts.report.study import LEAST_RUNS
from scripts.result_files import write as write_results
from slam.evaluation.lost import EXCUSED_S, LOST_RULE
from slam.files import write_text
from slam.variants import ORACLE

SCHEMA = 1
NAMES = ("leaderboard.json", "leaderboard.csv", "leaderboard.md")
NEVER = "never"  # not at any level, nor does the interval hold one
ABOVE = f"> {LEVELS[-1]:g}"
CM, PERCENT = 100.0, 100.0
OWN_ORACLE = "oracle(shunting)"  # of every track the one that holds best, in one column


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

    @cached_property
    def slams(self) -> list[str]:
        """The subject first, the controls last."""
        named = list(dict.fromkeys(row["slam"] for row in self.rows))
        controls = {name for track in self.tracks for name in track.controls} - {self.subject}
        return sorted(named, key=lambda name: (name in controls, name != self.subject))

    def row(self, track: str, slam: str) -> Row | None:
        """Of the leaderboard; None where that SLAM was not on that track."""
        return next((row for row in self._scores[track][1] if row["slam"] == slam), None)

    def of(self, slam: str) -> list[Row]:
        """Its rows, track by track."""
        return [row for row in self.rows if row["slam"] == slam]

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

    @cached_property
    def ranking(self) -> list[Row]:
        """A row for each SLAM that made the same runs as the subject, where tracks count."""
        return ranking(self._with_one_oracle(self._counting), self.subject)

    def _with_one_oracle(self, tracks: Sequence[Track]) -> dict[str, list[Row]]:
        return {track.name: self.one_oracle(track, track.oracle) for track in tracks}

    def head_of(self, track: Track) -> str:
        """Its name, with a star where it does not count."""
        return track.name if self.fair[track.name]["counts"] else f"{track.name} *"

    @property
    def pictures(self) -> dict[str, str]:
        """SVG by name of its file."""
        lost = lost_by_track(self._with_one_oracle(self.tracks), self.subject)
        heads = {self.head_of(track): lost[track.name] for track in self.tracks}
        levels = _list(self.head.get("levels_run"))
        return picture.drawn(heads, self.ranking, self.subject, f"levels {levels}")

    def one_oracle(self, track: Track, oracle: str) -> list[Row]:
        """Its runs; ``oracle``, which each track may have another of, by the name of all."""
        rest = [r for r in self.runs[track.name] if r["slam"] != OWN_ORACLE or oracle == OWN_ORACLE]
        return [r | {"slam": OWN_ORACLE} if r["slam"] == oracle else r for r in rest]

    @property
    def _counting(self) -> list[Track]:
        return [track for track in self.tracks if self.fair[track.name]["counts"]]

    def is_control(self, slam: str) -> bool:
        """Whether it is shown what no contestant is, or looks at nothing."""
        return slam != self.subject and (slam == ODOMETRY or slam.startswith(ORACLE))

    def cite(self) -> str:
        """In one line what was run."""
        hashes = " ".join(f"{track.name} {track.sha256}" for track in self._counting)
        short = hashlib.sha256(hashes.encode()).hexdigest()[:12]
        about = self.head.get
        return (
            f"mobilia benchmark, world {about('world')}, tracks that count: "
            f"{len(self._counting)} ({short}), levels {_list(about('levels_run'))}, "
            f"{about('seeds_of')} seeds {_list(about('seeds'))}"
        )

    def said(self) -> list[str]:
        """What the reader asked: whether the subject is lost, where, and which place it has."""
        every = self.of(self.subject)
        over = [self._over_all(), self._place()] if self._counting else self._each_track()
        few = min((row["seeds"] for row in every), default=0) < LEAST_RUNS
        if few and len(self._counting) == 1:  # what is said over all is said of it
            return [*filter(None, over)]
        if few:
            more = f"Track by track it takes `--seeds {LEAST_RUNS}` to tell from which level on."
            return [*filter(None, [*over, self._lost_where()]), more]
        return [*filter(None, over), *self._by_track(every)]

    def _over_all(self) -> str:
        """The answer over all tracks that count: each of their rooms is one run at each level."""
        names = [track.name for track in self._counting]
        where = names[0] if len(names) == 1 else f"the {len(names)} tracks that count"
        rows = [
            row | {"scene": where, "seed": f"{track.name} {row['seed']}"}
            for track in self._counting
            for row in self.one_oracle(track, str(self.fair[track.name]["oracle"]))
            if row["slam"] in (self.subject, ODOMETRY, OWN_ORACLE)
        ]
        return answer(standing(rows, self.subject, where, "level", len(self._counting)))

    def _place(self) -> str:
        """Among contestants on the same runs; "" where there are no others."""
        named = [row["slam"] for row in self.ranking if not self.is_control(row["slam"])]
        if self.subject not in named or len(named) < 2:
            return ""
        at, runs = named.index(self.subject), self.ranking[0]["runs"]
        before = f"behind `{named[at - 1]}`" if at else ""
        after = f"before `{named[at + 1]}`" if at + 1 < len(named) else ""
        return (
            f"It is number {at + 1} of {len(named)} on these {runs} runs, "
            f"{' and '.join(filter(None, (before, after)))}."
        )

    def _lost_where(self) -> str:
        """The tracks and levels at which it was lost."""
        said = []
        for track in self._counting:
            own = [r for r in self.runs[track.name] if r["slam"] == self.subject and r["lost"]]
            levels = sorted({row["dynamism"] for row in own})
            if levels:
                said.append(f"{track.name} at {listed([f'{level:g}' for level in levels])}")
        return f"It was lost on {'; '.join(said)}." if said else ""

    def _each_track(self) -> list[str]:
        return [
            answer(standing([row | {"scene": track} for row in rows], self.subject, track, "level"))
            for track, rows in self.runs.items()
            if any(row["slam"] == self.subject for row in rows)
        ]

    def _by_track(self, every: Sequence[Row]) -> list[str]:
        own = [row for row in every if row["counts"]]
        out = []
        lost = [row for row in own if math.isfinite(row["lost_from"])]
        if lost:
            first = sorted(lost, key=lambda row: row["lost_from"])
            told = "; ".join(f"{r['track']} from level {lost_from_words(r)} on" for r in first)
            out.append(f"`{self.subject}` is lost in half of the runs in {told}.")
        if kept := [row["track"] for row in own if math.isinf(row["lost_from_low"])]:
            so = "It is" if lost else f"`{self.subject}` is"
            out.append(f"{so} not lost in half of the runs at any level of {', '.join(kept)}.")
        open_ = [r for r in own if math.isinf(r["lost_from"]) and math.isfinite(r["lost_from_low"])]
        if open_:
            told = ", ".join(f"{r['track']} {lost_from_words(r)}" for r in open_)
            out.append(f"Whether half of its runs are lost cannot be told in {told}.")
        worse = [row["track"] for row in own if self._worse_than_wheels(row["track"])]
        if worse and self.subject != ODOMETRY:
            out.append(
                f"At level 0 it is already worse than its own odometry in {', '.join(worse)}: "
                "what moves is not its problem there."
            )
        if unfair := [row["track"] for row in every if not row["counts"]]:
            out.append(f"Left out, because no oracle holds there: {', '.join(unfair)}.")
        return out

    def _worse_than_wheels(self, track: str) -> bool:
        rows = [row for row in self.runs[track] if row["dynamism"] == LEVELS[0]]
        return against(rows, self.subject, ODOMETRY) == -1

    def write(self, folder: Path) -> None:
        """The three files, and the pictures."""
        for name, svg in self.pictures.items():
            write_text(folder / name, svg)
        write_csv(folder / NAMES[1], self.rows, COLUMNS)
        head = {
            "schema": SCHEMA, **self.head, "subject": self.subject, "said": self.said(),
            "lost_rule": LOST_RULE, "excused_s": EXCUSED_S, "missing": dict(self.missing),
            "merged": dict(self.merged), "cite": self.cite(),
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
            f"{track} {slam}": {"levels": row["levels"], "lost": row["lost_shares"]}
            for track in self.runs for slam in self.slams if (row := self.row(track, slam))
        }  # fmt: skip
        tables: dict[str, Mapping[str, Any]] = {
            "tracks": tracks, "leaderboard": rows, "lost_shares": shares,
            "ranking": {row["slam"]: {k: row[k] for k in RANKED} for row in self.ranking},
        }  # fmt: skip
        if self.days:
            tables["days"] = self.days
        write_results(folder / NAMES[0], head, tables)
        write_text(folder / NAMES[2], self.markdown())

    def markdown(self) -> str:
        """The page."""
        drawn = " ".join(f"![{name}]({name})" for name in self.pictures)
        parts = ["# Leaderboard", *self.said(), drawn, *self._notes()]
        if self.ranking:
            parts += [f"## On the same {self.ranking[0]['runs']} runs", _RANKED]
            parts.append(table(RANKED_HEADS, self.ranked(), left=2))
        parts += ["## Lost from which level", _LOST]
        lines = [
            [t.name, "yes" if self.fair[t.name]["counts"] else "no",
             *(lost_from_words(self.row(t.name, slam)) for slam in self.slams)]
            for t in self.tracks
        ]  # fmt: skip
        parts.append(table(["track", "counts", *self.slams], lines))
        for track in self.tracks:
            parts += self._section(track)
        parts += [self.days_page] if self.days_page else []
        return "\n\n".join(parts) + "\n"

    def ranked(self) -> list[list[str]]:
        """The table of ``ranking`` in words: controls have no place."""
        lines, place = list[list[str]](), 0
        for row in self.ranking:
            control = self.is_control(row["slam"])
            place += not control
            level = lost_from_words(row | {"seeds": LEAST_RUNS})
            lines.append([
                "–" if control else str(place), row["slam"], level,
                f"{row['lost_runs']} of {row['runs']}", _number(TRACKING, CM)(row),
            ])  # fmt: skip
        return lines

    def _notes(self) -> list[str]:
        lines = [f"- {key}: {value}" for key, value in self.head.items() if key in _SHOWN]
        lines.append(f"- to cite: {self.cite()}")
        lines += [f"- not installed: `{name}` ({why})" for name, why in self.missing.items()]
        silent = [s for s in self.slams if all(row[SILENT] is None for row in self.of(s))]
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

    def _section(self, track: Track) -> list[str]:
        fair = self.fair[track.name]
        of_oracle = (
            f"It {'counts' if fair['counts'] else 'does not count'}:",
            f"`{fair['oracle']}` was lost in {fair['oracle_lost']} of {fair['oracle_runs']} runs,",
            f"and off by {digits(CM * fair['oracle_error_m'])} cm at its worst level.",
        )  # fmt: skip
        decided = (f"It {'counts' if fair['counts'] else 'does not count'}.",)
        sentences = (
            f"{track.about[0].upper()}{track.about[1:]} (scene {track.scene}).",
            f"Level: {track.axis};",
            ", ".join(f"{at:g} = {word}" for at, word in zip(LEVELS, track.says, strict=True))
            + ".",
            *(of_oracle if fair["oracle_runs"] else decided),
        )
        rows = (row for slam in self.slams if (row := self.row(track.name, slam)))
        lines = [[row["slam"], *(show(row) for _, show in _CELLS)] for row in rows]
        return [
            f"## {track.name}",
            " ".join(sentences),
            table(["SLAM", *(name for name, _ in _CELLS)], lines),
        ]


def _list(values: Sequence[Any] | None) -> str:
    """Numbers, or the first and last of many in a row."""
    found = list(values or ())
    if len(found) > 2 and found == list(range(int(found[0]), int(found[0]) + len(found))):
        return f"{found[0]} to {found[-1]}"
    return " ".join(f"{value:g}" for value in found)


def _code(words: str) -> str:
    """Somebody else's words in Markdown, as they are: nothing in them is a link, tag or picture."""
    return "`" + " ".join(words.replace("`", "'").split()) + "`"


_SHOWN = ("seeds", "world", "quick", "seconds")
RANKED_HEADS = ("place", "SLAM", "lost from", "lost runs", "error while not lost, cm")
_RANKED = (
    "By the level from which half of the runs are lost, over all tracks that count, then by the "
    "runs lost, then by the error. Controls have no place."
)
_LOST = (
    "The level from which half of the runs are lost, with its 95 % interval (bootstrap over the "
    "seeds, isotonic regression); levels go from 0 to 1. It is `never` where the whole interval is "
    f"above 1, and has no interval with fewer than {LEAST_RUNS} seeds. A track "
    "counts where an oracle is lost in at most a tenth of its runs, and at most 5 cm off."
)


def lost_from_words(row: Row | None) -> str:
    """The level with its interval, "0.43 [0.31, 0.6]" or "> 1 [0.9, > 1]"; without one where there
    are too few runs; "never"; a dash."""
    if row is None:
        return "–"
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
    ("lost from", lost_from_words),
    ("lost runs", lambda row: f"{row['lost_runs']} of {row['runs']}"),
    ("error while not lost, cm", _number(TRACKING, CM)),
    ("of runs", lambda row: str(row[f"{TRACKING}_runs"])),
    ("silent failures, % of scans", _number(SILENT, PERCENT)),
    ("rank correlation", _number("spearman")),
    ("ms a scan, p50", _number("ms_per_scan_p50")),
    ("p99.9", _number("ms_per_scan_p999")),
    ("memory, MB", _number("peak_memory_mb")),
)
