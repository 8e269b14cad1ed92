# SPDX-License-Identifier: Apache-2.0
"""Is what a verb left still what it left: a dataset, an episode, a run, a comparison, a map."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from scripts.benchmark import submission
from scripts.comparison import folder as compared
from scripts.comparison import schema
from scripts.comparison.run_file import RunFile
from scripts.names import file_name, is_run
from scripts.output import MAX_RECIPE_BYTES, RECIPE, read_recipe_words, slams_of
from sim.recording.dataset import PLAN, check_dataset
from sim.recording.sums import SUMS, Fault, check_vouched, faults
from sim.recording.verify import METADATA, Finding, check_hashes, finding, listed_in
from slam.bounded import json_of
from slam.errors import LogFormatError, MissingPathError
from slam.maps import has_sums, read_map
from slam.tracker import map_file as memory

_TABLES = ("runs.csv", "levels.csv")
# What a verb always leaves, by the command in the recipe: a lost line is no way out.
_ALWAYS = {
    "run": ("results.json", "trajectories.png", "trajectory_odometry.tum"),
    "demo": ("results.json", "trajectories.png", "trajectory_odometry.tum"),
    "compare": (*_TABLES, "paired.csv"),
    "drive": (*_TABLES, "goals.csv", "closed_loop.png", "paths.png"),
    "blame": ("blame.json", "blame.png"),
    "tune": ("trials.csv", "trials.png", "tune.json"),
    "shrink": ("shrink.json", "errors.png"),
    "days": ("days.csv", "days.json"),
    "benchmark": ("leaderboard.json", "leaderboard.csv", "leaderboard.md"),
}


def check(path: Path) -> list[Finding]:
    """One finding for each result at ``path``: for a dataset itself and for each of its episodes.

    Raises ``MissingPathError`` when nothing is there, ``LogFormatError`` when nothing that a verb
    of ours leaves.
    """
    try:
        if not path.exists():
            raise MissingPathError(path, "no such file or folder")
        if not path.is_dir():
            return [_check_file(path)]
        way = _way(path)
        if way is None:
            raise LogFormatError(path, "holds no dataset, episode, run, comparison or map")
        return way(path)
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error


def _way(folder: Path) -> Callable[[Path], list[Finding]] | None:
    """How the folder is checked, by what is left of it."""
    listed, _ = listed_in(folder)
    names = {*os.listdir(folder), *listed}
    if PLAN in names:
        return check_dataset
    if METADATA in names or any(name.endswith(".mcap") for name in names):
        return lambda path: [check_hashes(path.resolve())]
    if RECIPE in names or SUMS in names:
        return _check_result
    if any(True for _ in folder.glob(f"*/{METADATA}")):
        return check_dataset
    return None


def _check_result(folder: Path) -> list[Finding]:
    """A folder of a verb that is no dataset, and those within it."""
    listed, found = listed_in(folder)
    if listed:
        found = faults(folder, listed)
        known = {fault.name for fault in found}
        for name in _wanted(folder):
            if name not in listed and name not in known:
                why = f"{folder / SUMS} does not list {name}"
                found.append(Fault(kind="damaged", name=name, why=why))
        found = found or _unreadable(folder)
    inner = [path.parent for path in sorted(folder.glob(f"*/{SUMS}"))]
    inner = [path for path in inner if not path.is_symlink()]  # foreign, and may lead back here
    return [finding(folder.resolve().name, found), *(f for one in inner for f in check(one))]


def _unreadable(folder: Path) -> list[Fault]:
    """What the readers of a folder say of files whose hashes are right."""
    try:
        recipe = read_recipe_words(folder / RECIPE)
        command, settings = recipe.get("command"), recipe.get("settings")
        schemas = {*settings} if isinstance(settings, dict) else set()
        if command == "compare" or "compare_schema" in schemas:
            compared.read(folder, vouched=True).check()
    except LogFormatError as error:
        return [Fault(kind="damaged", name=error.path.name, why=str(error))]
    return []


def _wanted(folder: Path) -> list[str]:
    """What must be in it, as far as its recipe and its table can be read."""
    names = [RECIPE]
    with suppress(LogFormatError):  # damaged, which its hash says
        recipe = json_of(folder / RECIPE, MAX_RECIPE_BYTES, "recipe", strict=False)
        command, settings = str(recipe.get("command")), recipe.get("settings")
        names += _ALWAYS.get(command, ())
        if command in ("run", "demo") and isinstance(settings, dict):
            slams = slams_of(folder / RECIPE, settings)
            names += [f"trajectory_{file_name(slam)}.tum" for slam in slams]
        if command == "compare":
            made = compared.read(folder)
            names += [f"runs/{name}.npz" for name in made.names()]
            if made.settings.get("sessions") is not None:
                names += [schema.AGES, schema.AGES_LEVELS]
    return sorted(names)


def _check_file(path: Path) -> Finding:
    """A map, a run of a comparison, or a submission to the benchmark."""
    try:
        if path.suffix in (".yaml", ".pgm"):
            return _check_map(path.with_suffix(".yaml"))
        if is_run(path):
            RunFile(path)
        elif path.suffix == ".json":
            submission.read(path)
        elif path.suffix == ".npz":
            check_vouched(path)
            memory.check(path)
        else:
            raise LogFormatError(path, "no dataset, episode, run, comparison, submission or map")
    except LogFormatError as error:
        return finding(path.name, [Fault(kind="damaged", name=path.name, why=str(error))])
    return finding(path.name, [])


def _check_map(yaml: Path) -> Finding:
    """A map of two files, which its own sums vouch for, or a SHA256SUMS beside them."""
    read_map(yaml)
    if has_sums(yaml) and not (yaml.parent / SUMS).exists():
        return finding(yaml.name, [])
    listed, found = listed_in(yaml.parent)
    for path in (yaml, yaml.with_suffix(".pgm")):
        check_vouched(path)
        if listed and path.name not in listed:
            why = f"{yaml.parent / SUMS} does not list {path.name}: nothing vouches for it"
            found.append(Fault(kind="incomplete", name=path.name, why=why))
    return finding(yaml.name, found)
