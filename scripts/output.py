# SPDX-License-Identifier: Apache-2.0
"""Output folders that grow, and the recipe that says what made a folder."""

import json
import math
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from scripts.machine import versions
from sim.core.versions import WORLD
from sim.recording.sums import check_vouched, tree, write_sums
from slam import files, inputs, locks
from slam.bounded import json_of
from slam.errors import LogFormatError, OutputError
from slam.names import NameFromFile
from slam.system import config_of

RECIPE = "recipe.json"
# What comparisons, drives and benchmarks consist of: all else in their folders is somebody else's.
GROWING = (
    "*.npz", "*.npz.sha256", "*.csv", "*.png", "*.svg", RECIPE, "report.html", "index.html",
    "leaderboard.json", "leaderboard.md", "submission_*.json", "days.json",
    "summary.md", "junit.xml", "tune.json", "spent.json",
    "*lives/*.json", "*lives/*.json.sha256", "runs.json",  # of folders begun before 0.3.0
)  # fmt: skip
FOREIGN = "{} holds files that mobilia did not write: choose another --out"
STAGED, READY = ".tables.part", ".tables.ready"  # of ``together``, before and after it counts
MAX_RECIPE_BYTES = 1 << 20


@contextmanager
def told(said: Path, temporary: Path | None = None) -> Iterator[None]:
    """Errors of the system as ``OutputError``, which names what the user named."""
    try:
        yield
    except OutputError as error:
        if temporary is None or str(temporary) not in str(error):
            raise
        raise OutputError(str(error).replace(str(temporary), str(said))) from error
    except OSError as error:
        where = said if said.is_dir() else said.absolute().parent
        raise OutputError(f"cannot write {said}: {files.reason(error, where)}") from error


@contextmanager
def locked_folder(out: Path, command: str) -> Iterator[None]:
    """A folder of ours that grows by ``command``, and nobody else's at the moment.

    Raises ``OutputError`` for one that holds files without a recipe of that, is being written now,
    holds links, or cannot be written.
    """
    made: list[Path] = []
    try:
        with told(out):
            refuse_others(out, command)
            made = files.make_folder(out)
            with locks.locked(out):
                yield
    finally:
        files.remove_empty(made)


def refuse_others(out: Path, command: str) -> None:
    """``OutputError`` for a folder that holds files without a recipe of ``command``."""
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out} is a file; --out needs a folder")
    names = (f.name for f in out.iterdir()) if out.is_dir() else ()
    if any(name not in locks.NAMES and not files.is_part(name) for name in names):
        words = words_of_ours(out)
        if words["command"] != command:
            raise OutputError(another(out, words))


@contextmanager
def together(folder: Path) -> Iterator[Path]:
    """Yield a folder to write files into; when the block succeeds they all take their places in
    ``folder``, or none of them does.

    They are written and synced first, which is where a full disk strikes. Then the folder is
    renamed: from that moment on they count. A process that ends before the last of them is in its
    place leaves that folder, ``check_whole`` refuses to read, and the next ``together`` or
    ``put_tables`` moves the rest.
    """
    put_tables(folder)
    staged = folder / STAGED
    try:
        with told(folder, staged):
            files.remove(staged)
            staged.mkdir()
            yield staged
            write_sums(staged, GROWING, over=folder)
            inputs.refuse(*(folder / name for name in tree(staged)[0]))
            files.put(staged, folder / READY)
    finally:
        files.remove(staged)
    put_tables(folder)


@contextmanager
def result_folder(
    out: Path, command: str, settings: Mapping[str, Any]
) -> Iterator[Callable[[], AbstractContextManager[Path]]]:
    """``locked_folder`` with its recipe there from the start; yields what its tables are written
    in: ``together``, which ends with the recipe.
    """
    with locked_folder(out, command):
        if not (out / RECIPE).exists():  # else that of the tables there stays with them
            write_recipe(out, command, settings)

        @contextmanager
        def tables() -> Iterator[Path]:
            with together(out) as staged:
                yield staged
                write_recipe(staged, command, settings)

        yield tables


def put_tables(folder: Path) -> None:
    """Move what ``together`` had ready when it was stopped; ``OutputError`` when that cannot be."""
    ready = folder / READY
    if not ready.is_dir():
        return
    with told(folder):
        places = {folder}
        for file in sorted(file for file in ready.rglob("*") if file.is_file()):
            place = folder / file.relative_to(ready)
            files.make_folder(place.parent)
            os.replace(file, place)
            places.add(place.parent)
        for changed in sorted(places):
            files.sync(changed)
        shutil.rmtree(ready)
        files.sync(folder)


def check_whole(folder: Path) -> None:
    """``LogFormatError`` for a folder whose files were stopped on the way to their places."""
    if (folder / READY).is_dir():
        raise LogFormatError(
            folder, "unfinished, its tables are not all in place: the same command again goes on"
        )


def words_of_ours(folder: Path) -> dict[str, Any]:
    """Of the recipe of an earlier result; ``OutputError`` for a folder of somebody else.

    Hashes are left alone: those of a folder whose tables were stopped on the way do not fit yet.
    """
    if not os.path.lexists(folder / RECIPE):
        raise OutputError(FOREIGN.format(folder))
    try:
        words = json_of(folder / RECIPE, MAX_RECIPE_BYTES, "recipe", strict=False)
    except LogFormatError as error:
        raise OutputError(
            f"{folder} holds an earlier result, whose recipe cannot be read: choose another --out "
            f"({error})"
        ) from error
    if not isinstance(words.get("command"), str) or not isinstance(words.get("settings"), dict):
        raise OutputError(FOREIGN.format(folder))
    return words


def another(folder: Path, words: Mapping[str, Any]) -> str:
    """That the folder is of another command, as its recipe says."""
    return f"{folder} holds what mobilia {words['command']:.40} wrote: choose another --out"


def write_recipe(folder: Path, command: str, settings: Mapping[str, Any]) -> None:
    """``recipe.json``: the command, its settings, the versions, that of the world too.

    Beside them the numbers of the SLAMs that ``slams`` or ``slam`` of the settings name.
    """
    recipe = {"schema": 1, "command": command, "settings": plain(settings), "versions": versions()}
    recipe["world"] = WORLD
    named = settings.get("slams", [settings["slam"]] if "slam" in settings else [])
    if configs := configs_of(named):
        recipe["configs"] = configs
    text = json.dumps(recipe, indent=2, sort_keys=True, allow_nan=False)
    files.write_text(folder / RECIPE, text + "\n")


def configs_of(slams: Iterable[str]) -> dict[str, Any]:
    """By SLAM: SHA-256 of its config, and by path the numbers that are not the default."""
    found = {}
    for name in slams:
        configs = config_of(name)
        if configs is not None:
            config, default = configs
            found[name] = {"sha256": config.sha256(), "changed": config.differences(default)}
    return found


def plain(value: Any) -> Any:
    """``value`` as strict JSON has it: no infinities (a stay that never ends is "inf")."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def read_recipe_words(path: Path) -> dict[str, Any]:
    """The object in a ``recipe.json`` of whatever command; ``LogFormatError`` for anything else."""
    check_vouched(path)
    return json_of(path, MAX_RECIPE_BYTES, "recipe", strict=False)


def slams_of(path: Path, settings: Mapping[str, Any]) -> list[str]:
    """The SLAMs that the settings of a recipe name; ``LogFormatError`` for what are no names."""
    return _names(path, settings, "slams")


def scenes_of(path: Path, settings: Mapping[str, Any]) -> list[str]:
    """The same of scenes: ``scenes``, or the one that is called ``scene``."""
    if "scenes" in settings:
        return _names(path, settings, "scenes")
    scene = settings.get("scene")
    if not isinstance(scene, str):
        raise LogFormatError(path, f"settings.scene must be a name, got {scene!r:.80}")
    return [NameFromFile(scene, path)]


def _names(path: Path, settings: Mapping[str, Any], key: str) -> list[str]:
    names = settings.get(key, [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise LogFormatError(path, f"settings.{key} must be a list of names, got {names!r:.80}")
    return [NameFromFile(name, path) for name in names]
