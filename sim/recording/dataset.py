# SPDX-License-Identifier: Apache-2.0
"""A folder of episodes and the plan that they follow."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from sim.recording.recipe import Recipe
from sim.recording.sums import SUMS, read_sums
from sim.recording.verify import check_hashes
from sim.twins import TWINS
from slam.errors import InvalidValueError, LogFormatError, OutputError
from slam.files import PART, is_part, make_folder, reason, write_text

PLAN = "dataset.json"
LOCK = ".lock"
MAX_EPISODES = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Which episodes a dataset has: ``episodes`` of them at each dynamism, of the same seeds.

    recipe      of the first one; the k-th episode has its seed plus k
    dynamisms   knobs in [0, 1]
    twins       whether each episode is one drive in three versions
    """

    recipe: Recipe
    dynamisms: tuple[float, ...]
    episodes: int
    twins: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.episodes, bool) or not 1 <= self.episodes <= MAX_EPISODES:
            raise InvalidValueError(
                f"Plan.episodes must be 1 to {MAX_EPISODES}, got {self.episodes}"
            )
        if not self.dynamisms or len(set(self.dynamisms)) != len(self.dynamisms):
            raise InvalidValueError(
                f"Plan.dynamisms must be different numbers, got {self.dynamisms}"
            )
        names = [name for recipe in self.jobs() for name in self.folders(recipe)]
        if len(set(names)) != len(names):
            raise InvalidValueError("Plan.dynamisms are too close: two episodes have one name")

    def jobs(self) -> list[Recipe]:
        """One recipe for each drive."""
        first, twin = asdict(self.recipe), "dynamic" if self.twins else ""
        return [
            Recipe(**{**first, "dynamism": d, "seed": self.recipe.seed + k, "twin": twin})
            for d in self.dynamisms
            for k in range(self.episodes)
        ]

    def folders(self, recipe: Recipe) -> list[str]:
        """Names of the episodes that a job makes."""
        return [recipe.of_twin(name).name for name in TWINS] if self.twins else [recipe.name]

    def text(self) -> str:
        """``dataset.json``."""
        return json.dumps({"schema": 1, **asdict(self)}, indent=1, sort_keys=True) + "\n"


class Dataset:
    """The folder ``path``; made by ``writing``."""

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path, self.plan = path, plan

    def missing(self) -> tuple[list[Recipe], list[str]]:
        """Jobs not done yet, and why whole-looking folders among them are not kept."""
        wanted, notes = [], []
        for job in self.plan.jobs():
            whole = True
            for name in self.plan.folders(job):
                folder = self.path / name
                if not folder.exists():
                    whole = False
                    continue
                finding = check_hashes(folder)
                if finding.verdict != "whole":
                    whole = False
                    notes.append(f"made again: {finding.why}")
                    shutil.rmtree(folder)
            if not whole:
                wanted.append(job)
        return wanted, notes

    def finish(self) -> None:
        """Write SHA256SUMS over all files of all episodes; ``OutputError`` when one is missing."""
        lines = []
        for job in self.plan.jobs():
            for name in self.plan.folders(job):
                try:
                    sums = read_sums(self.path / name)
                except LogFormatError as error:
                    raise OutputError(f"{self.path / name} is not there: {error}") from error
                lines += [f"{digest}  {name}/{file}\n" for file, digest in sums.items()]
        write_text(self.path / SUMS, "".join(sorted(lines, key=lambda line: line[66:])))


@contextmanager
def writing(path: Path, plan: Plan) -> Iterator[Dataset]:
    """The dataset at ``path``, locked against other writers, cleared of torn episodes.

    Raises ``OutputError`` when somebody else writes there, when the folder follows another plan or
    holds files that are no dataset, or cannot be written.
    """
    path = path.absolute()
    lock = path / LOCK
    try:
        make_folder(path)
        with lock.open("w") as held:
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise OutputError(f"{path} is being written by another process") from error
            try:
                _claim(path, plan)
                _clear(path)  # of what a killed run left
                yield Dataset(path, plan)
            finally:
                _clear(path)  # of what killed workers left
                lock.unlink(missing_ok=True)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {path}: {reason(error, path)}") from error


def _clear(path: Path) -> None:
    for torn in path.glob(f".*{PART}"):
        shutil.rmtree(torn, ignore_errors=True)


def _claim(path: Path, plan: Plan) -> None:
    """Leave the plan in an empty folder; refuse one that has another."""
    file = path / PLAN
    if file.exists():
        if file.read_text(encoding="utf-8", errors="replace") != plan.text():
            raise OutputError(f"{file} is of another dataset: choose another --out")
        return
    others = [name for name in os.listdir(path) if name != LOCK and not is_part(name)]
    if others:
        raise OutputError(f"{path} holds files that are no dataset: choose another --out")
    write_text(file, plan.text())


def episodes_in(path: Path) -> list[Path]:
    """The episode at ``path``, or all episodes of the dataset there.

    Raises ``LogFormatError`` when there is neither.
    """
    if (path / "recipe.json").exists():
        return [path]
    if not path.is_dir():
        raise LogFormatError(path, "no such folder")
    found = sorted(p.parent for p in path.glob("*/recipe.json"))
    if not found:
        raise LogFormatError(path, "holds no episode (no recipe.json)")
    return found
