# SPDX-License-Identifier: Apache-2.0
"""Output folders that appear whole or not at all, and the recipe that says what made them."""

from __future__ import annotations

import json
import math
import os
import platform
import shutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import metadata
from pathlib import Path
from typing import Any

from sim.recording.sums import SUMS, check_vouched, write_sums
from sim.versions import WORLD
from slam import locks
from slam.errors import LogFormatError, OutputError
from slam.files import write_text
from slam.names import NameFromFile

RECIPE = "recipe.json"
# What comparisons and drives consist of: all else in their folders is somebody else's.
GROWING = ("*.npz", "*.npz.sha256", "*.csv", "*.png", "runs.json", RECIPE, "report.html")
MAX_RECIPE_BYTES = 1 << 20


@contextmanager
def whole_folder(path: Path, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary folder beside ``path``; it takes the name ``path`` when the block succeeds.

    Raises ``OutputError`` when ``path`` exists and ``overwrite`` is off, when it exists and holds
    no recipe of ours (then it is somebody else's and never replaced), or cannot be written. On any
    failure, Ctrl-C included, the temporary folder is removed and an earlier run stays as it was.
    """
    path = path.absolute()
    _refuse(path, overwrite)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    made = [parent for parent in path.parents if not parent.exists()]
    try:
        temporary.mkdir(parents=True)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
    try:
        yield temporary
        write_sums(temporary)
        _take_place(temporary, path)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        for parent in made:  # innermost first; one that holds something stays
            with suppress(OSError):
                parent.rmdir()


@contextmanager
def locked_folder(out: Path) -> Iterator[None]:
    """A folder of ours that grows, and nobody else's at the moment.

    Raises ``OutputError`` for one that holds files without a recipe, is being written now, or
    cannot be made.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write {out}: {error.strerror or error}") from error
    others = [file.name for file in out.iterdir() if file.name not in locks.NAMES]
    if others and not (out / RECIPE).exists():
        raise OutputError(f"{out} holds files that mobilia did not write: choose another --out")
    with locks.locked(out):
        (out / SUMS).unlink(missing_ok=True)  # what follows changes files: not whole until the end
        yield
        write_sums(out, GROWING)


def _refuse(path: Path, overwrite: bool) -> None:
    if not path.exists():
        return
    if not path.is_dir():
        raise OutputError(f"{path} is a file; --out needs a folder")
    if not any(path.iterdir()):
        return
    if not (path / RECIPE).exists():
        raise OutputError(f"{path} holds files that mobilia did not write: choose another --out")
    if not overwrite:
        raise OutputError(
            f"{path} holds an earlier run: pass --overwrite to replace it, or another --out"
        )


def _take_place(temporary: Path, path: Path) -> None:
    """Move the new folder in and the old one out; the old one comes back if that fails."""
    if not path.exists():
        temporary.rename(path)
        return
    aside = path.with_name(f".{path.name}.{os.getpid()}.old")
    path.rename(aside)
    try:
        temporary.rename(path)
    except OSError:
        aside.rename(path)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def versions() -> dict[str, str]:
    """Versions of everything that can change a number."""
    wanted = ("mobilia", "mujoco", "gymnasium", "numpy", "scipy", "numba", "opencv-python-headless")
    found = {}
    for name in wanted:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return {"python": platform.python_version(), **found}


def machine() -> dict[str, Any]:
    """The machine a figure was measured on."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": sys.version.split()[0],
    }


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def write_recipe(folder: Path, command: str, settings: Mapping[str, Any]) -> None:
    """``recipe.json``: the command, its settings, the versions, that of the world too."""
    recipe = {"schema": 1, "command": command, "settings": _plain(settings), "versions": versions()}
    recipe["world"] = WORLD
    text = json.dumps(recipe, indent=2, sort_keys=True, allow_nan=False)
    write_text(folder / RECIPE, text + "\n")


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
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_RECIPE_BYTES + 1)
        if len(raw) > MAX_RECIPE_BYTES:
            raise LogFormatError(path, f"more than {MAX_RECIPE_BYTES} bytes: no recipe")
        check_vouched(path)
        words = json.loads(raw.decode("utf-8"))
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise LogFormatError(path, f"no recipe: {error}") from error
    if not isinstance(words, dict):
        raise LogFormatError(path, "no recipe: not a JSON object")
    return words


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
