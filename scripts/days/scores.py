# SPDX-License-Identifier: Apache-2.0
"""Scores of age: one row for each building and SLAM, and their summary over buildings.

Rows of sessions are those of ``scripts.days.lifelong``. Session 0 maps the building, all later ones
are to be found in its map. Early are the five sessions after it, late are the last five: a day
each. At night doors are shut that the map of the evening holds open.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from scripts.comparison import schema
from scripts.comparison.schema import ANEW, DAYS, OVER_TIME
from scripts.comparison.schema import OLD as AGES
from scripts.comparison.tables import median_of, share_of, summary
from sim.world.times_of_day import DAY

Row = Mapping[str, Any]
SOON_S = 10.0  # within which a session is to be found
_OF_A_MAP = ("ghost_seen_rate", "map_kb", "memory_mb", "load_s")  # none for a SLAM without days
A_DAY = len(DAY)  # sessions
_ERRORS = ("rmse_session0_m", "rmse_session1_m", "rmse_last_m")
COLUMNS = tuple(schema.TABLES[schema.AGES].columns)
"""Of ages.csv: docs/days.md says what they are."""
LEVEL_COLUMNS = tuple(schema.TABLES[schema.AGES_LEVELS].columns)
"""Of ages_levels.csv."""


def later(rows: Sequence[Row]) -> list[Row]:
    """Those that are to be found in the map of the sessions before."""
    return [row for row in rows if row["session"] > 0 and row["map"] != "new"]


def early(rows: Sequence[Row]) -> list[Row]:
    """The first sessions after the one that maps the building."""
    return list(rows[1 : 1 + A_DAY])


def late(rows: Sequence[Row]) -> list[Row]:
    """The last sessions; of a short building the same as the early ones."""
    return list(rows[1:][-A_DAY:])


def mean(rows: Sequence[Row], column: str) -> float | None:
    """Of the rows that have a number there; None where none has."""
    values = [float(row[column]) for row in rows if row.get(column) is not None]
    return sum(values) / len(values) if values else None


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """Of ``later`` sessions: how many there are, were found, soon, and at a wrong place.

    known       those that began where a session before had been (all, without truth)
    """
    known = [row for row in rows if row["start"] != "unknown"]
    return {
        "to_find": len(rows),
        "found": sum(row["found_after_s"] is not None for row in rows),
        "found_soon": _soon(rows),
        "wrong": sum(row["place"] == "wrong" for row in rows),
        "known": len(known),
        "known_soon": _soon(known),
    }


def _soon(rows: Sequence[Row]) -> int:
    return sum(r["found_after_s"] is not None and r["found_after_s"] <= SOON_S for r in rows)


def of_building(
    identity: Row, rows: Sequence[Row], aged: Sequence[Row], failure: str | None = None
) -> dict[str, Any]:
    """The row (``COLUMNS``) of one SLAM in one building.

    rows   of its sessions, in order; ``aged``: of the last one in older maps
    failure  what was said when it first failed

    Of a SLAM that starts anew, all that is about a map of before is None; its errors are in the
    frame of each session. A session that failed has an infinite error, one not found has none.
    """
    anew = all(row["map"] == ANEW for row in rows)
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row |= dict(identity)
    row |= {"map": ANEW if anew else DAYS, "sessions": len(rows), "failure": failure}
    row["failed"] = sum(one["place"] == "failed" for one in rows)
    for column, k in zip(_ERRORS, (0, 1, len(rows) - 1), strict=True):
        row[column] = _error(rows[k]) if k < len(rows) else None
    for column in OVER_TIME:
        if not (anew and column in _OF_A_MAP):
            row[f"{column}_early"] = mean(early(rows), column)
            row[f"{column}_late"] = mean(late(rows), column)
    return row if anew else row | _of_days(row, rows, aged)


def _of_days(row: Row, rows: Sequence[Row], aged: Sequence[Row]) -> dict[str, Any]:
    """What only a SLAM that can load a map has."""
    own = later(rows)
    found: dict[str, Any] = dict(counts(own))
    if own:
        found["found_share"] = found["found"] / len(own)
        found["found_soon_share"] = found["found_soon"] / len(own)
    first, last = row["rmse_session1_m"], row["rmse_last_m"]
    if first and last is not None and math.isfinite(first):
        found["rmse_growth"] = last / first
    for one in aged:
        found[f"right_age{one['age']}"] = int(one["place"] == "right")
        found[f"rmse_age{one['age']}_m"] = _error(one)
    found["outdated_told"] = mean(own, "outdated_told")
    found["outdated_false"] = mean(own, "outdated_false")
    return found


def first_words(failure: str) -> str:
    """What a SLAM said when it failed, as one line that Markdown leaves as it is in backticks."""
    return " ".join(failure.partition("\n")[0][:200].replace("`", "'").split())


def _error(row: Row) -> float | None:
    return math.inf if row["place"] == "failed" else row["rmse_m"]


@dataclass(frozen=True, kw_only=True)
class Score:
    """One number over buildings.

    hits, of  columns that are added up over buildings for a share; "" for a median of ``key``
    name      in tables; its unit is ``shown``, ``factor`` times that of the column
    """

    key: str
    name: str
    shown: str = ""
    factor: float = 1.0
    hits: str = ""
    of: str = ""

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name}, {self.shown}" if self.shown else self.name


def _pair(column: str, name: str, shown: str, factor: float = 1.0) -> tuple[Score, ...]:
    return tuple(
        Score(key=f"{column}_{when}", name=f"{name}, {when}", shown=shown, factor=factor)
        for when in ("early", "late")
    )


def _aged(age: int) -> tuple[Score, Score]:
    words = f"{age} session{'s' if age > 1 else ''} old"
    return (
        Score(key=f"rmse_age{age}_m", name=f"error in a map {words}", shown="cm", factor=100.0),
        Score(key=f"right_age{age}_share", name=f"found at the right place in a map {words}",
              hits=f"right_age{age}"),
    )  # fmt: skip


SCORES = (
    Score(key="found_share", name="sessions found", hits="found", of="to_find"),
    Score(key="found_soon_share", name="found within 10 s", hits="found_soon", of="to_find"),
    Score(key="wrong_share", name="found at a wrong place", hits="wrong", of="to_find"),
    Score(key="rmse_session0_m", name="error of session 0", shown="cm", factor=100.0),
    Score(key="rmse_session1_m", name="error of session 1", shown="cm", factor=100.0),
    Score(key="rmse_last_m", name="error of the last session", shown="cm", factor=100.0),
    Score(key="rmse_growth", name="the last to session 1"),
    *(score for age in AGES for score in _aged(age)),
    *_pair("ghost_rate", "ghosts", "%", 100.0),
    *_pair("ghost_seen_rate", "ghosts seen empty", "%", 100.0),
    *_pair("recall", "recall", "%", 100.0),
    *_pair("map_kb", "map file", "kB"),
    *_pair("memory_mb", "cells in memory", "MB"),
    *_pair("ms_per_scan", "time of a scan", "ms"),
    *_pair("load_s", "loading", "s"),
    Score(key="outdated_told", name='"outdated here" where it is', shown="%", factor=100.0),
    Score(key="outdated_false", name='"outdated here" where it is not', shown="%", factor=100.0),
    Score(key="failed_share", name="sessions that failed", hits="failed", of="sessions"),
)  # fmt: skip


def levels(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Summary (``LEVEL_COLUMNS``) over the buildings of a scene, motion and change, SLAM by SLAM.

    Medians with their bootstrap interval; shares of all sessions with Wilson's. Both are of 95 %.
    """
    by_key = {score.key: score for score in SCORES}

    def summed(metric: str, group: Sequence[Row]) -> dict[str, Any]:
        score = by_key[metric]
        own = [row for row in group if row[score.hits or score.key] is not None]
        if not score.hits:
            return median_of([float(row[metric]) for row in own])
        n = sum(int(row[score.of]) for row in own) if score.of else len(own)
        return share_of(sum(int(row[score.hits]) for row in own), n)

    return summary(rows, ("scene", "motion", "change", "slam"), by_key, summed)
