# SPDX-License-Identifier: Apache-2.0
"""The power cut at every step of a command, and what is on the disk then."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scripts.output import READY
from scripts.robustness.disk_log import Cut, DiskLog, State, put_down, tree
from scripts.robustness.timeless import timeless
from slam import files, locks

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
        if one != two and (case.exact or timeless(name, one) != timeless(name, two)):
            return f"{name} differs"
    return ""
