# SPDX-License-Identifier: Apache-2.0
"""A dataset as a whole: the episodes that are missing, on all processes, with a progress bar."""

import re
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count, product
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from scripts import interrupt, workers
from scripts.console import note, plain_table, progress
from scripts.formats import write_beside
from scripts.options import rate_hz
from scripts.pace import Work, learn
from scripts.pages.table import NONE
from sim.recording import MINARI
from sim.recording.dataset import MAX_BYTES, PLAN, Dataset, Plan, writing
from sim.recording.episode import record
from sim.recording.recipe import RECIPE, Recipe, read_recipe
from sim.recording.splits import part_of
from sim.recording.sums import write_sums
from slam.bounded import json_of
from slam.files import part_of as part_folder
from slam.files import put


def carry_out(plan: Plan, out: Path, *, jobs: int = 1, cluster: str | None = None) -> Table:
    """Make what is missing of the dataset in ``out``; a table of what it has then."""
    if plan.format == MINARI:
        return _offline(plan, out, {"jobs": jobs, "cluster": cluster})
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
        call = partial(_one, dataset.path, dataset.plan.format, frame if alone else None)
        ways: dict[str, Any] = {"jobs": jobs, "cluster": cluster, "shared": dataset.path}
        for done, spent in enumerate(workers.each(call, missing, **ways), 1):
            interrupt.check()
            unit = f"{total - len(missing) + done}/{total} episodes"
            bar.update(task, completed=before + done * length_s, unit=unit)
            if cluster is None:
                learn([spent])


def _one(
    folder: Path, form: str, note_frame: Callable[[], None] | None, recipe: Recipe
) -> tuple[Work, float]:
    """A job, here or in a worker: what it was, and s that it took."""
    started = time.perf_counter()
    beside = partial(write_beside, form) if form else (lambda episode: None)
    record(recipe, folder, note=note_frame or (lambda: None), beside=beside)
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


AT_ONCE = 64  # drives that are held until those before them are written


def rooms_of(plan: Plan) -> dict[str, list[Recipe]]:
    """By name, the datasets of Minari: one for each scene, dynamism and part."""
    rooms: dict[str, list[Recipe]] = {}
    for recipe in plan.jobs():
        part = part_of(plan.split, recipe.seed - plan.recipe.seed)
        words = [recipe.name.rpartition("-s")[0], *([part] if part else []), "v0"]
        rooms.setdefault(re.sub(r"[^-\w]", "_", "-".join(words)), []).append(recipe)
    return rooms


def _offline(plan: Plan, out: Path, ways: dict[str, Any]) -> Table:
    """The missing datasets of Minari, and a table of all."""
    from sim.gym.offline import write

    table = plain_table("Datasets of Minari", caption=f"MINARI_DATASETS_PATH={escape(str(out))}")
    for heading in ("dataset", "episodes", "steps", "of these"):
        table.add_column(heading, overflow="fold")
    with writing(out, plan) as dataset, progress() as bar:
        task = bar.add_task("driving", total=len(plan.jobs()), unit="")
        rooms = rooms_of(plan)
        for name, recipes in rooms.items():
            folder = dataset.path / name
            if not folder.exists():
                part = part_folder(folder)
                write(part, name, recipes[0], _drives(recipes, ways, partial(bar.advance, task)))
                write_sums(part)
                put(part, folder)
            told = json_of(folder / "data" / "metadata.json", MAX_BYTES, "metadata of Minari")
            keys = ("total_episodes", "total_steps", "description")
            table.add_row(name, *(escape(str(told.get(key, NONE))) for key in keys))
        dataset.vouch((PLAN,), rooms)
    return table


def _drives(
    recipes: list[Recipe], ways: dict[str, Any], advance: Callable[[], None]
) -> Iterator[Any]:
    """In the order of their seeds."""
    for k in range(0, len(recipes), AT_ONCE):
        drives = []
        for drive, spent in workers.each(_drive, recipes[k : k + AT_ONCE], **ways):
            interrupt.check()
            learn([spent])
            advance()
            drives.append(drive)
        yield from sorted(drives, key=lambda drive: int(drive.seed))


def _drive(recipe: Recipe) -> tuple[Any, tuple[Work, float]]:
    """An episode to learn from, here or in a worker; what it was, and s that it took."""
    from sim.gym.offline import driven

    started = time.perf_counter()
    drive = driven(recipe)
    work = Work(f"{MINARI} {recipe.scene}", recipe.seconds)
    return drive, (work, time.perf_counter() - started)
