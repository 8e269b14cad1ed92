# SPDX-License-Identifier: Apache-2.0
"""A study: cases x systems -> jobs -> rows -> tables, figures and a page, carried out here alone.

``compare``, ``drive``, buildings over days and experiments say what theirs is as a ``Study``, or as
``Stage``s of one. A study that was killed goes on when it is carried out again.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from scripts.jobs import Job, run_jobs, try_names
from scripts.machine import machine
from scripts.output import refuse_others, result_folder

Files = Mapping[str, Path]
"""The file of each job, by the name of the job."""
R = TypeVar("R")


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Jobs that need nothing of each other: those of a later stage read what an earlier one made.

    title   what is said while they run
    folder  of their files, within that of the study
    """

    title: str
    folder: str
    jobs: Sequence[Job]

    def missing(self, out: Path) -> list[Job]:
        """Those that are not done yet in ``out``."""
        folder = out / self.folder
        return [job for job in self.jobs if not (folder / job.file_name()).exists()]


@dataclass(frozen=True, kw_only=True)
class Study(Generic[R]):
    """What is run, and what is told of it.

    command   whose folder it is
    settings  for its recipe, beside the machine
    slams, scenes  names that are told before anything starts where they are wrong
    write     ``write(folder, files)``: tables and figures into a folder; what is said of them
    """

    command: str
    settings: Mapping[str, Any]
    slams: Sequence[str]
    scenes: Sequence[str] = ()
    stages: Sequence[Stage]
    write: Callable[[Path, Files], R]


def refuse(study: Study[R], out: Path) -> None:
    """What is wrong with its names, or with the folder, is told before anything starts."""
    try_names(study.slams, study.scenes)
    refuse_others(out, study.command)


def carry_out(study: Study[R], out: Path, *, jobs: int = 1, cluster: str | None = None) -> R:
    """Make what is missing in ``out``, then all that is told of it, whole or not at all.

    jobs     processes of this machine
    cluster  or a Dask scheduler, whose workers see ``out``
    """
    refuse(study, out)
    out = out.absolute()
    settings = {**study.settings, "machine": machine()}
    with result_folder(out, study.command, settings) as written:
        files = make(study.stages, out, jobs=jobs, cluster=cluster)
        with written() as staged:
            return study.write(staged, files)


def make(
    stages: Sequence[Stage], out: Path, *, jobs: int = 1, cluster: str | None = None
) -> dict[str, Path]:
    """Run the jobs that are missing, stage by stage; the file of each, by its name."""
    files: dict[str, Path] = {}
    for stage in filter(lambda stage: stage.jobs, stages):
        folder = out / stage.folder
        ways: dict[str, Any] = {"processes": jobs, "cluster": cluster, "title": stage.title}
        files |= run_jobs(stage.jobs, folder, **ways)
    return files
