# SPDX-License-Identifier: Apache-2.0
"""The commands whose power is cut: a small one of each that leaves something."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from scripts.comparison import make
from scripts.comparison.plan import Plan
from scripts.robustness.power_cuts import Case
from scripts.single_run.live import on_scene
from scripts.single_run.session import Outputs
from scripts.verbs.generate import generate
from slam.maps import write_map
from slam.shunting import ShuntingSlam
from slam.system import Raster


def each_alone(names: Iterable[str]) -> dict[str, set[str]]:
    """Every file for itself."""
    return {name: {name} for name in names}


def all_together(names: Iterable[str]) -> dict[str, set[str]]:
    """One thing."""
    return {"all": set(names)}


def by_episode(names: Iterable[str]) -> dict[str, set[str]]:
    """A folder of the dataset is a thing; what lies beside it is one each."""
    things: dict[str, set[str]] = {}
    for name in names:
        things.setdefault("/".join(name.split("/")[:2]), set()).add(name)
    return things


def by_table(names: Iterable[str]) -> dict[str, set[str]]:
    """All tables of a comparison are a thing; its jobs' results and its recipe are one each."""
    things: dict[str, set[str]] = {"tables": set()}
    for name in names:
        alone = {"recordings", "entries", "recipe.json"} & set(name.split("/"))
        things.setdefault(name if alone else "tables", set()).add(name)
    return things


def _generated(root: Path) -> None:
    generate(["arena"], root / "data", episodes=2, seconds=1.0, scanner="ideal")


def _compared(*slams: str) -> Callable[[Path], object]:
    def call(root: Path) -> None:
        plan = Plan(
            slams=slams,
            scenes=("arena",),
            levels=(1.0,),
            seeds=(100,),
            seconds=2.0,
            scanner="noise",
        )
        make.carry_out(plan, root / "compared")

    return call


def _run(seconds: float, *, film: bool = False) -> Callable[[Path], object]:
    def call(root: Path) -> None:
        settings = {"scene": "arena", "seconds": seconds, "dynamism": 1.0, "seed": 1}
        outputs = Outputs(folder=root / "run", command="run", overwrite=True, film=film)
        on_scene(["shunting"], settings, outputs)

    return call


def _map(size: int) -> Callable[[Path], object]:
    values = np.full((size, size), 0.5, dtype=np.float32)
    raster = Raster(values=values, resolution_m=0.05 * size, T_map_origin=np.zeros(3))
    return lambda root: write_map(root / "maps" / "map", raster)


def _memory(root: Path) -> None:
    ShuntingSlam().save(root / "maps" / "map.npz")


def cases(*, film: bool = True) -> list[Case]:
    """Small ones of every command that leaves something."""
    run, maps = _run(1.0, film=film), _map(3)
    tables = _compared("odometry", "occupancy")
    return [
        Case(name="generate", call=_generated, things=by_episode, exact=True),
        Case(name="compare", call=tables, things=by_table),
        Case(
            name="compare, a SLAM more", call=tables, things=by_table, first=_compared("odometry")
        ),
        Case(name="run", call=run, things=all_together),
        Case(name="run --overwrite", call=run, things=all_together, first=_run(0.5)),
        Case(
            name="run --overwrite, names cannot be swapped", call=run, things=all_together,
            first=_run(0.5), exchange=False,
        ),
        Case(
            name="map, pgm and yaml", call=maps, things=all_together, opened=".yaml", exact=True
        ),
        Case(
            name="map, pgm and yaml, again", call=maps, things=all_together, first=_map(2),
            opened=".yaml", exact=True,
        ),
        Case(name="map, npz", call=_memory, things=each_alone, exact=True),
    ]  # fmt: skip
