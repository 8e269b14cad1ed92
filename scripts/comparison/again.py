# SPDX-License-Identifier: Apache-2.0
"""A run of a comparison as what would make it again: for films and counterfactuals."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from scripts.comparison.plan import Plan
from scripts.names import RUNS
from scripts.output import RECIPE, check_whole, read_recipe_words, scenes_of, slams_of
from sim.core.versions import check_world, world_of
from sim.recording.recipe import Recipe
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Again:
    """The simulation, of which every SLAM gets one scan in ``every``; its names are of a file."""

    recipe: Recipe
    every: int
    slams: tuple[str, ...]


def run_of(path: Path) -> Again:
    """Of such a file.

    Raises ``LogFormatError`` that says what is wrong with it or its comparison's recipe,
    ``WorldVersionError`` for one of another version of the world.
    """
    check_whole(path.parent.parent)
    recipe = path.parent.parent / RECIPE
    words = read_recipe_words(recipe)
    command, settings = words.get("command"), words.get("settings")
    if command == "drive":
        raise LogFormatError(path, why_no_run(path, command))
    if command != "compare" or not isinstance(settings, dict):
        raise LogFormatError(recipe, "no recipe of a comparison")
    check_world(recipe, world_of(recipe, words))
    try:
        settings |= {"slams": slams_of(recipe, settings), "scenes": scenes_of(recipe, settings)}
    except LogFormatError as error:
        why = f"no recipe of a comparison: {error.message}"
        raise LogFormatError(recipe, why) from error
    known = [field.name for field in fields(Plan)]
    try:
        told: dict[str, Any] = {k: v for k, v in settings.items() if k in known}
        told |= {k: tuple(v) for k, v in told.items() if isinstance(v, list)}
        plan = Plan(**told)
    except (TypeError, InvalidValueError, UnknownNameError) as error:
        raise LogFormatError(recipe, f"no recipe of a comparison: {error}") from error
    for run in plan.runs():
        if run.name == path.stem:
            return Again(recipe=plan.recipe(run), every=plan.every, slams=plan.slams)
    raise LogFormatError(path, f"no run of that comparison, whose first is {plan.runs()[0].name}")


def why_no_run(folder: Path, command: object) -> str:
    """Why the folder of many runs is no run, and what to name instead."""
    if command == "compare":
        one = min((folder / RUNS).glob("*.npz"), default=folder / RUNS / "*.npz")
        return f"a comparison of many runs: name one of them, as {one}"
    if command == "drive":
        return (
            "made by 'mobilia drive', where each SLAM's robot went its own way: simulate the room "
            "with 'mobilia run SLAM --scene ... --dynamism ... --seed ...' and name that run"
        )
    return f"made by 'mobilia {str(command)[:40]}', which leaves no run"
