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
import csv
import io
import json
import os
import re
import statistics
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import numpy as np
from rich.table import Table

from scripts.comparison import make
from scripts.comparison.plan import Plan
from scripts.console import console
from scripts.output import READY, machine
from scripts.robustness.disk_log import Cut, DiskLog, State, put_down, tree
from scripts.single_run.live import on_scene
from scripts.single_run.session import Outputs
from scripts.verbs.generate import generate
from sim.recording.sums import BESIDE, SUMS
from slam import files, locks
from slam.maps import write_map
from slam.shunting import ShuntingSlam
from slam.system import Raster

CLOCKS = (
    "milliseconds",
    "ms_per_scan_p50",
    "ms_per_scan_p99",
    "ms_per_scan_p999",
    "peak_memory_mb",
    "cpu_s",
)
OF_CLOCKS = (SUMS, BESIDE)  # hashes of files that hold clock readings
HIDDEN = (*locks.NAMES, READY)
_ASIDE = (".old", ".earlier.pgm")


@dataclass(frozen=True, kw_only=True)
class Case:
    """A command, and what it leaves.

    call     it, in a folder
    things   of the names of the files that it leaves: those that belong together, by name
    first    what is run before, so that there is something to replace
    opened   ending of the file that readers open: a thing without it counts as absent
    exact    whether a second run ends with the same bytes; else clock readings may differ
    exchange  whether the file system can swap two names
    """

    name: str
    call: Callable[[Path], object]
    things: Callable[[Iterable[str]], Mapping[str, set[str]]]
    first: Callable[[Path], object] | None = None
    opened: str = ""
    exact: bool = False
    exchange: bool = True


@dataclass(kw_only=True)
class Outcome:
    """Of a case: steps, disks looked at, what was found there, and how going on ended."""

    name: str
    steps: int = 0
    disks: int = 0
    found: Counter[str] = field(default_factory=Counter)
    torn: list[str] = field(default_factory=list)
    resumed: int = 0
    other: list[str] = field(default_factory=list)


def tried(case: Case, scratch: Path, *, resumes: int, draws: int = 1) -> Outcome:
    """Cut the power at every step, ``draws`` times in the third way; go on from some disks."""
    root = scratch / "first"
    root.mkdir(parents=True)
    if case.first is not None:
        case.first(root)
    before = tree(root)
    log = DiskLog(root, exchange=case.exchange)
    with log.recording():
        case.call(root)
    after = tree(root)
    outcome = Outcome(name=case.name, steps=len(log.steps))
    if _shown(log.left(len(log.steps), Cut.NOTHING)) != _shown(after):
        outcome.torn.append("after the last step: not all is on the disk")
    disks = list(_disks(log, draws))
    for where, state in disks:
        outcome.disks += 1
        _look(case, where, _as_read(state), before, after, outcome)
    picked = np.unique(np.linspace(0, len(disks) - 1, resumes).astype(int)) if resumes else ()
    for k in picked:
        where, state = disks[k]
        again = scratch / f"again{k}"
        put_down(state, again)
        case.call(again)
        outcome.resumed += 1
        if differ := _difference(case, tree(again), after):
            outcome.other.append(f"{where}: {differ}")
    return outcome


def _disks(log: DiskLog, draws: int) -> Iterator[tuple[str, State]]:
    for step in range(len(log.steps) + 1):
        for cut in Cut:
            for seed in range(draws if cut is Cut.SOME else 1):
                yield f"step {step}, {cut.value}", log.left(step, cut, seed)


def _look(
    case: Case, where: str, state: State, before: State, after: State, outcome: Outcome
) -> None:
    """Every thing on a disk: whole, as it was, on its way, absent or torn."""
    old, new = _files(before), _files(after)
    known: set[str] = set()
    for thing, names in case.things({**old, **new}).items():
        known |= names
        found = _found(case, names, state, old, new)
        outcome.found[found] += 1
        if found == "torn":
            outcome.torn.append(f"{where}: {thing}")
    strays = {name for name in _files(state) if not _hidden(name)} - known
    outcome.torn += [f"{where}: {name} is nothing of ours" for name in sorted(strays)]


def _found(
    case: Case, names: set[str], state: State, old: Mapping[str, bytes], new: Mapping[str, bytes]
) -> str:
    there = {name: data for name in names if (data := state.get(name)) is not None}
    was, wanted = ({n: v[n] for n in names if n in v} for v in (old, new))
    if there == wanted:
        return "whole"
    if there == was:
        return "as before" if was else "absent"
    kept = {_place(n): d for n, d in _files(state).items() if _place(n) != n}
    held = {**there, **{n: d for n, d in kept.items() if n in names}}
    if kept and ({**was, **held} == {**was, **wanted} or held == was):
        return "on its way"
    return "torn" if any(name.endswith(case.opened) for name in there) else "absent"


def _as_read(state: State) -> State:
    """A map whose YAML file names the kept image of an earlier one, as its readers see it."""
    seen = dict(state)
    for name, data in _files(state).items():
        kept = (
            re.search(rb"image: (\.(.+)\.earlier\.pgm)\n", data) if name.endswith(".yaml") else None
        )
        if data is not None and kept is not None:
            folder = name.rpartition("/")[0]
            seen[name] = data.replace(kept[1], kept[2] + b".pgm")
            image = state.get(f"{folder}/{kept[1].decode()}")
            seen[f"{folder}/{kept[2].decode()}.pgm"] = image
    return seen


def _place(name: str) -> str:
    """Where the next run puts a file that lies in ``READY``, or in an earlier run put aside."""
    return re.sub(r"\.([^/]+)\.\d+\.old/", r"\1/", name.replace(f"{READY}/", ""))


def _shown(state: State) -> State:
    return {name: data for name, data in state.items() if not _hidden(name)}


def _files(state: State) -> dict[str, bytes]:
    return {name: data for name, data in state.items() if data is not None}


def _hidden(name: str) -> bool:
    return any(files.is_part(p) or p in HIDDEN or p.endswith(_ASIDE) for p in name.split("/"))


def _difference(case: Case, state: State, wanted: State) -> str:
    """The first name that differs; empty where all is the same."""
    for name in sorted({*state, *wanted}):
        if name not in state or name not in wanted:
            return f"{name} is {'missing' if name in wanted else 'left'}"
        one, two = state[name], wanted[name]
        if one != two and (case.exact or _timeless(name, one) != _timeless(name, two)):
            return f"{name} differs"
    return ""


def _timeless(name: str, data: bytes | None) -> object:
    """The content of a file without clock readings."""
    if data is None or name.endswith(OF_CLOCKS):
        return None
    if name.endswith(".json"):
        return _without(json.loads(data))
    if name.endswith(".csv"):
        rows = list(csv.DictReader(io.StringIO(data.decode())))
        return [_without(row) for row in rows if row.get("metric") not in CLOCKS]
    if name.endswith(".npz"):
        with np.load(io.BytesIO(data)) as file:
            arrays = {key: file[key] for key in file.files if not key.endswith(CLOCKS)}
        row = _without(json.loads(arrays.pop("row").item())) if "row" in arrays else None
        return row, {key: (a.dtype.str, a.shape, a.tobytes()) for key, a in arrays.items()}
    return data


def _without(value: object) -> object:
    """JSON without what a clock said."""
    if isinstance(value, dict):
        told = {k: _without(v) for k, v in value.items()}
        return {k: v for k, v in told.items() if k not in CLOCKS and not _timing(k)}
    return [_without(item) for item in value] if isinstance(value, list) else value


def _timing(key: str) -> bool:
    return (
        key in ("timing", "cost", "wall_s", "slam_ms_per_scan", "real_time_factor") or "ms_" in key
    )


def each_alone(names: Iterable[str]) -> dict[str, set[str]]:
    """Every file for itself."""
    return {name: {name} for name in names}


def all_together(names: Iterable[str]) -> dict[str, set[str]]:
    """One thing."""
    return {"all": set(names)}


def by_episode(names: Iterable[str]) -> dict[str, set[str]]:
    """A folder of the dataset is a thing; what lies beside it is one each."""
    things: dict[str, set[str]] = {}
    for name in names:
        things.setdefault("/".join(name.split("/")[:2]), set()).add(name)
    return things


def by_table(names: Iterable[str]) -> dict[str, set[str]]:
    """All tables of a comparison are a thing; its jobs' results and its recipe are one each."""
    things: dict[str, set[str]] = {"tables": set()}
    for name in names:
        alone = {"recordings", "entries", "recipe.json"} & set(name.split("/"))
        things.setdefault(name if alone else "tables", set()).add(name)
    return things


def _generated(root: Path) -> None:
    generate(["arena"], root / "data", episodes=2, seconds=1.0, scanner="ideal")


def _compared(*slams: str) -> Callable[[Path], object]:
    def call(root: Path) -> None:
        plan = Plan(
            slams=slams,
            scenes=("arena",),
            levels=(1.0,),
            seeds=(100,),
            seconds=2.0,
            scanner="noise",
        )
        make.carry_out(plan, root / "compared")

    return call


def _run(seconds: float, *, film: bool = False) -> Callable[[Path], object]:
    def call(root: Path) -> None:
        settings = {"scene": "arena", "seconds": seconds, "dynamism": 1.0, "seed": 1}
        outputs = Outputs(folder=root / "run", command="run", overwrite=True, film=film)
        on_scene(["shunting"], settings, outputs)

    return call


def _map(size: int) -> Callable[[Path], object]:
    values = np.full((size, size), 0.5, dtype=np.float32)
    raster = Raster(values=values, resolution_m=0.05 * size, T_map_origin=np.zeros(3))
    return lambda root: write_map(root / "maps" / "map", raster)


def _memory(root: Path) -> None:
    ShuntingSlam().save(root / "maps" / "map.npz")


def cases(*, film: bool = True) -> list[Case]:
    """Small ones of every command that leaves something."""
    run, maps = _run(1.0, film=film), _map(3)
    tables = _compared("odometry", "occupancy")
    return [
        Case(name="generate", call=_generated, things=by_episode, exact=True),
        Case(name="compare", call=tables, things=by_table),
        Case(
            name="compare, a SLAM more", call=tables, things=by_table, first=_compared("odometry")
        ),
        Case(name="run", call=run, things=all_together),
        Case(name="run --overwrite", call=run, things=all_together, first=_run(0.5)),
        Case(
            name="run --overwrite, names cannot be swapped", call=run, things=all_together,
            first=_run(0.5), exchange=False,
        ),
        Case(
            name="map, pgm and yaml", call=maps, things=all_together, opened=".yaml", exact=True
        ),
        Case(
            name="map, pgm and yaml, again", call=maps, things=all_together, first=_map(2),
            opened=".yaml", exact=True,
        ),
        Case(name="map, npz", call=_memory, things=each_alone, exact=True),
    ]  # fmt: skip


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
