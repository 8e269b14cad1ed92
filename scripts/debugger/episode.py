# SPDX-License-Identifier: Apache-2.0
"""Which run is looked at: from its folder, or from what would make it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.comparison.again import run_of, why_no_run
from scripts.comparison.run_file import RunFile
from scripts.names import file_name, is_run
from scripts.options import admitted, whole
from scripts.output import RECIPE, read_recipe_words, scenes_of, slams_of
from sim.core.versions import check_world, world_of
from sim.recording.recipe import Made, read_recipe
from sim.recording.sums import check_vouched
from slam.errors import InvalidValueError, LogFormatError
from slam.frames import Float
from slam.trajectory import read_tum

COMMANDS = ("run", "demo")
NO_OPTIONS = (
    "scene", "seed", "dynamism", "motion", "change", "crowd", "laser", "labels", "tags",
)  # fmt: skip
OF_THE_RUN = ("slams", "seconds", "simulation")  # in the recipe of a run; the rest is the world's


@dataclass(frozen=True, kw_only=True)
class Case:
    """A simulated tour and the SLAM on it.

    settings  arguments of ``Simulation``
    seconds   of the tour
    slam      name or ``module:Class``
    every     the SLAM gets one scan in so many
    title     for people
    recorded  (n, 3) what it believed then, if that is on file
    made      who recorded it, if that is known
    """

    settings: Mapping[str, Any]
    seconds: float
    slam: str = "shunting"
    every: int = 1
    recorded: Float | None = field(default=None, repr=False)
    made: Made | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        whole("--every", self.every, 1)

    @property
    def title(self) -> str:
        """The world in a line."""
        options = {k: v for k, v in self.settings.items() if isinstance(v, str | int | float)}
        scene = options.pop("scene", "?")
        options.pop("scene_sha256", None)
        return " · ".join([str(scene), *(f"{k} {v}" for k, v in sorted(options.items()))])


def case_of(folder: Path, slam: str | None, every: int, trust: bool = False) -> Case:
    """The case of a folder of ``mobilia run`` or ``demo``, of an episode of a dataset, or of a run
    of a comparison.

    trust  whether code that a file there names, as scene or SLAM, is run

    Raises ``LogFormatError`` that names the file for what cannot be simulated again,
    ``UntrustedNameError`` without ``trust``, ``WorldVersionError`` for a run of another version of
    the world.
    """
    if not folder.exists():
        raise LogFormatError(folder, "no such folder")
    if is_run(folder):
        return _compared(folder, slam, every, trust)
    path = folder / RECIPE if folder.is_dir() else folder
    words = read_recipe_words(path)
    if "recipe" in words:
        return _episode(path, slam or "shunting", every, trust)
    command, settings = words.get("command"), words.get("settings")
    if command not in COMMANDS:
        raise LogFormatError(path.parent, why_no_run(path.parent, command))
    if not isinstance(settings, dict):
        raise LogFormatError(path, "no recipe of a run: it has no settings")
    if "scene" not in settings:
        raise LogFormatError(path, "this run was on a log: only a simulated one can be run again")
    _check_settings(path, settings)
    check_world(path, world_of(path, words))
    slams = slams_of(path, settings)
    if slam is None:
        slam = next((s for s in slams if s != "odometry"), "odometry") if slams else "shunting"
    seconds = settings.get("seconds")
    if isinstance(seconds, bool) or not isinstance(seconds, int | float):
        raise LogFormatError(path, f"settings.seconds must be a number, got {seconds!r}")
    world = {k: v for k, v in settings.items() if k not in OF_THE_RUN}
    world["scene"] = admitted(scenes_of(path, settings)[0], "scene", trust)
    slam = admitted(slam, "SLAM", trust)
    online = path.parent / f"trajectory_{file_name(slam)}.tum"
    check_vouched(online)
    recorded = read_tum(online).poses if every == 1 and online.exists() else None
    return Case(settings=world, seconds=seconds, slam=slam, every=every, recorded=recorded)


def _check_settings(path: Path, settings: Mapping[str, Any]) -> None:
    unknown = sorted({"drive", "name", "start"}.intersection(settings))
    if unknown:
        raise LogFormatError(path, f"no recipe of a run: settings.{unknown[0]} is none of them")
    if not isinstance(settings.get("laser", ""), str):
        raise LogFormatError(path, "no recipe of a run: settings.laser must be a scanner's name")


def _compared(path: Path, slam: str | None, every: int, trust: bool) -> Case:
    again = run_of(path)
    if every not in (1, again.every):
        raise InvalidValueError(f"--every: in this comparison SLAMs got one scan in {again.every}")
    slam = slam or next((name for name in again.slams if name != "odometry"), "odometry")
    settings = {k: v for k, v in again.recipe.simulation().items() if k != "labels"}
    settings["scene"] = admitted(again.recipe.scene, "scene", trust)
    slam = admitted(slam, "SLAM", trust)
    recorded = RunFile(path).believed(slam).poses if slam in again.slams else None
    return Case(
        settings=settings, seconds=again.recipe.seconds, slam=slam, every=again.every,
        recorded=recorded,
    )  # fmt: skip


def _episode(path: Path, slam: str, every: int, trust: bool) -> Case:
    made = read_recipe(path)
    check_world(path, made.world)
    recipe = made.recipe
    if recipe.twin:
        raise LogFormatError(
            path, f"a {recipe.twin} twin cannot be changed: take an episode made without --twins"
        )
    settings = {k: v for k, v in recipe.simulation().items() if k != "labels"}
    settings["scene"] = admitted(recipe.scene, "scene", trust)
    return Case(settings=settings, seconds=recipe.seconds, slam=slam, every=every, made=made)


def options_of(words: list[str]) -> dict[str, Any]:
    """``["walls=none", "n_chairs=6"]`` as arguments; ``InvalidValueError`` for anything else."""
    found: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not (name.isidentifier() and equals and value):
            raise InvalidValueError(f"--option must be NAME=VALUE, got {word!r}")
        if name in NO_OPTIONS:
            raise InvalidValueError(f"--option {name}: that has an option of its own or none")
        try:
            found[name] = json.loads(value)
        except ValueError:
            found[name] = value
    return found
