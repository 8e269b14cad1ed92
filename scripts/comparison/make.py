# SPDX-License-Identifier: Apache-2.0
"""A comparison as a study (``scripts.engine``), and its tables."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from scripts import engine
from scripts.comparison import folder as files
from scripts.comparison import tables
from scripts.comparison.plan import Plan
from scripts.comparison.recording import load
from scripts.comparison.run_file import merge
from scripts.comparison.schema import LEVELS, PAIRED, RUNS, SCHEMA
from scripts.comparison.tables import Row
from scripts.console import level_table
from scripts.engine import Files, Stage, Study
from scripts.metrics.table import DRIVES
from slam.errors import InvalidValueError
from slam.evaluation.lost import LOST_RULE
from slam.frames import BeamClass

Tables = Mapping[str, Sequence[Mapping[str, Any]]]
"""By the name of a file its rows."""


@dataclass(frozen=True, kw_only=True)
class Beside:
    """What else is made in the folder of a comparison, and the tables of it."""

    stages: Sequence[Stage]
    tables: Callable[[Files], Tables]


def carry_out(plan: Plan, out: Path, *, more: Beside | None = None, **ways: Any) -> list[Row]:
    """Make what is missing and write the tables; the rows of ``runs.csv``.

    more  what is made after the runs (``scripts.days.buildings.beside``)
    ways  ``jobs`` and ``cluster``, as ``scripts.engine.carry_out`` has them
    """
    return engine.carry_out(study(plan, more), out, **ways)


def study(plan: Plan, more: Beside | None = None) -> Study[list[Row]]:
    """All of a comparison; ``InvalidValueError`` for buildings over sessions without ``more``."""
    if plan.sessions is not None and more is None:
        raise InvalidValueError("Plan.sessions needs more=scripts.days.buildings.beside(plan)")

    def write(folder: Path, done: Files) -> list[Row]:
        rows = _rows(plan, folder, done)
        own = {RUNS: rows, LEVELS: tables.levels(rows), PAIRED: tables.pairs(rows)}
        for name, table in {**own, **(more.tables(done) if more else {})}.items():
            files.write_table(folder / name, table, plan.axis)
        return rows

    return Study(
        command="compare",
        settings={"compare_schema": SCHEMA, **plan.settings(), "lost_rule": LOST_RULE},
        slams=plan.slams,
        scenes=plan.scenes,
        stages=(*plan.stages(), *(more.stages if more else ())),
        write=write,
    )


def _rows(plan: Plan, folder: Path, done: Files) -> list[Row]:
    """Those of ``runs.csv``; each run goes into a file of ``runs/``."""
    entries: dict[str, dict[str, Path]] = {}
    for run, slam, job in plan.entries():
        entries.setdefault(run.name, {})[slam] = done[job.name]
    rows: list[Row] = []
    for run in plan.runs():
        merged = merge(folder / "runs" / f"{run.name}.npz", done[run.name], entries[run.name])
        about = {k: v for k, v in asdict(run).items() if k != "axis"} | _about(done[run.name])
        rows += [about | row for row in merged]
    return rows


def _about(recording: Path) -> dict[str, float]:
    """What a run itself was like: the columns ``DRIVES``."""
    drive = load(recording)
    truth = drive.truth()
    values = (
        float(truth.stamps_ns[-1] - truth.stamps_ns[0]) / 1e9,
        truth.length_m(),
        drive.share_of_returns(BeamClass.MOVING),
        drive.share_of_returns(BeamClass.SEMI_STATIC),
    )
    return dict(zip(DRIVES, values, strict=True))


def median_errors(plan: Plan, scene: str, rows: list[Row]) -> Table:
    """Median error and runs lost, to be printed."""
    summary = {
        (row["dynamism"], row["slam"], row["metric"]): row["value"]
        for row in tables.levels([row for row in rows if row["scene"] == scene])
    }

    def cell(level: float, slam: str) -> str:
        ate_cm = 100.0 * summary[level, slam, "ate_unaligned_m"]
        shown = f"{ate_cm:.2f}" if math.isfinite(ate_cm) else "failed"
        lost = round(summary[level, slam, "lost"] * len(plan.seeds))
        return f"{shown} ({lost})"

    title = f"{scene}: median unaligned ATE in cm (runs lost of {len(plan.seeds)})"
    return level_table(title, f"lost: {LOST_RULE}", plan.levels, plan.slams, cell, plan.axis)
