# SPDX-License-Identifier: Apache-2.0
"""Output folders that appear whole or not at all, and the recipe that says what made them."""

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
from sim.recording.sums import check_vouched, write_sums
from slam import files, locks
from slam.bounded import json_of
from slam.errors import LogFormatError, OutputError
from slam.names import NameFromFile
from slam.system import config_of

RECIPE = "recipe.json"
# What comparisons, drives and benchmarks consist of: all else in their folders is somebody else's.
GROWING = (
    "*.npz", "*.npz.sha256", "*.csv", "*.png", "runs.json", RECIPE, "report.html", "index.html",
    "leaderboard.json", "leaderboard.md", "submission_*.json", "days.json",
    "*lives/*.json", "*lives/*.json.sha256",
)  # fmt: skip
OLD = ".old"  # of the earlier run, while a new one takes its place
FOREIGN = "{} holds files that mobilia did not write: choose another --out"
STAGED, READY = ".tables.part", ".tables.ready"  # of ``together``, before and after it counts
MAX_RECIPE_BYTES = 1 << 20


@contextmanager
def whole_folder(
    path: Path, *, overwrite: bool, command: str = "", settings: Mapping[str, Any] | None = None
) -> Iterator[Path]:
    """Yield a temporary folder beside ``path``; it takes the name ``path`` when the block succeeds.

    command, settings  as ``write_recipe`` gets them: only for a folder whose recipe has the same
                       does the error name --overwrite as a way out

    Raises ``OutputError`` when ``path`` exists and ``overwrite`` is off, when it exists and holds
    no recipe of ours (then it is somebody else's and never replaced), or cannot be written. On any
    failure, Ctrl-C included, the temporary folder is removed and an earlier run stays as it was.
    What killed runs left is removed first. After a power cut the new or the earlier run is there
    (where the file system cannot swap two names, the earlier one perhaps as .NAME.PID.old).
    """
    said, path = path, path.absolute()
    temporary = path.with_name(f".{path.name}.{os.getpid()}{files.PART}")
    made: list[Path] = []
    try:
        with _told(said, temporary):
            made = files.make_folder(path.parent)
            _refuse(path, overwrite, command, settings or {})
            files.clear_parts(path)
            temporary.mkdir()
            with files.locked(temporary):
                yield temporary
                write_sums(temporary)
                _take_place(temporary, path)
    finally:
        files.remove(temporary)
        files.remove_empty(made)


@contextmanager
def _told(said: Path, temporary: Path | None = None) -> Iterator[None]:
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
def locked_folder(out: Path) -> Iterator[None]:
    """A folder of ours that grows, and nobody else's at the moment.

    Raises ``OutputError`` for one that holds files without a recipe, is being written now, or
    cannot be written.
    """
    made: list[Path] = []
    try:
        with _told(out):
            made = files.make_folder(out)
            ours = (out / RECIPE).exists()
            names = (f.name for f in out.iterdir())
            if not ours and any(n not in locks.NAMES and not files.is_part(n) for n in names):
                raise OutputError(FOREIGN.format(out))
            with locks.locked(out):
                yield
    finally:
        files.remove_empty(made)


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
        with _told(folder, staged):
            files.remove(staged)
            staged.mkdir()
            yield staged
            write_sums(staged, GROWING, over=folder)
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
    with locked_folder(out):
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
    with _told(folder):
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


def _refuse(path: Path, overwrite: bool, command: str, settings: Mapping[str, Any]) -> None:
    if not path.exists():
        return
    if not path.is_dir():
        raise OutputError(f"{path} is a file; --out needs a folder")
    if not any(path.iterdir()):
        return
    if not (path / RECIPE).exists():
        raise OutputError(FOREIGN.format(path))
    if not overwrite:
        raise OutputError(_what_lies_there(path, command, settings))


def _what_lies_there(path: Path, command: str, settings: Mapping[str, Any]) -> str:
    """What the folder of ours at ``path`` holds, and what to do about it."""
    another = "choose another --out"
    try:
        words = read_recipe_words(path / RECIPE)
    except LogFormatError:
        return f"{path} holds an earlier result, whose recipe cannot be read: {another}"
    if words.get("command") != command:
        return f"{path} holds what mobilia {words.get('command')!s:.40} wrote: {another}"
    theirs, ours = words.get("settings"), json.loads(json.dumps(_plain(settings)))
    if theirs == ours:
        return (
            f"{path} holds an earlier run of the same settings: pass --overwrite to replace it, "
            "or another --out"
        )
    there: Mapping[str, Any] = theirs if isinstance(theirs, dict) else {}
    keys = sorted(key for key in {*there, *ours} if there.get(key) != ours.get(key))
    differ = ", ".join(f"{key} {there.get(key)!r:.40} there, {ours.get(key)!r:.40} now"
                       for key in keys[:3])  # fmt: skip
    return f"{path} holds another run ({differ}): {another}"


def _take_place(temporary: Path, path: Path) -> None:
    """Move the new folder in and the old one out, at once where the system can do that."""
    if not path.exists():
        files.put(temporary, path)
        return
    files.sync_tree(temporary)
    if files.exchange(temporary, path):
        files.sync_names(path.parent)  # the old one has the temporary name, which is removed
        return
    aside = path.with_name(f".{path.name}.{os.getpid()}{OLD}")
    path.rename(aside)
    try:
        temporary.rename(path)
    except OSError:
        aside.rename(path)
        raise
    files.sync_names(path.parent)
    files.remove(aside)


def write_recipe(folder: Path, command: str, settings: Mapping[str, Any]) -> None:
    """``recipe.json``: the command, its settings, the versions, that of the world too.

    Beside them the numbers of the SLAMs that ``slams`` or ``slam`` of the settings name.
    """
    recipe = {"schema": 1, "command": command, "settings": _plain(settings), "versions": versions()}
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


def _plain(value: Any) -> Any:
    """``value`` as strict JSON has it: no infinities (a stay that never ends is "inf")."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
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
