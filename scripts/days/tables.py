# SPDX-License-Identifier: Apache-2.0
"""What ``mobilia lifelong`` prints and writes: a table, lifelong.csv, lifelong.json, a page."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from scripts.console import plain_table
from scripts.days.ages import COLUMNS as AGE_COLUMNS
from scripts.days.lifelong import COLUMNS
from scripts.days.scores import counts, first_words
from sim.recording.tables import table
from slam.files import write_text

Row = Mapping[str, Any]
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
_SHOWN = (
    "session", "time_of_day", "map", "start", "found_after_s", "place", "rmse_m", "worst_m",
    "outdated_told", "outdated_false", "ghost_rate", "ghost_seen_rate", "recall", "map_kb",
    "load_s", "ms_per_scan",
)  # fmt: skip

_APART = re.compile(r".*\.apart([0-9]+)\.npz")  # of a session that did not fit


def words(column: str, value: object) -> str:
    """A cell as text, "" for none."""
    return "" if value is None else _FORMS.get(column, "{}").format(value)


def printed(slam: str, rows: Sequence[Row]) -> Table:
    """One SLAM's sessions."""
    found = plain_table(slam)
    for heading in _PRINTED.values():
        found.add_column(heading, no_wrap=True)
    for row in rows:
        cells = {column: words(column, row[column]) for column in _PRINTED}
        cells["map"] = _APART.sub(r"apart \1", cells["map"])
        found.add_row(*map(escape, cells.values()))
    return found


def verdict(rows: Sequence[Row], failure: str | None = None) -> str:
    """How many sessions were found, whether the last is as good as the first, and ``failure``:
    what the SLAM said when it first failed.
    """
    failed = sum(row["place"] == "failed" for row in rows)
    end = f"; failed in {failed} of {len(rows)} sessions" if failed else ""
    end += f", first: `{first_words(failure)}`" if failure else ""
    if all(row["map"] == "anew" for row in rows):
        return "cannot load a map: every session starts anew, in a frame of its own" + end
    later = [row for row in rows if row["map"] != "new"]
    of = counts(later)
    text = (
        f"{of['found']} of {of['to_find']} sessions found, {of['found_soon']} within 10 s, "
        f"{of['wrong']} at a wrong place"
    )
    if of["known"] < of["to_find"]:
        text += f"; {of['to_find'] - of['known']} began where no session before had been"
    measured = [row["rmse_m"] for row in rows if row["rmse_m"] is not None]
    if len(measured) > 1 and measured[0]:
        text += f"; error of the last session {measured[-1] / measured[0]:.2f} of the first's"
    return text + end


def write(
    folder: Path,
    rows: Sequence[Row],
    settings: Mapping[str, Any],
    changes: tuple[str, Mapping[str, Any] | None],
    aged: Sequence[Row] = (),
    failures: Mapping[str, str] | None = None,
) -> None:
    """lifelong.csv, lifelong.json, lifelong.md, and ages.csv if there are ``aged`` rows.

    ``changes`` is the page's part on them, and what of them is true (``report.changes_page``),
    ``failures`` by SLAM what it said when it first failed.
    """
    part, score = changes
    cells = [[words_exactly(row[column]) for column in COLUMNS] for row in rows]
    write_text(folder / "lifelong.csv", table(COLUMNS, cells))
    whole = {
        "schema": 1,
        "settings": dict(settings),
        "rows": [dict(row) for row in rows],
        "ages": [dict(row) for row in aged],
        "changes": None if score is None else dict(score),
    }
    write_text(folder / "lifelong.json", json.dumps(whole, indent=2) + "\n")
    if aged:
        old = [[words_exactly(row[column]) for column in AGE_COLUMNS] for row in aged]
        write_text(folder / "ages.csv", table(AGE_COLUMNS, old))
    write_text(folder / "lifelong.md", page(rows, settings, failures) + ages_part(aged) + part)


def ages_part(aged: Sequence[Row]) -> str:
    """The page's table of the last session in older maps; "" without any."""
    if not aged:
        return ""
    number = aged[0]["session"]
    shown = [c for c in AGE_COLUMNS if c != "session"]
    return f"\n## Session {number} in a map some sessions old\n\n{_markdown(shown, aged)}"


def _markdown(columns: Sequence[str], rows: Sequence[Row]) -> str:
    heads = [column.replace("_", " ") for column in columns]
    cells = [[words(column, row[column]) for column in columns] for row in rows]
    lines = ["| " + " | ".join(line) + " |\n" for line in (heads, *cells)]
    return "".join([lines[0], "|" + "---|" * len(heads) + "\n", *lines[1:]])


def words_exactly(value: object) -> str:
    """A field of the CSV: numbers with all that they hold."""
    return "" if value is None else repr(value) if isinstance(value, float) else str(value)


def page(
    rows: Sequence[Row], settings: Mapping[str, Any], failures: Mapping[str, str] | None = None
) -> str:
    """The tables of all SLAMs as Markdown."""
    building = ", ".join(f"{key} {value}" for key, value in settings.items())
    parts = [f"# A building over {len({r['session'] for r in rows})} sessions\n\n{building}\n"]
    for slam in dict.fromkeys(row["slam"] for row in rows):
        own = [row for row in rows if row["slam"] == slam]
        said = verdict(own, (failures or {}).get(slam))
        parts.append(f"\n## {slam}\n\n{said}\n\n{_markdown(_SHOWN, own)}")
    return "".join(parts)
