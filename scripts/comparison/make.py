# SPDX-License-Identifier: Apache-2.0
"""A comparison as a whole: simulate, run the SLAMs, write tables; what is there stays."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from scripts.comparison import folder as files
from scripts.comparison import tables
from scripts.comparison.plan import ENTRIES, RECORDINGS, Plan
from scripts.comparison.recording import load
from scripts.comparison.run_file import merge
from scripts.comparison.schema import LEVELS, PAIRED, RUNS, RUNS_JSON, SCHEMA
from scripts.console import level_table
from scripts.jobs import Job, run_jobs, try_names
from scripts.machine import machine
from scripts.metrics.table import DRIVES
from scripts.output import result_folder
from slam.errors import InvalidValueError
from slam.evaluation.lost import LOST_RULE
from slam.frames import BeamClass

Tables = Mapping[str, Sequence[Mapping[str, Any]]]
"""By the name of a file its rows."""


def carry_out(
    plan: Plan,
    out: Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    more: Callable[..., Tables] | None = None,
) -> list[dict[str, Any]]:
    """Make what is missing and write the tables; the rows of ``runs.csv``.

    more  called as ``more(out, jobs=jobs, cluster=cluster)`` after the runs: what else is to be
          made in ``out``, and the tables of it (``scripts.days.buildings.beside``)
    """
    try_names(plan.slams, plan.scenes)
    if plan.sessions is not None and more is None:
        raise InvalidValueError("Plan.sessions needs more=scripts.days.buildings.beside(plan)")
    out = out.absolute()
    settings = {"compare_schema": SCHEMA, **plan.settings(), "lost_rule": LOST_RULE}
    settings["machine"] = machine()
    with result_folder(out, "compare", settings) as written:
        simulations, entries = plan.recordings(), list(plan.entries())
        ways: dict[str, Any] = {"processes": jobs, "cluster": cluster}
        recordings = run_jobs(simulations.values(), out / RECORDINGS, title="simulating", **ways)
        only: list[Job] = [job for _, _, job in entries]
        done = run_jobs(only, out / ENTRIES, title="running SLAMs", **ways)
        added = {} if more is None else more(out, jobs=jobs, cluster=cluster)
        with written() as staged:
            rows: list[dict[str, Any]] = []
            for run in plan.runs():
                own = {name: done[job.name] for its, name, job in entries if its == run}
                merged = merge(staged / "runs" / f"{run.name}.npz", recordings[run.name], own)
                about = {k: v for k, v in asdict(run).items() if k != "axis"}
                about |= _about(recordings[run.name])
                rows += [about | row for row in merged]
            files.write_json(staged / RUNS_JSON, rows, plan.axis)
            own_tables = {RUNS: rows, LEVELS: tables.levels(rows), PAIRED: tables.pairs(rows)}
            for name, table in {**own_tables, **added}.items():
                files.write_table(staged / name, table, plan.axis)
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


def median_errors(plan: Plan, scene: str, rows: list[dict[str, Any]]) -> Table:
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
