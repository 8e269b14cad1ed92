# SPDX-License-Identifier: Apache-2.0
"""Jobs that can be killed at any time: each writes one file, which is there whole or not at all.

A job is a function called as ``call(path, **arguments)`` that writes ``path``. It gets a temporary
name, which becomes ``<name>-<digest><suffix>`` when the function returns. The digest is that of the
arguments, of the code that they are given to, of the data that it reads and of the versions of what
it calls, so what is found there is what would be written, and is not made again. The hash of its
content lies beside it, as ``<file>.sha256``: one that was damaged since is made again.
"""

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from rich.markup import escape

from scenes import registry
from scripts import interrupt, workers
from scripts.console import note, progress
from scripts.machine import versions
from scripts.pace import Work, learn
from sim.recording.sums import damage_beside, write_beside
from slam import locks, system
from slam.errors import InvalidValueError, MobiliaError, OutputError, SlamFailedError
from slam.files import PART, is_full, is_part, make_folder, put, reason, remove
from slam.guests import Limits, limited
from slam.variants import parsed


@dataclass(frozen=True, kw_only=True)
class Job:
    """One file to be made.

    name       what it is called, before the digest: letters, digits, - _ .
    call       a function of a module (workers import it): ``call(path, **arguments)``
    arguments  as JSON has them
    suffix     ending of the file
    seconds    of simulated time that it works on, for ``scripts.pace``; no part of its name
    code       folders or files that the result depends on, data too: the digest of all that is in
               them, but for what is hidden or compiled, is part of the name
    """

    name: str
    call: Callable[..., None]
    arguments: Mapping[str, Any]
    suffix: str = ".npz"
    seconds: float = 1.0
    code: Sequence[Path] = ()

    def __post_init__(self) -> None:
        if not self.name or not all(c.isalnum() or c in "-_." for c in self.name):
            raise InvalidValueError(
                f"Job.name must be letters, digits, '-', '_' and '.', got {self.name!r}"
            )

    def over(self, what: str, arguments: Mapping[str, Any]) -> "Job":
        """The same on what is called so, and these arguments besides."""
        return replace(self, name=f"{what}_{self.name}", arguments={**self.arguments, **arguments})

    def work(self) -> Work:
        """Its kind: the function, and of which SLAM or scene."""
        slam = self.arguments.get("slam")
        of = parsed(slam)[0] if slam else self.arguments.get("scene") or ""
        return Work(f"{self.call.__module__}.{self.call.__qualname__} {of}", self.seconds)

    def file_name(self) -> str:
        """Where its result goes, within the folder of the jobs."""
        call = f"{self.call.__module__}.{self.call.__qualname__}"
        told = json.dumps([call, dict(self.arguments), _versions()], sort_keys=True)
        sources = "".join(_digest(path) for path in self.code)
        digest = hashlib.sha256((told + sources).encode()).hexdigest()[:10]
        return f"{self.name}-{digest}{self.suffix}"


_versions = cache(versions)
_GUESTS = "slam.guests."  # modules of what is not ours


@cache
def _digest(path: Path) -> str:
    whole = hashlib.sha256()
    for name, file in _files(path):
        content = file.read_bytes()
        whole.update(f"{name}\0{len(content)}\0".encode() + content)
    return whole.hexdigest()


def _files(path: Path) -> list[tuple[str, Path]]:
    """Names within the folder and files: no hidden ones, no ``__pycache__``."""
    if not path.is_dir():
        return [(path.name, path)]
    files = ((file.relative_to(path), file) for file in path.rglob("*") if file.is_file())
    return sorted(
        (name.as_posix(), file)
        for name, file in files
        if not any(part.startswith((".", "__pycache__")) for part in name.parts)
    )


def try_names(slams: Iterable[str], scenes: Iterable[str]) -> None:
    """Wrong names are told before anything starts: what is not ours is made once, of our SLAMs the
    config.
    """
    for name in scenes:
        if name not in registry.OWN:
            registry.build(name)
    for name in slams:
        base = parsed(name)[0]
        guest = system.OWN.get(base, _GUESTS).startswith(_GUESTS)
        if system.config_of(name) is None or guest:
            limited(name, Limits())


def run_jobs(
    jobs: Iterable[Job],
    folder: Path,
    *,
    processes: int = 1,
    cluster: str | None = None,
    title: str = "jobs",
) -> dict[str, Path]:
    """Make what is missing, on ``processes`` processes or on a Dask ``cluster`` that sees
    ``folder``; the file of each job by its name. Without a ``title`` nothing is shown.

    A job that fails stops the rest and is named in the error; results that are whole stay, and the
    next call goes on from them. One that is not what its hash says is named and made again. Raises
    ``InvalidValueError`` for two jobs of one name, ``OutputError`` while another call, or workers
    that it left, write into ``folder``.
    """
    wanted: dict[str, Job] = {}
    for job in jobs:
        if job.name in wanted:
            raise InvalidValueError(f"two jobs are called {job.name!r}")
        wanted[job.name] = job
    if processes < 1:
        raise InvalidValueError(f"processes must be >= 1, got {processes}")
    make_folder(folder)
    with locks.locked(folder):
        try:
            return _make_missing(wanted, folder, processes, cluster, title)
        finally:  # of workers that were stopped, or killed earlier
            for left in folder.iterdir():
                if is_part(left.name):
                    remove(left)


def _make_missing(
    wanted: Mapping[str, Job], folder: Path, processes: int, cluster: str | None, title: str
) -> dict[str, Path]:
    files = {name: folder / job.file_name() for name, job in wanted.items()}
    missing = [job for name, job in wanted.items() if not _whole(files[name])]
    with progress(quiet=not title) as bar:
        total, there = len(wanted), len(wanted) - len(missing)
        task = bar.add_task(escape(title), total=total, completed=there, before=there, unit="")
        pairs = [(job, files[job.name]) for job in missing]
        ways: dict[str, Any] = {"jobs": processes, "cluster": cluster, "shared": folder}
        spent = []
        try:
            for done, one in enumerate(workers.each(_make_pair, pairs, **ways), there + 1):
                spent.append(one)
                interrupt.check()
                bar.update(task, completed=done, unit=f"{done}/{total}")
        finally:
            if spent and cluster is None:
                learn(spent)
    return files


def _whole(file: Path) -> bool:
    """Whether it is there, as it was made; a note says so where it is not as it was made."""
    if not os.path.lexists(file):
        return False
    wrong = damage_beside(file)
    if wrong:
        note(f"made again: {wrong}")
    return not wrong


def _make_pair(pair: tuple[Job, Path]) -> tuple[Work, float]:
    """What it was, and s that it took."""
    started = time.perf_counter()
    make(*pair)
    return pair[0].work(), time.perf_counter() - started


def make(job: Job, file: Path) -> None:
    """Run one job into ``file``; what a killed run left of it is removed first."""
    for left in file.parent.glob(f".{file.stem}.*{PART}{file.suffix}"):
        left.unlink(missing_ok=True)
    temporary = file.with_name(f".{file.stem}.{os.getpid()}{PART}{file.suffix}")
    try:
        job.call(temporary, **job.arguments)
        write_beside(file, temporary)
        put(temporary, file)
    except OutputError as error:
        raise OutputError(str(error).replace(str(temporary), str(file.parent))) from error
    except MobiliaError:
        raise
    except Exception as error:
        if isinstance(error, OSError) and is_full(error, file.parent):
            said = f"cannot write {file.parent}: {reason(error, file.parent)}"
            raise OutputError(said) from error
        raise SlamFailedError(f"{job.name}: {type(error).__name__}: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)
