# SPDX-License-Identifier: Apache-2.0
"""What ``mobilia lifelong`` prints and writes: a table, lifelong.csv, lifelong.json."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from scripts.comparison.tables import Row, write_csv
from scripts.console import plain_table
from scripts.days.lifelong import COLUMNS
from scripts.days.truth import AGE_COLUMNS
from slam.files import write_text

_FORMS = {
    "found_after_s": "{:.1f}", "rmse_m": "{:.3f}", "worst_m": "{:.3f}", "tracked": "{:.2f}",
    "disagrees": "{:.3f}", "outdated_told": "{:.2f}", "outdated_false": "{:.2f}",
    "ghost_rate": "{:.3f}", "ghost_seen_rate": "{:.3f}", "recall": "{:.2f}", "map_kb": "{:.0f}",
    "memory_mb": "{:.2f}", "load_s": "{:.2f}", "ms_per_scan": "{:.2f}",
}  # fmt: skip
_PRINTED = {
    "session": "session", "time_of_day": "time", "map": "map", "found_after_s": "found, s",
    "place": "place", "rmse_m": "rmse, m", "ghost_rate": "ghosts",
    "map_kb": "kB", "ms_per_scan": "ms",
}  # fmt: skip
_NOT_SHOWN = ("slam", "disagrees", "tracked", "memory_mb")

_APART = re.compile(r".*\.apart([0-9]+)\.npz")  # of a session that did not fit


def words(column: str, value: object) -> str:
    """A cell as text, "" for none."""
    return "" if value is None else _FORMS.get(column, "{}").format(value)


def printed(slam: str, rows: Sequence[Row], *, whole: bool = False) -> Table:
    """One SLAM's sessions; ``whole``: with every column that a page has room for."""
    found = plain_table(slam)
    every = {column: column.replace("_", " ") for column in COLUMNS if column not in _NOT_SHOWN}
    shown = every if whole else _PRINTED
    for heading in shown.values():
        found.add_column(heading, no_wrap=True)
    for row in rows:
        cells = {column: words(column, row[column]) for column in shown}
        cells["map"] = _APART.sub(r"apart \1", cells["map"])
        found.add_row(*map(escape, cells.values()))
    return found


def last_session(rows: Sequence[Row], changed: str) -> str:
    """The last session for who looks after the building; ``changed`` what is otherwise there."""
    row = rows[-1]
    head = f"Session {row['session']}: {changed or 'no map of before to compare with'}; "
    if row["place"] == "failed":
        return f"{head}`{row['slam']}` failed."
    if row["found_after_s"] is None:
        known = "not found in the map" if row["map"] != "anew" else "without a map of before"
        return f"{head}`{row['slam']}` drove {known}."
    held = row["tracked"]
    lost = "never lost" if held == 1.0 else f"in doubt in {100.0 * (1.0 - held):.0f} % of the scans"
    place = ", at a wrong place" if row["place"] == "wrong" else ""
    return f"{head}found in {row['found_after_s']:.0f} s{place}, {lost}."


def write(
    folder: Path,
    rows: Sequence[Row],
    settings: Mapping[str, Any],
    score: Mapping[str, Any] | None,
    aged: Sequence[Row] = (),
) -> None:
    """lifelong.csv, lifelong.json, and ages.csv if there are ``aged`` rows.

    ``score``: what of the changes is true (``report.changes_of``).
    """
    write_csv(folder / "lifelong.csv", rows, COLUMNS)
    whole = {
        "schema": 1,
        "settings": dict(settings),
        "rows": [dict(row) for row in rows],
        "ages": [dict(row) for row in aged],
        "changes": None if score is None else dict(score),
    }
    write_text(folder / "lifelong.json", json.dumps(whole, indent=2) + "\n")
    if aged:
        write_csv(folder / "ages.csv", aged, AGE_COLUMNS)


def ages_table(aged: Sequence[Row]) -> Table:
    """The last session in older maps."""
    shown = [column for column in AGE_COLUMNS if column != "session"]
    found = plain_table(f"session {aged[0]['session']} in a map some sessions old")
    for column in shown:
        found.add_column(column.replace("_", " "))
    for row in aged:
        found.add_row(*(escape(words(column, row[column])) for column in shown))
    return found
