# SPDX-License-Identifier: Apache-2.0
"""Many buildings as a whole: simulate their sessions, let the SLAMs live there, sum up."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from scripts.comparison.make import Tables
from scripts.comparison.plan import Plan
from scripts.comparison.schema import AGES, AGES_LEVELS
from scripts.days import living, scores
from scripts.days.plan import LIVES, SESSIONS, Buildings, identity, of_comparison
from scripts.jobs import run_jobs

DAYS = "days"  # folder of what buildings take, within a comparison or a benchmark


def carry_out(
    buildings: Buildings, out: Path, *, jobs: int = 1, cluster: str | None = None
) -> list[dict[str, Any]]:
    """Make what is missing in ``out``; a row (``scores.COLUMNS``) for each SLAM and building."""
    ways: dict[str, Any] = {"processes": jobs, "cluster": cluster}
    recordings = [job for own in buildings.recordings().values() for job in own]
    run_jobs(recordings, out / SESSIONS, title="simulating sessions", **ways)
    lives = list(buildings.lives())
    only = [job for _, _, job in lives]
    done = run_jobs(only, out / LIVES, title="living in buildings", **ways)
    rows = []
    for recipe, slam, job in lives:
        found = living.read(done[job.name])
        of = {**identity(recipe), "slam": slam}
        rows.append(scores.of_building(of, found["rows"], found["ages"], found["failure"]))
    return rows


def beside(plan: Plan) -> Callable[..., Tables] | None:
    """For ``scripts.comparison.make.carry_out``: the buildings of a comparison, and the tables of
    their scores; None of one without sessions. Raises ``InvalidValueError`` for what cannot be.
    """
    buildings = of_comparison(plan)
    if buildings is None:
        return None

    def make(out: Path, **ways: Any) -> Tables:
        rows = carry_out(buildings, out / DAYS, **ways)
        summary = scores.levels(rows)
        return {AGES: rows, AGES_LEVELS: summary}

    return make
