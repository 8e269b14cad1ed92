# SPDX-License-Identifier: Apache-2.0
"""The table that ``mobilia generate`` ends with."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from sim.recording.dataset import Dataset
from sim.recording.recipe import RECIPE, read_recipe


def summary(dataset: Dataset, made: int, spent_s: float) -> Table:
    """Episodes, frames, distance, what returns came from, bytes: a row a scene and dynamism."""
    plan = dataset.plan
    scenes = plan.scenes or (plan.recipe.scene,)
    table = Table(
        title=escape(f"{', '.join(scenes)}: {made} of {len(plan.jobs())} made now"),
        title_justify="left",
        caption=f"{spent_s:.1f} s",
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),  # nine columns in 80 characters
        pad_edge=False,
    )
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
