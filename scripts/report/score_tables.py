# SPDX-License-Identifier: Apache-2.0
"""Scores of age in tables and sentences, the same on a terminal, a report and a leaderboard."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rich.table import Table as Printed

from scripts.comparison.schema import ANEW
from scripts.comparison.tables import grouped
from scripts.days.scores import SCORES, Row, Score, first_words, levels
from scripts.metrics.table import digits
from scripts.pages.table import NONE, Cell, Table
from scripts.report.answer import percent
from scripts.report.study import LEAST_RUNS

STARTS_ANEW = "starts anew: cannot load a map"
_ANEW = Cell(text="starts anew", small="cannot load a map")
_LOADED = Cell(text="loaded", small="in each session")
_PRINTED = (
    "found_share", "found_soon_share", "wrong_share", "rmse_session0_m", "rmse_session1_m",
    "rmse_last_m", "rmse_growth", "rmse_age1_m", "rmse_age3_m", "rmse_age10_m", "ghost_rate_early",
    "ghost_rate_late", "recall_early", "recall_late", "ms_per_scan_early", "ms_per_scan_late",
    "failed_share",
)  # fmt: skip
Group = tuple[Any, ...]  # scene, motion, change


def groups(rows: Sequence[Row]) -> dict[Group, list[Row]]:
    """Rows of buildings by scene, motion and change."""
    return grouped(rows, ("scene", "motion", "change"))


def where(group: Group) -> str:
    """Such as "random-rooms, motion 0, change 0.3"."""
    scene, motion, change = group
    return f"{scene}, motion {motion:g}, change {change:g}"


def size(rows: Sequence[Row]) -> str:
    """Of a group: "6 buildings of 11 sessions"."""
    n = len({row["seed"] for row in rows})
    return f"{n} building{'s' if n != 1 else ''} of {int(rows[0]['sessions'])} sessions"


def slams_of(rows: Sequence[Row]) -> list[str]:
    """In order."""
    return list(dict.fromkeys(str(row["slam"]) for row in rows))


def table(rows: Sequence[Row], scores: Sequence[Score] = SCORES) -> Table:
    """Of one group: a row for each score, a column for each SLAM.

    A score that no SLAM has is left out, so are failures where nothing failed.
    """
    names = slams_of(rows)
    found = {(row["slam"], row["metric"]): row for row in levels(rows)}
    kinds = {row["slam"]: row["map"] for row in rows}
    lines = [[Cell(text="map"), *(_ANEW if kinds[name] == ANEW else _LOADED for name in names)]]
    for score in scores:
        own = [found.get((name, score.key)) for name in names]
        there = [row for row in own if row is not None]
        if not there or (score.key == "failed_share" and not any(r["value"] for r in there)):
            continue
        lines.append([Cell(text=score.heading), *(_cell(score, row) for row in own)])
    return Table(caption=size(rows), head=["score", *names], rows=lines, slams=names)


def _cell(score: Score, row: Row | None) -> Cell:
    """The value, and its interval where there are enough of them."""
    if row is None:
        return Cell(text=NONE)
    n = int(row["n"])
    if score.hits:
        hits = round(row["value"] * n)
        return Cell(text=f"{hits} of {n}", small=percent(hits, n))
    ends = [score.factor * row[end] for end in ("low", "high")]
    small = " to ".join(map(digits, ends)) if n >= LEAST_RUNS and ends != [math.inf] * 2 else ""
    return Cell(text=digits(score.factor * row["value"]), small=small)


def printed(group: Group, rows: Sequence[Row]) -> Printed:
    """Of one group for the terminal: the scores that matter most."""
    found = table(rows, [score for score in SCORES if score.key in _PRINTED])
    caption = f"{where(group)}: {found.caption}"
    return replace(found, caption=caption, head=["", *found.slams]).printed()


def sentences(rows: Sequence[Row]) -> list[str]:
    """Of one group what it shows, a line for each SLAM, names in backticks."""
    found = {(row["slam"], row["metric"]): row for row in levels(rows)}
    said = []
    for name in slams_of(rows):
        own = [row for row in rows if row["slam"] == name]
        of = {key: row for (slam, key), row in found.items() if slam == name}
        parts = [STARTS_ANEW] if own[0]["map"] == ANEW else _found(of)
        parts += [*_errors(of, anew=own[0]["map"] == ANEW), *_over_time(of), *_failures(own)]
        said.append(f"`{name}`: {'; '.join(parts)}.")
    return said


def _found(of: dict[str, Any]) -> list[str]:
    if "found_share" not in of:
        return ["nothing to be found"]
    n = int(of["found_share"]["n"])
    found, soon, wrong = (
        round(of[key]["value"] * n) for key in ("found_share", "found_soon_share", "wrong_share")
    )
    place = f"{wrong} at a wrong place" if wrong else "never at a wrong place"
    return [f"found {found} of {n} sessions from an unknown start, {soon} within 10 s, {place}"]


def _errors(of: dict[str, Any], *, anew: bool) -> list[str]:
    both_ends = (("rmse_session1_m", "in session 1"), ("rmse_last_m", "in the last"))
    ends = [(value, at) for key, at in both_ends if (value := _value(of, key)) is not None]
    if not ends:
        return []
    frame = ", each in a frame of its own" if anew else ""
    said = f"error {', '.join(f'{_cm(value)} {at}' for value, at in ends)}{frame}"
    old = [(age, _value(of, f"rmse_age{age}_m")) for age in (10, 3, 1)]
    there = [(age, value) for age, value in old if value is not None]
    if there:
        age, value = there[0]
        said += f", {_cm(value)} in a map {age} session{'s' if age > 1 else ''} old"
    return [said]


def _over_time(of: dict[str, Any]) -> list[str]:
    early, late = _value(of, "ghost_rate_early"), _value(of, "ghost_rate_late")
    if early is None or late is None:
        return []
    return [f"ghosts {digits(100.0 * early)} % early, {digits(100.0 * late)} % late"]


def _failures(rows: Sequence[Row]) -> list[str]:
    failed = sum(int(row["failed"]) for row in rows)
    if not failed:
        return []
    told = next(str(row["failure"]) for row in rows if row["failed"])
    n = sum(int(row["sessions"]) for row in rows)
    return [f"failed in {failed} of {n} sessions, first: `{first_words(told)}`"]


def _value(of: dict[str, Any], key: str) -> float | None:
    return float(of[key]["value"]) if key in of else None


def _cm(value_m: float) -> str:
    return f"{digits(100.0 * value_m)} cm"
