# SPDX-License-Identifier: Apache-2.0
"""Commands killed with SIGKILL at random moments, and what is left of them.

    python -m scripts.robustness.kills --kills 50 --seed 0 --out out/kills

``generate --jobs 2`` and ``compare --jobs 2`` in turn, each kill of the command alone or of its
whole process group. A killed command is given again and goes on; when it has ended by itself, its
results are held against those of a run that nobody killed, and it begins anew. After each kill:
how long the last process lived that the command had started, daemons too, and whether every file
that is seen is whole. Exit status 1 where something was wrong. Linux only.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from scripts.console import console
from scripts.robustness.disk_log import tree
from sim.recording.verify import check_hashes

LIMIT_S = 2.0  # promised from the kill to the end of the last process
WAIT_S = 10.0  # for those that break the promise
MARK = "MOBILIA_KILLS"  # in the environment of all that a command starts
TIMED = ("milliseconds", "ms_per_scan", "peak_memory")  # differs from run to run
REPO = Path(__file__).resolve().parents[2]
# A guest with a child in a session of its own.
GUEST = (
    "pipe:sh -c 'setsid sleep 600 >/dev/null 2>&1 & "
    f'exec "{sys.executable}" "{REPO / "docs/examples/pipe_slam.py"}"\''
)
SHORT = ["--seconds", "1", "--scanner", "ideal", "--jobs", "2"]


@dataclass
class Command:
    """A command under test and what was seen of it."""

    name: str
    words: list[str]
    torn: Callable[[Path], list[str]]  # what is seen in its folder and is not whole
    same: Callable[[Path, Path], bool]
    length_s: float = 0.0
    ends_s: dict[str, list[float]] = field(default_factory=lambda: {"command": [], "group": []})
    outlived: int = 0
    completed: int = 0
    faults: list[str] = field(default_factory=list)

    def start(self, out: Path, mark: str) -> subprocess.Popen[bytes]:
        """Running, as the leader of a process group."""
        with (out.parent / f"{self.name}.log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "scripts", self.name, *self.words, *SHORT, "--out", out],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                cwd=REPO,
                env={**os.environ, MARK: mark},
                start_new_session=True,
            )


def marked(mark: str) -> list[int]:
    """Processes with that mark in their environment that are not over."""
    wanted, found = f"{MARK}={mark}".encode(), []
    for name in os.listdir("/proc"):
        with suppress(OSError):
            if name.isdigit() and wanted in Path(f"/proc/{name}/environ").read_bytes().split(b"\0"):
                found.append(int(name))
    return found


def last_end_s(mark: str) -> float:
    """Until the last process of that mark has ended; after ``WAIT_S`` those that have not are."""
    started = time.monotonic()
    while left := marked(mark):
        if time.monotonic() - started > WAIT_S:
            for pid in left:
                with suppress(OSError):
                    os.kill(pid, signal.SIGKILL)
            return float("inf")
        time.sleep(0.01)
    return time.monotonic() - started


def torn_episodes(out: Path) -> list[str]:
    """Episodes that are seen and not whole."""
    episodes = [folder for folder in out.glob("[!.]*") if folder.is_dir()]
    return [folder.name for folder in episodes if check_hashes(folder).verdict != "whole"]


def torn_archives(out: Path) -> list[str]:
    """Archives of arrays that are seen and cannot be read."""
    return [file.name for file in out.glob("*/[!.]*.npz") if not _reads(file)]


def _reads(file: Path) -> bool:
    try:
        with zipfile.ZipFile(file) as archive:
            return archive.testzip() is None
    except (OSError, zipfile.BadZipFile):
        return False


def files(out: Path) -> dict[str, Path]:
    """All that is in a folder, hidden files too."""
    return {file.relative_to(out).as_posix(): file for file in out.rglob("*") if file.is_file()}


def same_bytes(one: Path, other: Path) -> bool:
    """The same files and folders with the same bytes."""
    return tree(one) == tree(other)


def same_numbers(one: Path, other: Path) -> bool:
    """Comparisons with the same files and, but for timings and memory, the same numbers."""
    here, there = files(one), files(other)
    if here.keys() != there.keys() or _rows(one) != _rows(other):
        return False
    archives = [name for name in here if name.endswith(".npz") and not name.startswith("entries/")]
    return all(_same_arrays(here[name], there[name]) for name in archives)


def _rows(out: Path) -> list[dict[str, str]]:
    with (out / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return [{k: v for k, v in row.items() if not k.startswith(TIMED)} for row in rows]


def _same_arrays(one: Path, other: Path) -> bool:
    with np.load(one) as here, np.load(other) as there:
        return set(here.files) == set(there.files) and all(
            _equal(here[k], there[k]) for k in here.files if not any(word in k for word in TIMED)
        )


def _equal(one: NDArray[np.generic], other: NDArray[np.generic]) -> bool:
    return (
        one.dtype == other.dtype
        and one.shape == other.shape
        and bool(one.tobytes() == other.tobytes())
    )


def attack(command: Command, out: Path, whole: Path, whom: str, moment: float) -> None:
    """Start it, kill ``whom`` ("command" or its "group") after that share of its length, look."""
    mark = f"{os.getpid()}-{time.monotonic_ns()}"
    process = command.start(out, mark)
    try:
        process.wait(moment * command.length_s)
    except subprocess.TimeoutExpired:
        (os.killpg if whom == "group" else os.kill)(process.pid, signal.SIGKILL)
        process.wait()
        command.ends_s[whom].append(last_end_s(mark))
        command.outlived += command.ends_s[whom][-1] > LIMIT_S
        command.faults += [f"torn: {name}" for name in (command.torn(out) if out.exists() else [])]
        return
    _judge(command, process.returncode, out, whole)


def _judge(command: Command, status: int, out: Path, whole: Path) -> None:
    """One that has ended by itself."""
    if status != 0:
        command.faults.append(f"status {status}: see {command.name}.log")
    elif not command.same(whole, out):
        kept = out.with_name(f"{out.name}-differs-{command.completed}")
        shutil.copytree(out, kept)
        command.faults.append(f"differs from the run that was not killed: {kept}")
    command.completed += status == 0
    shutil.rmtree(out)


def carry_out(commands: list[Command], kills: int, seed: int, folder: Path) -> None:
    """All kills, in turn; the last run of each command is left alone."""
    rng = np.random.default_rng(seed)
    for command in commands:
        for _ in range(2):  # the first compiles
            shutil.rmtree(folder / f"{command.name}-whole", ignore_errors=True)
            started = time.monotonic()
            whole = command.start(folder / f"{command.name}-whole", "whole")
            if whole.wait() != 0:
                command.faults.append(f"fails without a kill: see {command.name}.log")
                return
            command.length_s = time.monotonic() - started
    turn = 0
    while (done := sum(len(ends) for c in commands for ends in c.ends_s.values())) < kills:
        command = commands[turn % len(commands)]
        whom = (
            "group" if len(command.ends_s["group"]) < len(command.ends_s["command"]) else "command"
        )
        out, turn = folder / command.name, turn + 1
        attack(command, out, folder / f"{command.name}-whole", whom, float(rng.uniform()))
        console.print(f"{done}/{kills}: {command.name}, {whom}", highlight=False)
    for command in commands:
        out = folder / command.name
        status = command.start(out, "last").wait()
        _judge(command, status, out, folder / f"{command.name}-whole")


def table(commands: list[Command]) -> Table:
    """Kills, the longest life after one, what was wrong."""
    shown = Table(title="killed at random moments", title_justify="left")
    headings = ("command", "killed", "kills", "last end, median", "longest")
    for heading in (*headings, f"over {LIMIT_S:g} s"):
        shown.add_column(heading, justify="right")
    for command in commands:
        for whom, ends in command.ends_s.items():
            median, most = (float(np.median(ends)), max(ends)) if ends else (0.0, 0.0)
            late = str(sum(end > LIMIT_S for end in ends))
            row = (command.name, whom, str(len(ends)), f"{median:.2f} s", f"{most:.2f} s", late)
            shown.add_row(*row)
    return shown


def main(arguments: list[str] | None = None) -> int:
    """1 where something was left, torn or different."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/kills"))
    wanted = parser.parse_args(arguments)
    folder = wanted.out.absolute()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    scene = ["--scene", "arena", "--dynamism", "0.5", "--seeds", "3"]
    commands = [
        Command("generate", ["arena", "--episodes", "6"], torn_episodes, same_bytes),
        Command("compare", ["--slam", "odometry", GUEST, *scene], torn_archives, same_numbers),
    ]
    carry_out(commands, wanted.kills, wanted.seed, folder)
    console.print(table(commands))
    for command in commands:
        done = f"{command.name}: {command.completed} results held against an unkilled run"
        console.print(f"{done}, {len(command.faults)} faults, {command.length_s:.1f} s long")
        for fault in command.faults:
            console.print(f"  {fault}", markup=False, soft_wrap=True)
    return 1 if any(command.faults or command.outlived for command in commands) else 0


if __name__ == "__main__":
    sys.exit(main())
