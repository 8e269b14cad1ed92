# SPDX-License-Identifier: Apache-2.0
"""A search for who is to blame as a whole: the run again, the re-runs, the folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.progress import Progress

from scenes import groups
from scripts import interrupt
from scripts.console import note, progress
from scripts.debugger.counterfactual import Inquest, hold
from scripts.debugger.picture import blame_picture
from scripts.debugger.question import Question
from scripts.debugger.recording import Case, Tape, record, simulate
from scripts.debugger.words import as_json
from scripts.output import whole_folder, write_recipe
from slam.files import write_text

AGREES_M = 1e-5  # a trajectory on file is rounded


def carry_out(case: Case, question: Question, folder: Path, *, overwrite: bool) -> Inquest:
    """Find who is to blame and write the folder."""
    recipe = _recipe(case, question)
    with whole_folder(folder, overwrite=overwrite, command="blame", settings=recipe) as part:
        found = _inquest(case, question)
        blame_picture(part / "blame.png", found)
        text = json.dumps(as_json(found), indent=1, allow_nan=False)
        write_text(part / "blame.json", text + "\n")
        write_recipe(part, "blame", recipe)
    return found


def _inquest(case: Case, question: Question) -> Inquest:
    if question.who:  # told before the run
        movers = simulate(case).world.scene.movers
        for word in question.who:
            groups.named(movers, word)
    with progress() as bar:
        tape = record(case, _Bar(bar, "driving").scans)
        _compare(tape)
        return hold(tape, question, _Bar(bar, "re-runs").trials)


class _Bar:
    """One line of the progress."""

    def __init__(self, bar: Progress, words: str) -> None:
        self._bar = bar
        self._task = bar.add_task(words, total=None, unit="")

    def scans(self, done: int, of: int) -> None:
        """Scans of the original."""
        interrupt.check()
        if done % 25 == 0 or done == of:
            self._bar.update(self._task, completed=done, total=of, unit=f"{done}/{of} scans")

    def trials(self, what: str, done: int, of: int) -> None:
        """A re-run begins."""
        interrupt.check()
        words = what if len(what) < 50 else "all movers"
        self._bar.update(self._task, completed=done, total=of, unit=escape(words))


def _compare(tape: Tape) -> None:
    """Say so where the run on file was another one."""
    case = tape.case
    if case.made is not None and case.made.elsewhere():
        note(f"the episode was made elsewhere: {case.made.elsewhere()}")
    recorded, again = case.recorded, np.array(tape.strip.believed)
    if recorded is None:
        return
    if recorded.shape != again.shape:
        note(f"of {case.slam} {len(recorded)} poses are on file, the run again has {len(again)}")
        return
    gap = float(np.abs(recorded[:, :2] - again[:, :2]).max())
    if gap > AGREES_M:
        note(f"run again, {case.slam} is up to {gap:.3g} m elsewhere: other versions or CPU?")


def _recipe(case: Case, question: Question) -> dict[str, Any]:
    """What makes it again."""
    settings = {k: repr(v) if k == "laser" else v for k, v in case.settings.items()}
    asked = {f"asked_{k}": v for k, v in vars(replace(question)).items() if k != "rule"}
    rule = {f"rule_{k}": v for k, v in vars(question.rule).items()}
    own = {"slam": case.slam, "seconds": case.seconds, "every": case.every}
    return {**own, "simulation": settings, **asked, **rule}
