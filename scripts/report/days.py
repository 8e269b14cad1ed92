# SPDX-License-Identifier: Apache-2.0
"""The report's section over days: SLAMs in the map of the sessions before."""

from __future__ import annotations

from dataclasses import dataclass

from scripts.days import scores
from scripts.report import score_tables
from scripts.report.study import Study
from scripts.report.tables import Cell, Table
from slam.errors import LogFormatError


@dataclass(frozen=True, kw_only=True)
class Days:
    """The buildings of a scene at a level: what they show, a sentence a SLAM, and the table."""

    heading: str
    told: list[str]
    table: Table


def days(study: Study) -> list[Days]:
    """Scene by scene, level by level; none of a comparison without buildings.

    Raises ``LogFormatError`` for tables that are not what ``mobilia compare`` writes.
    """
    rows = study.compared.ages
    if not rows:
        return []
    missing = [column for column in scores.COLUMNS if column not in rows[0]]
    if missing:
        where = study.compared.folder / "ages.csv"
        raise LogFormatError(where, f"a table without the column '{missing[0]}'")
    return [
        Days(
            heading=score_tables.where(group),
            told=score_tables.sentences(own),
            table=_table(own),
        )
        for group, own in score_tables.groups(rows).items()
    ]


def _table(rows: list[scores.Row]) -> Table:
    names = score_tables.slams_of(rows)
    lines = [
        [Cell(text=heading), *(Cell(text=text, small=small) for text, small in cells)]
        for heading, cells in score_tables.table(rows)
    ]
    caption = score_tables.size(rows)
    return Table(caption=caption, head=["score", *names], rows=lines, slams=names)
