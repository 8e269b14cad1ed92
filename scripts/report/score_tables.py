# SPDX-License-Identifier: Apache-2.0
"""Scores of age in tables and sentences, the same on a terminal, a report and a leaderboard."""

import math
from collections.abc import Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from scripts.comparison.schema import ANEW
from scripts.comparison.tables import grouped
from scripts.console import plain_table
from scripts.days.scores import SCORES, Row, Score, first_words, levels
from scripts.metrics.table import digits
from scripts.report.answer import percent
from scripts.report.study import LEAST_RUNS

NONE = "–"
STARTS_ANEW = "starts anew: cannot load a map"
_ANEW, _DAYS = ("starts anew", "cannot load a map"), ("loaded", "in each session")
_PRINTED = (
    "found_share", "found_soon_share", "wrong_share", "rmse_session0_m", "rmse_session1_m",
    "rmse_last_m", "rmse_growth", "rmse_age1_m", "rmse_age3_m", "rmse_age10_m", "ghost_rate_early",
    "ghost_rate_late", "recall_early", "recall_late", "ms_per_scan_early", "ms_per_scan_late",
    "failed_share",
)  # fmt: skip
Group = tuple[Any, ...]  # scene, motion, change
Cells = list[tuple[str, str]]  # text and small print of each SLAM


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


def table(rows: Sequence[Row], scores: Sequence[Score] = SCORES) -> list[tuple[str, Cells]]:
    """Of one group: for each score its heading, and the cells of the SLAMs (``slams_of``).

    A score that no SLAM has is left out, so are failures where nothing failed.
    """
    names = slams_of(rows)
    found = {(row["slam"], row["metric"]): row for row in levels(rows)}
    kinds = {row["slam"]: row["map"] for row in rows}
    out: list[tuple[str, Cells]] = [
        ("map", [_ANEW if kinds[name] == ANEW else _DAYS for name in names])
    ]
    for score in scores:
        own = [found.get((name, score.key)) for name in names]
        there = [row for row in own if row is not None]
        if not there or (score.key == "failed_share" and not any(r["value"] for r in there)):
            continue
        out.append((score.heading, [_cell(score, row) for row in own]))
    return out


def _cell(score: Score, row: Row | None) -> tuple[str, str]:
    """The value, and its interval where there are enough of them."""
    if row is None:
        return NONE, ""
    n = int(row["n"])
    if score.hits:
        hits = round(row["value"] * n)
        return f"{hits} of {n}", percent(hits, n)
    ends = [score.factor * row[end] for end in ("low", "high")]
    small = " to ".join(map(digits, ends)) if n >= LEAST_RUNS and ends != [math.inf] * 2 else ""
    return digits(score.factor * row["value"]), small


def printed(group: Group, rows: Sequence[Row]) -> Table:
    """Of one group for the terminal: a column for each SLAM."""
    found = plain_table(f"{where(group)}: {size(rows)}")
    found.add_column("")
    for name in slams_of(rows):
        found.add_column(escape(name), justify="right", overflow="fold")
    for heading, cells in table(rows, [score for score in SCORES if score.key in _PRINTED]):
        found.add_row(heading, *(escape(both(*cell)) for cell in cells))
    return found


def both(text: str, small: str) -> str:
    """A cell with its small print in brackets."""
    return f"{text} [{small}]" if small else text


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
