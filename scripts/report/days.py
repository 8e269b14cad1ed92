# SPDX-License-Identifier: Apache-2.0
"""The report's section over days: SLAMs in the map of the sessions before."""

from __future__ import annotations

from dataclasses import dataclass

from scripts.days import scores
from scripts.report import score_tables
from scripts.report.study import Study
from scripts.report.tables import Cell, Table


@dataclass(frozen=True, kw_only=True)
class Days:
    """The buildings of a scene at a level: what they show, a sentence a SLAM, and the table."""

    heading: str
    told: list[str]
    table: Table


def days(study: Study) -> list[Days]:
    """Scene by scene, level by level; none of a comparison without buildings."""
    rows = study.compared.ages
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
