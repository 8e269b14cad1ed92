# SPDX-License-Identifier: Apache-2.0
"""Damage results at random and see who notices.

``python -m scripts.robustness.damage --cases 1000``.

A dataset, a run, a comparison, a drive, a counterfactual and maps are made small. In each case one
byte of one file is flipped or cut, one file removed, or one added, and ``mobilia verify`` must not
call it well. Those who read results get the same damages: they must raise one of our errors, or
answer as they do when nothing is damaged. The same seed damages the same bytes.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from scripts import results
from scripts.console import console
from scripts.robustness.samples import ALONE, SAMPLES, Outcome, consumers
from slam.errors import InvalidValueError, MobiliaError

KINDS = ("flip", "cut", "remove", "add")
ADDED = ("notes.txt", ".hidden", ".lock", ".x.1.part", "recipe.json.bak", "SHA256SUMS.old")
Answer = str  # "noticed", "the same", "wrong", or the traceback's last line


@dataclass(frozen=True, kw_only=True)
class Damage:
    """What is done to a folder: ``kind`` to the file ``name``, at the byte ``at``."""

    kind: str
    name: str
    at: int = 0
    bit: int = 0

    def apply(self, folder: Path) -> None:
        """Do it."""
        path = folder / self.name
        if self.kind == "remove":
            path.unlink()
            return
        if self.kind == "add":
            path.write_bytes(b"something else\n")
            return
        data = bytearray(path.read_bytes())
        if self.kind == "flip":
            data[self.at] ^= 1 << self.bit
        else:
            del data[self.at]
        path.write_bytes(bytes(data))


def damages(folder: Path, count: int, seed: int, kinds: Sequence[str] = KINDS) -> list[Damage]:
    """``count`` of them: all files in turn, each in all of these ways."""
    rng = np.random.default_rng(seed)
    files = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    rng.shuffle(files)
    return [
        _damage(rng, folder, files, kinds[k % len(kinds)], (k // len(kinds)) % len(files))
        for k in range(count)
    ]


def _damage(rng: np.random.Generator, folder: Path, files: list[str], kind: str, k: int) -> Damage:
    if kind == "add":
        added = ADDED[int(rng.integers(len(ADDED)))]
        return Damage(kind=kind, name=(Path(files[k]).parent / added).as_posix())
    if kind != "remove" and (folder / files[k]).stat().st_size == 0:
        k = max(range(len(files)), key=lambda i: (folder / files[i]).stat().st_size)
    at = int(rng.integers(max((folder / files[k]).stat().st_size, 1)))
    return Damage(kind=kind, name=files[k], at=at, bit=int(rng.integers(8)))


@contextmanager
def damaged(folder: Path, whole: Path, damage: Damage) -> Any:
    """The folder with that damage; afterwards the one file, or the folder, is ``whole`` again."""
    damage.apply(folder)
    try:
        yield folder
    finally:
        if (whole / damage.name).exists():
            shutil.copy2(whole / damage.name, folder / damage.name)
        else:
            (folder / damage.name).unlink(missing_ok=True)


def seen_by_verify(folder: Path) -> Answer:
    """Whether ``verify`` would say so."""
    answer = answer_of(lambda path: all(found.ok for found in results.check(path)), folder, False)
    return "noticed" if answer == "the same" else answer


def answer_of(consumer: Callable[[Path], Outcome], folder: Path, wanted: Outcome) -> Answer:
    """What a reader makes of the folder, beside what it made of the whole one."""
    try:
        return "the same" if consumer(folder) == wanted else "wrong"
    except MobiliaError:
        return "noticed"
    except Exception as error:  # noqa: BLE001  # that is what is looked for
        return f"{type(error).__name__}: {error}"


@dataclass(frozen=True, eq=False)
class Tally:
    """Answers by who was asked, the sample and the kind of damage; what was wrong, in words."""

    counts: Counter[tuple[str, str, str, Answer]] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def note(self, who: str, sample: str, damage: Damage, answer: Answer) -> None:
        """One case."""
        if answer not in ("noticed", "the same"):
            self.wrong.append(f"{who}, {sample}, {damage}: {answer}")
            answer = "wrong"
        self.counts[who, sample, damage.kind, answer] += 1


def try_verify(tally: Tally, name: str, folder: Path, count: int, seed: int) -> None:
    """``verify`` on ``count`` damages of a folder, or of a file alone.

    A lone map may also be read as the very same one: its format has bytes that say nothing.
    """
    kinds = KINDS if name not in ALONE else KINDS[:3]
    with _copy(folder) as copy:
        asked = copy / ALONE.get(name, "")
        if seen_by_verify(asked) == "noticed":
            raise InvalidValueError(f"verify takes the whole {name} for a damaged one")
        read = consumers(name).get("map") if name in ALONE else None
        wanted = read(copy) if read else None
        for damage in damages(folder, count, seed, kinds):
            with damaged(copy, folder, damage):
                answer = seen_by_verify(asked)
                if answer == "wrong" and read:
                    answer = answer_of(read, copy, wanted)
                tally.note("verify", name, damage, answer)


def try_consumers(tally: Tally, name: str, folder: Path, count: int, seed: int) -> None:
    """Everybody who reads such a folder, on ``count`` damages each; they may mend it."""
    for who, consumer in consumers(name).items():
        with _copy(folder) as copy:
            wanted = consumer(copy)
        for damage in damages(folder, count, seed, KINDS if name not in ALONE else KINDS[:3]):
            with _copy(folder) as copy:
                damage.apply(copy)
                tally.note(who, name, damage, answer_of(consumer, copy, wanted))


@contextmanager
def _copy(folder: Path) -> Any:
    with tempfile.TemporaryDirectory(prefix="mobilia-damage-") as scratch:
        yield Path(shutil.copytree(folder, Path(scratch) / folder.name))


def table(tally: Tally) -> Table:
    """Who x sample x kind of damage: noticed, answered the same, wrong, of how many."""
    out = Table(title="damages", title_justify="left")
    for heading in ("who", "result", "damage"):
        out.add_column(heading)
    for heading in ("noticed", "the same", "wrong", "of"):
        out.add_column(heading, justify="right")
    rows = sorted({key[:3] for key in tally.counts})
    for row in rows:
        numbers = [tally.counts[(*row, answer)] for answer in ("noticed", "the same", "wrong")]
        out.add_row(*row, *map(str, numbers), str(sum(numbers)))
    return out


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000, help="Of the dataset, for verify.")
    parser.add_argument("--others", type=int, default=500, help="Of all other results together.")
    parser.add_argument("--consumers", type=int, default=24, help="For each reader of a result.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=list(SAMPLES), choices=list(SAMPLES))
    wanted, started, tally = parser.parse_args(), time.perf_counter(), Tally()
    with tempfile.TemporaryDirectory(prefix="mobilia-damage-") as scratch:
        console.quiet = True
        made = {name: SAMPLES[name](Path(scratch) / name) for name in wanted.only}
        each = -(-wanted.others // max(len(made) - ("dataset" in made), 1))
        for name, folder in made.items():
            count = wanted.cases if name == "dataset" else each
            try_verify(tally, name, folder, count, wanted.seed)
            try_consumers(tally, name, folder, wanted.consumers, wanted.seed)
    console.quiet = False
    console.print(table(tally))
    for line in tally.wrong:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    total = tally.counts.total()
    console.print(
        f"{total} cases in {time.perf_counter() - started:.0f} s, seed {wanted.seed}: "
        f"{len(tally.wrong)} wrong"
    )
    sys.exit(1 if tally.wrong else 0)


if __name__ == "__main__":
    main()
