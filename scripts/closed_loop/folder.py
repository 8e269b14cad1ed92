# SPDX-License-Identifier: Apache-2.0
"""The folder of ``mobilia drive``, as far as a report reads it: its recipe and ``levels.csv``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scripts.closed_loop.plan import SCHEMA
from scripts.closed_loop.tables import LEVEL_COLUMNS
from scripts.comparison.csv_files import Row, read_csv
from scripts.comparison.folder import axis_in, check_recipe
from scripts.comparison.rules import Columns, Rule, Table, check_keys, named, number, word
from scripts.output import RECIPE, check_whole
from slam.errors import LogFormatError

LEVELS = "levels.csv"
_COUNT, _SHARE = number(most=1e9, whole=True), number(most=1.0)
_SOME = number(least=1.0, most=1e9, whole=True)
_COLUMNS: Columns = {
    **dict.fromkeys(LEVEL_COLUMNS, number(optional=True)),
    "scene": word(), "dynamism": _SHARE, "slam": word(), "runs": _SOME, "goals": _SOME,
    **dict.fromkeys(
        ("reached", "wrong", "given_up", "failed", "given_up_taken", "runs_lost", "runs_recovered"),
        _COUNT,
    ),
    **dict.fromkeys(("success", "success_low", "success_high"), _SHARE),
}  # fmt: skip
TABLE = Table(
    columns=_COLUMNS, key=("scene", "dynamism", "slam"),
    parts=(
        *((outcome, "goals") for outcome in ("reached", "wrong", "given_up", "failed")),
        ("runs_lost", "runs"), ("runs_recovered", "runs_lost"),
    ),
)  # fmt: skip
"""``levels.csv``."""
_RECIPE: Mapping[str, Rule] = {"command": word(among=("drive",)), "settings": named({})}
_LOOP = named({"tolerance_m": number(most=1e9), "plan_on": word(among=("layout", "map"))})


@dataclass(frozen=True, kw_only=True)
class Driven:
    """The folder of a drive: its recipe's settings and the rows of its ``levels.csv``."""

    settings: dict[str, Any]
    rows: list[Row]

    @property
    def scene(self) -> str:
        """A drive has one."""
        return str(self.rows[0]["scene"])

    @property
    def slams(self) -> list[str]:
        """In the order in which they were named."""
        return list(dict.fromkeys(str(row["slam"]) for row in self.rows))

    @property
    def axis(self) -> str:
        """What the levels are of."""
        return str(self.settings.get("axis", "dynamism"))

    @property
    def levels(self) -> list[float]:
        """Of that axis, ascending."""
        return sorted({float(row["dynamism"]) for row in self.rows})

    def of(self, slam: str) -> list[Row]:
        """A SLAM's rows."""
        return [row for row in self.rows if row["slam"] == slam]


def driven(folder: Path, *, vouched: bool = False) -> Driven:
    """A drive on file; ``LogFormatError`` for a folder that holds none.

    vouched  the hashes of its files have been checked
    """
    check_whole(folder)
    path = folder / RECIPE
    settings = check_recipe(path, _RECIPE)["settings"]
    if settings.get("drive_schema") != SCHEMA:
        got = f"settings.drive_schema is {settings.get('drive_schema')!r:.80}"
        raise LogFormatError(folder, f"no closed-loop drive of schema {SCHEMA}: {got}")
    check_keys(path, "settings.", settings, {"loop": _LOOP})
    rows = read_csv(folder / LEVELS, TABLE, axis_in(settings, path), vouched=vouched)
    if not rows:
        raise LogFormatError(folder / LEVELS, "a table without rows")
    return Driven(settings=settings, rows=rows)


def drives_in(folder: Path) -> list[Path]:
    """The folders of drives within that of a comparison, which a report shows unasked."""
    return sorted(path for path in folder.glob("drive*") if path.is_dir())
