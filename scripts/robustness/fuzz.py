# SPDX-License-Identifier: Apache-2.0
"""Odd input of every kind.

``python -m scripts.robustness.fuzz --seconds 60`` and ``--cases 500 --seed 0``.

``--cases`` calls ``update`` of every SLAM, ``step``, ``reset`` and the constructors of environments
with odd arguments (``scripts.robustness.fuzz_calls``) so many times each, with a limit on time, and
prints what came of it. ``--seconds`` damages files at random and reads them:

Bags (MCAP packed and plain, sqlite3, ROS 1), CARMEN logs and recipes. A reader may succeed or raise
one of our errors; anything else, or more than ten seconds for one file, is a finding. The damaged
file is kept and named. The same seed damages the same files in the same way. Exit status 1 when
anything was found.
"""

from __future__ import annotations

import argparse
import gzip
import json
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import numpy as np
from rich.table import Table
from rosbags.rosbag1 import Writer as WriterOfRos1
from rosbags.rosbag2 import StoragePlugin, Writer

from scripts.console import console
from scripts.robustness import fuzz_calls
from scripts.robustness.fuzz_calls import GROUPS, Tally
from sim.recording.episode import record
from sim.recording.recipe import RECIPE, Recipe, read_recipe
from slam.errors import MobiliaError
from slam.logs import read_bag, read_carmen, write_carmen
from slam.logs.bag_topics import ROS1, ROS2, Bag

HANG_S = 10
CASE_S = 120  # of odd calls: six scans of 100 000 beams take half of it on a busy machine
MEMORY_BYTES = 6 << 30
_TOPICS = ("/scan", "/scan_turn", "/odom", "/tf_static", "/ground_truth/pose")


@dataclass(frozen=True, kw_only=True)
class Sample:
    """A sound file and its reader."""

    name: str
    data: bytes
    read: Callable[[Path], object]


def corpus(folder: Path) -> list[Sample]:
    """Small sound files, the same ones each time."""
    recipe = Recipe(scene="arena", seed=1, dynamism=1.0, seconds=0.2, options={"n_chairs": 2})
    record(recipe, folder)
    episode = folder / recipe.name
    packed = episode / f"{episode.name}.mcap"
    plain, sqlite, ros1 = _repack(episode, folder)
    write_carmen(folder / "a.log", read_bag(episode))
    text = (folder / "a.log").read_bytes()
    files = {
        "packed.mcap": (packed.read_bytes(), _bag),
        "plain.mcap": (plain.read_bytes(), _bag),
        "sqlite.db3": (sqlite.read_bytes(), _bag),
        "ros1.bag": (ros1.read_bytes(), _bag),
        "carmen.log": (text, _carmen),
        "carmen.log.gz": (gzip.compress(text, mtime=0), _carmen),
        RECIPE: ((episode / RECIPE).read_bytes(), read_recipe),
    }
    return [Sample(name=name, data=data, read=read) for name, (data, read) in files.items()]


def _repack(episode: Path, folder: Path) -> tuple[Path, Path, Path]:
    """The episode as a plain MCAP, as sqlite3 and as a bag of ROS 1: (the three files)."""
    with Bag(episode) as bag:
        messages = list(bag.raw(_TOPICS))
    kinds = {topic: kind for topic, kind, _, _ in messages}
    storages = ((StoragePlugin.MCAP, "plain"), (StoragePlugin.SQLITE3, "sqlite"))
    for plugin, name in storages:
        with Writer(folder / name, version=8, storage_plugin=plugin) as writer:
            topics = {t: writer.add_connection(t, k, typestore=ROS2) for t, k in kinds.items()}
            for topic, _, stamp_ns, data in messages:
                writer.write(topics[topic], stamp_ns, data)
    with WriterOfRos1(folder / "ros1.bag") as old:
        connections = {t: old.add_connection(t, k, typestore=ROS1) for t, k in kinds.items()}
        for topic, kind, stamp_ns, data in messages:
            old.write(connections[topic], stamp_ns, bytes(ROS2.cdr_to_ros1(data, kind)))
    return (folder / "plain" / "plain.mcap", folder / "sqlite" / "sqlite.db3", folder / "ros1.bag")


def _bag(path: Path) -> None:
    for _ in read_bag(path, labels=True):
        pass


def _carmen(path: Path) -> None:
    for _ in read_carmen(path):
        pass


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """One to six random injuries: bits, numbers, lost, doubled and swapped stretches, a cut."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 7))):
        if not out:
            break
        at = int(rng.integers(len(out)))
        length = int(rng.integers(1, 1 + min(64, len(out) - at)))
        match int(rng.integers(7)):
            case 0:
                out[at] ^= 1 << int(rng.integers(8))
            case 1:
                out[at : at + length] = rng.bytes(length)
            case 2:
                del out[at : at + length]
            case 3:
                out[at:at] = out[at : at + length]
            case 4:
                out[at : at + 4] = rng.choice([b"\xff\xff\xff\xff", b"\0\0\0\0", b"\0\0\xc0\x7f"])
            case 5:
                out[at : at + length] = bytes(rng.choice(list(b'0123456789.-eE \n"{}[]'), length))
            case _:
                if rng.random() < 0.2:
                    del out[at:]
    return bytes(out)


class Hang(BaseException):
    """A reader that does not come back."""


@contextmanager
def _alarm(limit_s: int) -> Iterator[None]:
    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise Hang(f"no answer within {limit_s} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(limit_s)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def attack(sample: Sample, folder: Path, rng: np.random.Generator) -> tuple[str, str]:
    """(outcome, details) of reading one damaged file: "read", "refused" or "FINDING"."""
    path = folder / sample.name
    path.write_bytes(damaged(sample.data, rng))
    try:
        with _alarm(HANG_S):
            sample.read(path)
    except MobiliaError as error:
        if sample.name.split(".")[0] not in str(error):
            return "FINDING", f"the error does not name the file: {error}"
        return "refused", ""
    except BaseException as error:  # this is what we look for
        if isinstance(error, KeyboardInterrupt):
            raise
        return "FINDING", f"{type(error).__name__}: {error}"
    return "read", ""


def _limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, resource.RLIM_INFINITY))


def call(cases: int, seed: int) -> int:
    """Run so many cases of each group; the number of findings. Prints a table."""
    table, findings = Table("target", "cases", "answered", "refused", "warnings", "findings"), 0
    for group, (_, names) in GROUPS.items():
        whole, counts = {name: Tally() for name in names}, Counter[str]()
        for number in range(cases):
            name = names[number % len(names)]
            counts[name] += 1
            tally = Tally()
            try:
                with _alarm(CASE_S):
                    tally = fuzz_calls.run(group, number, seed)
            except Hang as error:
                tally.findings.append(str(error))
            whole[name].add(tally)
            for words in tally.findings:
                console.print(f"{group} {name}, case {number}: {words}", markup=False)
        for name, tally in whole.items():
            found = (counts[name], tally.answered, tally.refused, tally.warned.total())
            table.add_row(f"{group} {name}", *map(str, found), str(len(tally.findings)))
            findings += len(tally.findings)
    console.print(table)
    return findings


def main(arguments: list[str] | None = None) -> int:
    """Attack for a while; exit status 1 when something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"), help="where findings go")
    parser.add_argument("--cases", type=int, help="of odd calls, instead of damaged files")
    wanted = parser.parse_args(arguments)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, resource.RLIM_INFINITY))
    if wanted.cases is not None:
        return 1 if call(wanted.cases, wanted.seed) else 0
    outcomes: Counter[tuple[str, str]] = Counter()
    findings = 0
    with tempfile.TemporaryDirectory() as scratch:
        samples = corpus(Path(scratch))
        started, rng = time.perf_counter(), np.random.default_rng(wanted.seed)
        while time.perf_counter() - started < wanted.seconds:
            for sample in samples:
                outcome, details = attack(sample, Path(scratch), rng)
                outcomes[sample.name, outcome] += 1
                if outcome == "FINDING":
                    findings += 1
                    wanted.keep.mkdir(parents=True, exist_ok=True)
                    kept = wanted.keep / f"{findings:03d}-{sample.name}"
                    kept.write_bytes((Path(scratch) / sample.name).read_bytes())
                    console.print(f"{kept}: {details}", markup=False, soft_wrap=True)
    table = {f"{name}, {outcome}": count for (name, outcome), count in sorted(outcomes.items())}
    console.print(json.dumps(table, indent=1))
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
