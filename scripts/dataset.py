# SPDX-License-Identifier: Apache-2.0
"""A dataset as a whole: the episodes that are missing, on all processes, with a progress bar."""

import time
from collections.abc import Callable
from functools import partial
from itertools import count, product
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from scripts import interrupt, workers
from scripts.console import note, plain_table, progress
from scripts.options import rate_hz
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
    """Every missing episode, with a bar that counts simulated seconds."""
    total, length_s = len(dataset.plan.jobs()), dataset.plan.recipe.seconds
    rate = rate_hz(dataset.plan.recipe.scanner)
    with progress() as bar:
        before = int((total - len(missing)) * length_s)
        task = bar.add_task(
            "generating", total=total * length_s, completed=before, before=before, unit=""
        )
        scans = count(1)

        def frame() -> None:
            """One more scan of an episode that is being made in this process."""
            interrupt.check()
            if next(scans) % 25 == 0:
                bar.advance(task, 25.0 / rate)

        alone = cluster is None and (jobs == 1 or len(missing) < 2)
        call = partial(_one, dataset.path, frame if alone else None)
        ways: dict[str, Any] = {"jobs": jobs, "cluster": cluster, "shared": dataset.path}
        for done, spent in enumerate(workers.each(call, missing, **ways), 1):
            interrupt.check()
            unit = f"{total - len(missing) + done}/{total} episodes"
            bar.update(task, completed=before + done * length_s, unit=unit)
            if cluster is None:
                learn([spent])


def _one(folder: Path, note_frame: Callable[[], None] | None, recipe: Recipe) -> tuple[Work, float]:
    """A job, here or in a worker: what it was, and s that it took."""
    started = time.perf_counter()
    record(recipe, folder, note=note_frame or (lambda: None))
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
    kinds = ("moving", "semi_static", "static")
    returns = [sum(int(result["returns"][kind]) for result in results) for kind in kinds]
    size = sum(file.stat().st_size for folder in folders for file in folder.iterdir())
    return [
        str(len(folders)),
        str(sum(int(result["frames"]) for result in results)),
        f"{sum(float(result['distance_m']) for result in results):.1f}",
        *(f"{100.0 * count / max(sum(returns), 1):.1f} %" for count in returns),
        f"{size / 1e6:.1f}",
    ]
