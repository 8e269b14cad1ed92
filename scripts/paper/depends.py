# SPDX-License-Identifier: Apache-2.0
"""What a run depends on beside its arguments: code, descriptions of the rooms, data."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import scenes
import sim
import slam
from scripts.imports import with_imports

_SCRIPTS = Path(__file__).parents[1]
# Of what the runs' modules import: these make pages of runs, and no run depends on them.
_PAGES = frozenset({
    "comparison", "console", "depends", "figures", "imports", "interrupt", "jobs", "machine",
    "output", "paper_numbers", "report", "times", "workers",
})  # fmt: skip
_PARK = frozenset({
    "features_trees", "features_segments", "aa3_gpsx", "rfs_measurements", "rfs_inputs", "rfs_gps",
    "graph_known_association",
})  # fmt: skip


def depends_on(call: Callable[..., None], arguments: Mapping[str, Any]) -> tuple[Path, ...]:
    """Files and folders: the SLAMs, the module of ``call`` with the scripts that it imports; with
    a ``scene`` the simulator and the rooms; with ``data`` the files of the dataset."""
    packages = (slam, sim, scenes) if "scene" in arguments else (slam,)
    folders = [Path(str(package.__file__)).parent for package in packages]
    data = park_files(Path(arguments["data"])) if "data" in arguments else []
    return (*folders, *_own(Path(inspect.getfile(call)), call.__module__), *data)


@cache
def _own(file: Path, module: str) -> tuple[Path, ...]:
    imported = (path for path in with_imports(file, module) if _SCRIPTS in path.parents)
    return tuple(sorted({file.resolve(), *(p for p in imported if p.stem not in _PAGES)}))


def park_files(folder: Path) -> list[Path]:
    """Those files of the folder that are of the Victoria Park dataset, sorted."""
    return sorted(path for path in folder.iterdir() if path.name.partition(".")[0] in _PARK)


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of each of ``park_files``."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in park_files(folder)}
