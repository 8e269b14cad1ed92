# SPDX-License-Identifier: Apache-2.0
"""A dataset as a whole: the episodes that are missing, on all processes, with a progress bar."""

from __future__ import annotations

import time
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from scripts import interrupt, workers
from scripts.console import note, plain_table, progress
from scripts.pace import Work, learn
from sim.recording.dataset import Dataset, Plan, writing
from sim.recording.episode import record
from sim.recording.recipe import RECIPE, Recipe, read_recipe


def carry_out(plan: Plan, out: Path, *, jobs: int = 1, cluster: str | None = None) -> Table:
    """Make what is missing of the dataset in ``out``; a table of what it has then."""
    with writing(out, plan) as dataset:
        missing, notes = dataset.missing()
        for line in notes:
            note(line)
        started = time.perf_counter()
        _make(dataset, missing, jobs, cluster)
        dataset.finish()
        spent = time.perf_counter() - started
    return summary(dataset, len(missing), spent)


def _make(dataset: Dataset, missing: list[Recipe], jobs: int, cluster: str | None) -> None:
    """Every missing episode, with a bar."""
    total = len(dataset.plan.jobs())
    done = total - len(missing)
    call = partial(_one, dataset.path)
    with progress() as bar:
        task = bar.add_task("generating", unit="", total=total, completed=done, before=done)
        for spent in workers.each(call, missing, jobs=jobs, cluster=cluster, shared=dataset.path):
            interrupt.check()
            done += 1
            bar.update(task, completed=done, unit=f"{done}/{total} episodes")
            if cluster is None:
                learn([spent])


def _one(folder: Path, recipe: Recipe) -> tuple[Work, float]:
    """A job, here or in a worker: what it was, and s that it took."""
    started = time.perf_counter()
    record(recipe, folder, note=interrupt.check)
    return Work(f"generate {recipe.scene}", recipe.seconds), time.perf_counter() - started


def summary(dataset: Dataset, made: int, spent_s: float) -> Table:
    """Episodes, frames, distance, what returns came from, bytes: a row a scene and dynamism."""
    plan = dataset.plan
    scenes = plan.scenes or (plan.recipe.scene,)
    made_now = f"{', '.join(scenes)}: {made} of {len(plan.jobs())} made now"
    table = plain_table(made_now, caption=f"{spent_s:.1f} s")
    returns = ("moving", "semi static", "static")
    table.add_column("scene", overflow="fold")
    for heading in ("dynamism", "episodes", "frames", "driven, m", *returns, "MB"):
        longest = max(map(len, heading.split()))
        table.add_column(heading, justify="right", min_width=longest)
    for scene, level in product(scenes, plan.dynamisms):
        jobs = [job for job in plan.jobs() if (job.scene, job.dynamism) == (scene, level)]
        folders = [dataset.path / name for job in jobs for name in plan.folders(job)]
        table.add_row(escape(scene), f"{level:g}", *_row(folders))
    return table


def _row(folders: list[Path]) -> list[str]:
    results: list[Any] = [read_recipe(folder / RECIPE).result for folder in folders]
    returns = {
        name: sum(int(result["returns"][name]) for result in results)
        for name in ("moving", "semi_static", "static")
    }
    beams = max(sum(returns.values()), 1)
    size = sum(file.stat().st_size for folder in folders for file in folder.iterdir())
    return [
        str(len(folders)),
        str(sum(int(result["frames"]) for result in results)),
        f"{sum(float(result['distance_m']) for result in results):.1f}",
        *(f"{100.0 * count / beams:.1f} %" for count in returns.values()),
        f"{size / 1e6:.1f}",
    ]
