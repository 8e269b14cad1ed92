# SPDX-License-Identifier: Apache-2.0
"""A search as a whole: trials, the best on fresh seeds beside the SLAM as it was, the folder."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table

from scripts.comparison import make as comparison
from scripts.comparison.tables import write_csv
from scripts.console import plain_table
from scripts.figures import INK, MUTED, color_of, save, styled
from scripts.jobs import try_names
from scripts.machine import machine
from scripts.output import plain, result_folder
from scripts.report.answer import ODOMETRY
from scripts.tuning.search import JUDGED, Search, Task, Trial
from scripts.tuning.space import defaults
from scripts.tuning.verdict import Verdict, judge
from slam.errors import needed
from slam.files import write_text

COMMAND = "tune"


@dataclass(frozen=True, kw_only=True)
class Tuned:
    """What came of it; ``verdict`` None where no trial did better on the training seeds."""

    task: Task
    trials: Sequence[Trial]
    best: Trial
    verdict: Verdict | None

    @property
    def said(self) -> list[str]:
        """Sentences, the result first."""
        n, stopped = len(self.trials) - 1, sum(one.stopped for one in self.trials)
        first, of = self.trials[0], self.task.seeds
        at_most = f" of {self.task.trials}" if self.task.trials else ""
        searched = (
            f"{n}{at_most} trials on {of} training seeds, {stopped} of them stopped early: lost in "
            f"{self.best.lost} of {of} instead of {first.lost}."
        )
        if self.verdict is None:
            none = "fitted into the time" if n == 0 else "was better on the training seeds"
            return [f"No gain: no trial {none}.", *([searched] if n else [])]
        (before, after), alone = self.verdict.ms, self.verdict.odometry_lost
        was = f", before {before:.1f}" if math.isfinite(before) else ""  # it failed in all runs
        control = f"Odometry alone is lost in {alone} of {self.verdict.runs}."
        cost = f"A scan takes {after:.1f} ms{was}."
        return [self.verdict.sentence, searched, control, cost]


def carry_out(task: Task, out: Path, *, jobs: int = 1) -> Tuned:
    """Search, judge, write the folder; what is there already is not made again.

    Raises ``MissingDependencyError`` without Optuna, and as ``scripts.engine.refuse``.
    """
    needed("optuna", "optuna", "tune")
    try_names([task.slam], [task.track.scene])
    settings = {**task.settings(), "machine": machine()}
    with result_folder(out, COMMAND, settings) as written:
        search = Search(task, out.absolute(), jobs)
        search.go_on()
        best, verdict = search.best, None
        if best.name != task.slam:
            plan = task.plan((task.slam, best.name, ODOMETRY), task.track.test)
            rows = comparison.carry_out(plan, out / JUDGED, jobs=jobs)
            verdict = judge(rows, task.slam, best.name)
        found = list(search.trials.values())
        tuned = Tuned(task=task, trials=found, best=best, verdict=verdict)
        with written() as folder:
            _write(folder, tuned)
    return tuned


def _write(folder: Path, tuned: Tuned) -> None:
    columns = ("trial", "stopped", "seeds", "lost", "score", *tuned.task.space)
    rows = [
        {"trial": k, "stopped": int(one.stopped), "seeds": len(one.scores), "lost": one.lost,
         "score": one.value, **one.numbers}
        for k, one in enumerate(tuned.trials)
    ]  # fmt: skip
    write_csv(folder / "trials.csv", rows, columns)
    picture(folder / "trials.png", tuned)
    told = {
        "slam": tuned.task.slam, "best": tuned.best.name, "numbers": tuned.best.numbers,
        "said": tuned.said, "fresh": None if tuned.verdict is None else asdict(tuned.verdict),
    }  # fmt: skip
    text = json.dumps(plain(told), indent=1, allow_nan=False, ensure_ascii=False)
    write_text(folder / "tune.json", text + "\n")


def numbers_table(tuned: Tuned) -> Table:
    """What each number was, what was found, and where it was searched."""
    table = plain_table("")
    for head in ("number", "before", "found", "searched"):
        table.add_column(head, justify="left" if head == "number" else "right", overflow="fold")
    before = defaults(tuned.task.slam, tuned.task.space)
    for path, one in tuned.task.space.items():
        among = (", " if one.choices else " to ").join(map(str, one.ends))
        table.add_row(escape(path), f"{before.get(path, '')}", f"{tuned.best.numbers[path]}", among)
    return table


@styled()
def picture(path: Path, tuned: Tuned) -> None:
    """The score of every trial, those that were stopped hollow, and the best so far."""
    figure = Figure(figsize=(8.0, 3.6))
    ax = figure.subplots()
    tint, of = color_of(tuned.task.slam, [tuned.task.slam]), tuned.task.seeds
    best, steps = math.inf, list[float]()
    for one in tuned.trials:
        best = best if one.stopped else min(best, one.value)
        steps.append(best)
    for stopped, words in ((False, "on all seeds"), (True, "stopped: cannot be the best any more")):
        points = [(k, one.value) for k, one in enumerate(tuned.trials) if one.stopped == stopped]
        look: dict[str, Any] = {"mfc": "none", "alpha": 0.5} if stopped else {"mfc": tint}
        ax.plot(*np.array(points).reshape(-1, 2).T, "o", ms=4.5, mec=tint, label=words, **look)
    ax.step(range(len(steps)), steps, where="post", color=INK, lw=1.4, label="best so far")
    first, task, last = tuned.trials[0], tuned.task, tuned.best
    words = f"as it was: lost {first.lost} of {of}"
    ax.axhline(first.value, color=MUTED, lw=1.0, ls="--", label=words)
    at = tuned.trials.index(last)
    side, ha = (6, "left") if 2 * at < len(steps) else (-6, "right")
    ax.annotate(f"lost {last.lost} of {of}", (at, last.value), xytext=(side, 6), ha=ha,
                textcoords="offset points", color=INK)  # fmt: skip
    ax.set(xlabel="trial", ylabel="score on the training seeds\n(m if held, 1 to 2 if lost)",
           title=f"{task.slam}: {task.track.name} at level {task.level:g}")  # fmt: skip
    ax.set_ylim(bottom=0.0)
    ax.locator_params(axis="x", integer=True)
    ax.legend(frameon=False, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.2))
    save(figure, path)
