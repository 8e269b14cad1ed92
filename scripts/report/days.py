# SPDX-License-Identifier: Apache-2.0
"""The report's section over days: SLAMs in the maps of the sessions before, building by building."""

from __future__ import annotations

from dataclasses import dataclass

from scripts.days import score_tables, scores
from scripts.report.study import Study
from scripts.report.tables import Cell, Table
from slam.errors import LogFormatError


@dataclass(frozen=True, kw_only=True)
class Days:
    """One scene: at each level what it shows, a sentence a SLAM, and its table."""

    scene: str
    levels: list[tuple[list[str], Table]]


def days(study: Study) -> list[Days]:
    """Scene by scene; none of a comparison without buildings.

    Raises ``LogFormatError`` for tables that are not what ``mobilia compare`` writes.
    """
    rows = study.compared.ages
    if not rows:
        return []
    missing = [column for column in scores.COLUMNS if column not in rows[0]]
    if missing:
        where = study.compared.folder / "ages.csv"
        raise LogFormatError(where, f"a table without the column '{missing[0]}'")
    found: dict[str, list[tuple[list[str], Table]]] = {}
    for group, own in score_tables.groups(rows).items():
        told = score_tables.sentences(own)
        found.setdefault(group[0], []).append((told, _table(group, own)))
    return [Days(scene=scene, levels=made) for scene, made in found.items()]


def _table(group: score_tables.Group, rows: list[scores.Row]) -> Table:
    names = score_tables.slams_of(rows)
    lines = [
        [Cell(text=heading), *(Cell(text=text, small=small) for text, small in cells)]
        for heading, cells in score_tables.table(rows)
    ]
    caption = score_tables.title(group, rows)
    return Table(caption=caption, head=["score", *names], rows=lines, slams=names)
