# SPDX-License-Identifier: Apache-2.0
"""The power fails at every step of a command: ``python -m scripts.robustness.power_loss``.

Each command is run once, with what it does to the disk logged (``scripts.robustness.disk_log``).
After each
step the disk is rebuilt as a cut would leave it, in three ways: without anything that was not
synced, with all names but without their bytes, and with some of both. Whatever has its own name
there must be whole. From some of these disks the same command is run again and must end with the
same bytes, but for clock readings. The script prints a table, and what syncing costs ``generate``.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

from rich.table import Table

from scripts.console import console
from scripts.machine import machine
from scripts.robustness.power_cases import cases
from scripts.robustness.power_cuts import Outcome, tried
from scripts.verbs.generate import generate
from slam import files


def syncing_costs(
    scratch: Path, pairs: int, seconds: float
) -> tuple[list[float], list[float], list[float]]:
    """Seconds that ``generate`` takes as it is and without syncing, ``pairs`` of each in turn, and
    how many of the former it waits for the disk."""
    spent: tuple[list[float], list[float]] = ([], [])
    waits = []
    for k in range(2 * pairs):
        without = (k + k // 2) % 2  # with, without, without, with
        with (
            mock.patch.object(os, "fsync", int if without else os.fsync),  # int does nothing
            _timed("sync_tree") as trees,
            _timed("sync_names") as names,
        ):
            started = time.perf_counter()
            generate(["arena"], scratch / f"cost{k}", episodes=2, seconds=seconds)
            spent[without].append(time.perf_counter() - started)
        if not without:
            waits.append(sum(trees) + sum(names))
        files.remove(scratch / f"cost{k}")
    return *spent, waits


@contextmanager
def _timed(name: str) -> Iterator[list[float]]:
    """How long each call of a function of ``slam.files`` takes, s."""
    calls: list[float] = []
    function = getattr(files, name)

    def timed(path: Path) -> None:
        started = time.perf_counter()
        function(path)
        calls.append(time.perf_counter() - started)

    with mock.patch.object(files, name, timed):
        yield calls


def main() -> None:
    """Print the table; exit status 1 when something was torn or ended otherwise."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--resumes", type=int, default=8, help="disks to go on from, of each case")
    parser.add_argument("--draws", type=int, default=5, help="of the third way, at each step")
    parser.add_argument("--pairs", type=int, default=5, help="of the runs that measure the cost")
    parser.add_argument("--seconds", type=float, default=60.0, help="length of their episodes")
    parser.add_argument("--only", default="", help="cases whose name begins so")
    wanted = parser.parse_args()
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        console.quiet = True
        for k, case in enumerate(cases()):
            if case.name.startswith(wanted.only):
                outcomes.append(
                    tried(case, scratch / str(k), resumes=wanted.resumes, draws=wanted.draws)
                )
        spent = syncing_costs(scratch, wanted.pairs, wanted.seconds)
        console.quiet = False
    _tell(outcomes)
    if wanted.pairs:
        _tell_cost(*spent, wanted.seconds)
    sys.exit(any(outcome.torn or outcome.other for outcome in outcomes))


_COLUMNS = ("whole", "as before", "on its way", "absent", "torn")


def _tell(outcomes: list[Outcome]) -> None:
    table = Table(title="power cuts", title_justify="left")
    for heading in ("command", "steps", "disks", *_COLUMNS, "same bytes again"):
        table.add_column(heading, justify="left" if heading == "command" else "right")
    for outcome in outcomes:
        same = f"{outcome.resumed - len(outcome.other)} of {outcome.resumed}"
        counts = [str(outcome.found[column]) for column in _COLUMNS]
        table.add_row(outcome.name, str(outcome.steps), str(outcome.disks), *counts, same)
    console.print(table)
    for outcome in outcomes:
        for line in (*outcome.torn[:20], *outcome.other):
            console.print(f"{outcome.name}: {line}", markup=False, soft_wrap=True)


def _tell_cost(
    with_s: list[float], without_s: list[float], waits_s: list[float], seconds: float
) -> None:
    waited = [100.0 * wait / whole for wait, whole in zip(waits_s, with_s, strict=True)]
    shares = [100.0 * (a / b - 1.0) for a, b in zip(with_s, without_s, strict=True)]
    middle, low, high = statistics.median(shares), min(shares), max(shares)
    console.print(
        f"generate arena --episodes 2 --seconds {seconds:g}: {statistics.median(with_s):.2f} s as "
        f"it is, {statistics.median(without_s):.2f} s without syncing; cost of {len(shares)} pairs "
        f"{middle:+.1f} % ({low:+.1f} to {high:+.1f}), of which it waited for the disk "
        f"{statistics.median(waited):.1f} % (at most {max(waited):.1f}); {machine()['processor']}, "
        f"{os.cpu_count()} cores",
        markup=False,
        soft_wrap=True,
    )


if __name__ == "__main__":
    main()
