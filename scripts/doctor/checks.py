# SPDX-License-Identifier: Apache-2.0
"""One finding for each thing that mobilia needs or can use. Nothing is installed or changed."""

import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal

import joblib
from packaging.requirements import Requirement

import mobilia
from sim.core.versions import WORLD
from slam.errors import MissingDependencyError

State = Literal["ok", "can do without", "missing"]
PACKAGE = "mobilia"
LEAST_PYTHON = (3, 11)  # pyproject.toml
LEAST_FREE_GB = 1.0  # in the working folder: a dataset of an hour, or the films of a night
EXTRAS = {  # what each is for; how to get them follows from their names
    "guests": "SLAMs of others to compare with",
    "yag": "YAG SLAM",
    "rl": "training policies (sim.gym.learning)",
    "data": "Parquet and Minari (export, generate)",
    "tune": "numbers of a SLAM searched",
    "ros2": "nodes of ROS 2 over DDS and Zenoh",
    "cluster": "--cluster",
}
PROGRAMS = {"icp-slam": "the SLAM icp-slam", "rbpf-slam": "the SLAM rbpf-slam"}


@dataclass(frozen=True, kw_only=True)
class Finding:
    """``what`` is there, or not.

    state  "ok"; "can do without": something named in ``found`` is left out; "missing": it must be
           there
    found  version, number or folder, or what is wrong
    how    to get it; "" where nothing is to be done
    """

    what: str
    state: State
    found: str
    how: str = ""


def _usable(
    what: str, there: object, found: str, how: str, lacking: State = "can do without"
) -> Finding:
    """``how`` to get it counts only where it is not ``there``."""
    return Finding(
        what=what, state="ok" if there else lacking, found=found, how="" if there else how
    )


def findings() -> list[Finding]:
    """All of them, in the order in which they are printed."""
    parts: tuple[Callable[[], Iterator[Finding]], ...] = (
        _installation, _packages, _drawing, _machine, _extras,
    )  # fmt: skip
    return [finding for part in parts for finding in part()]


def _installation() -> Iterator[Finding]:
    try:
        version = metadata.version(PACKAGE)
    except metadata.PackageNotFoundError:
        yield Finding(
            what=PACKAGE, state="missing", found="is not installed",
            how=f"pip install -e {mobilia.HOME}",
        )  # fmt: skip
    else:
        found = f"{version}, world {WORLD}, in {mobilia.HOME}"
        yield Finding(what=PACKAGE, state="ok", found=found)
    hidden = mobilia.hidden()
    if hidden:
        yield Finding(what="its packages", state="missing", found=hidden)
    new = sys.version_info >= LEAST_PYTHON
    how = f"Python {'.'.join(map(str, LEAST_PYTHON))} or newer"
    yield _usable("Python", new, f"{platform.python_version()}, {sys.executable}", how, "missing")


def required(extra: str | None = None) -> list[Requirement]:
    """What mobilia requires here, or what one of its extras adds; [] where it is not installed."""
    try:
        words = metadata.requires(PACKAGE) or []
    except metadata.PackageNotFoundError:
        return []
    found = []
    for one in map(Requirement, words):
        of_extra = one.marker is not None and "extra" in str(one.marker)
        applies = one.marker is None or one.marker.evaluate({"extra": extra or ""})
        if of_extra == (extra is not None) and applies:
            found.append(one)
    return found


def wrong_with(one: Requirement) -> str:
    """Why the requirement is not met, in words; "" where it is."""
    try:
        version = metadata.version(one.name)
    except metadata.PackageNotFoundError:
        return "is not installed"
    if not one.specifier.contains(version, prereleases=True):
        return f"is {version}, needed is {one.specifier}"
    return ""


def _packages() -> Iterator[Finding]:
    for one in required():
        wrong = wrong_with(one)
        found = wrong or metadata.version(one.name)
        how = f"pip install '{one.name}{one.specifier}'"
        yield _usable(one.name, not wrong, found, how, "missing")


def _drawing() -> Iterator[Finding]:
    from sim.view import gl

    found = gl.find()
    told = found.backend or f"films have no 3D panel: {found.reason}"
    how = "apt-get install libegl1 libgl1-mesa-dri (Debian, Ubuntu)"
    yield _usable("3D pictures (OpenGL)", found.backend, told, how)
    from scripts.film.encode import require_ffmpeg

    try:
        require_ffmpeg()
    except MissingDependencyError as error:
        yield Finding(what="films (ffmpeg)", state="can do without", found="runs need --no-film",
                      how=str(error))  # fmt: skip
    else:
        import imageio_ffmpeg

        told = f"{imageio_ffmpeg.get_ffmpeg_version()}, {imageio_ffmpeg.get_ffmpeg_exe()}"
        yield Finding(what="films (ffmpeg)", state="ok", found=told)


def _machine() -> Iterator[Finding]:
    cores = joblib.cpu_count()
    yield Finding(what="cores", state="ok", found=f"{cores} for this process: --jobs {cores}")
    folder = cache_folder()
    writable = folder is not None and os.access(_there(folder), os.W_OK)
    told = str(folder) if writable else "cannot be written: each start compiles for a minute"
    how = "set NUMBA_CACHE_DIR to a folder that you may write"
    yield _usable("cache of compiled loops", writable, told, how)
    free_gb = shutil.disk_usage(Path.cwd()).free / 1e9
    how = "outputs go to --out: name a folder on another disk"
    enough = free_gb >= LEAST_FREE_GB
    yield _usable("disk, working folder", enough, f"{free_gb:.1f} GB free", how)


def cache_folder() -> Path | None:
    """Where Numba keeps what it has compiled of a file; None where it cannot."""
    from slam.frontend.deskew import end_points

    path = getattr(getattr(end_points, "_cache", None), "cache_path", None)
    return None if path is None else Path(path)


def _there(folder: Path) -> Path:
    """The folder, or the nearest above it that exists."""
    return next(path for path in (folder, *folder.parents) if path.exists())


def _extras() -> Iterator[Finding]:
    known: list[str] = []
    with suppress(metadata.PackageNotFoundError):
        known = metadata.metadata(PACKAGE).get_all("Provides-Extra") or []
    for extra, used_for in EXTRAS.items():
        wanted = required(extra)
        lacking = [one.name for one in wanted if wrong_with(one)]
        if extra not in known:
            found, how = f"{used_for}: unknown to the installed {PACKAGE}", "install it again"
        elif not wanted:
            found, how = f"{used_for}: no wheels for this Python", "another Python (pyproject.toml)"
        elif lacking:
            found, how = f"{used_for}: {', '.join(lacking)}", f"pip install 'mobilia[{extra}]'"
        else:
            found, how = ", ".join(f"{o.name} {metadata.version(o.name)}" for o in wanted), ""
        yield _usable(f"[{extra}]", not how, found, how)
    for program, used_for in PROGRAMS.items():
        path = shutil.which(program)
        yield _usable(program, path, path or used_for, "apt-get install mrpt-apps (Debian, Ubuntu)")
