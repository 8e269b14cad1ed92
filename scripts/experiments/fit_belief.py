# SPDX-License-Identifier: Apache-2.0
"""The belief, fitted on real logs: ``python -m scripts.experiments.fit_belief --data DATA``.

A logistic regression tells right poses from wrong ones (``explained``) by ``belief.slope``,
``known`` and ``new``. Each log is judged by the numbers that logs of other buildings give. Right
and wrong weigh alike, and so do logs.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from copy import copy
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, log_expit

from scripts.console import ended
from scripts.experiments import along_log, explained
from scripts.experiments.explained import GOES_ON, PLACE, Sample
from scripts.experiments.real_logs import LOGS, unpacked
from scripts.jobs import Job, run_jobs
from scripts.marks import SUM, fill_page, table
from scripts.result_files import ROOT
from slam.shaped import one_of
from slam.tracker.belief.config import BeliefConfig
from slam.tracker.belief.likelihood import ENDS

NAMES = ("slope", "known", "new")
SURE = 0.99  # places are taken that are likelier
BINS = (0.0, 0.01, 0.1, 0.5, 0.9, SURE, 1.0)
RIDGE = 1e-4  # numerical guard, where all is told apart
COLUMNS = ("log", "kind", "right", "wrong", "log loss", f"p > {SURE:g}", "of these right")
Array = NDArray[np.float64]


class Samples:
    """Of some logs as arrays.

    log, building, kind  words; ``right``: the label, ``weight`` that of the sample
    x                    (n, 3) that ``NAMES`` are multiplied by
    """

    def __init__(self, logs: dict[str, list[Sample]]) -> None:
        rows = [(log, *sample) for log, own in logs.items() for sample in own]
        self.log, self.kind = (np.array([row[k] for row in rows], dtype=str) for k in (0, 1))
        folders = {log: str(Path(LOGS[log].file).parent) for log in logs}
        self.building = np.array([folders[row[0]] for row in rows], dtype=str)
        share = np.clip([row[2] for row in rows], 0.0, 1.0)
        self.right = np.array([row[3] for row in rows], dtype=bool)
        logit = np.log((share + ENDS) / (1.0 + ENDS - share))
        # told(r) is slope x + known, told(s) is slope x + known - new
        self.x = np.column_stack([logit, np.ones(len(rows)), -1.0 * (self.kind == PLACE)])
        keys = list(zip(self.log.tolist(), self.kind.tolist(), self.right.tolist(), strict=True))
        self.weight = np.array([1.0 / keys.count(key) for key in keys])

    def of(self, which: NDArray[np.bool_]) -> "Samples":
        """Those of them."""
        other = copy(self)
        vars(other).update({name: value[which] for name, value in vars(self).items()})
        return other


def fitted(samples: Samples) -> Array:
    """Slope, known and new, nats."""
    sign = np.where(samples.right, 1.0, -1.0)
    weight = samples.weight / samples.weight.sum()

    def loss(numbers: Array) -> tuple[float, Array]:
        z = sign * (samples.x @ numbers)
        slopes = samples.x.T @ (weight * sign * expit(-z))
        more = RIDGE * float(numbers @ numbers)
        return more - float(weight @ log_expit(z)), 2.0 * RIDGE * numbers - slopes

    return np.asarray(minimize(loss, np.array([1.0, 0.0, 0.0]), jac=True).x)


def judged(log: str, kind: str, samples: Samples, p: Array) -> list[str]:
    """A row: how well these probabilities tell right from wrong."""
    own = samples.kind == kind
    if log != SUM:
        own &= samples.log == log
    right, weight, sure = samples.right[own], samples.weight[own], p[own] > SURE
    told = np.where(right, p[own], 1.0 - p[own])
    loss, share = mean(-np.log(told), weight), mean(right[sure].astype(np.float64), weight[sure])
    return [log, kind, *map(str, (right.sum(), (~right).sum())), loss, str(sure.sum()), share]


def reliability(samples: Samples, p: Array) -> str:
    """A table: of what is believed at p, which share is right."""
    rows = []
    for low, high in pairwise(BINS):
        cells = [f"{low:g} to {high:g}"]
        for kind in (PLACE, GOES_ON):
            own = (samples.kind == kind) & (p > low) & (p <= high)
            weight, right = samples.weight[own], samples.right[own].astype(np.float64)
            cells += [str(int(own.sum())), mean(p[own], weight), mean(right, weight)]
        rows.append(cells)
    heads = (f"{kind}: {what}" for kind in (PLACE, GOES_ON) for what in ("n", "p", "right"))
    return table(["p", *heads], rows)


def mean(values: Array, weights: Array) -> str:
    """Weighted; a dash of none."""
    return f"{float(np.average(values, weights=weights)):.4f}" if len(values) else "–"


def left_out(samples: Samples) -> tuple[Array, Array]:
    """Of each sample p, by the numbers that other buildings give; those numbers (n, 3)."""
    p, found = np.zeros(len(samples.right)), []
    for building in np.unique(samples.building):
        own = samples.building == building
        found.append(fitted(samples.of(~own) if not own.all() else samples))
        p[own] = expit(samples.x[own] @ found[-1])
    return p, np.array(found)


def told(logs: dict[str, list[Sample]]) -> str:
    """All tables."""
    samples, now = Samples(logs), [getattr(BeliefConfig(), name) for name in NAMES]
    numbers, (p, others) = fitted(samples), left_out(samples)
    ranges = np.column_stack([numbers, others.min(axis=0), others.max(axis=0)])
    settings = [
        [f"`belief.{name}`", *(f"{v:.2f}" for v in of), f"{now[k]:g}"]
        for k, (name, of) in enumerate(zip(NAMES, ranges, strict=True))
    ]
    lines = [judged(log, kind, samples, p) for log in (*logs, SUM) for kind in (PLACE, GOES_ON)]
    of_config = expit(samples.x @ now)
    for kind in (PLACE, GOES_ON):
        lines.append([f"{SUM}, as in the SLAM", *judged(SUM, kind, samples, of_config)[1:]])
    parts = (
        table(["nats", "fitted", "a building left out: least", "most", "in the SLAM"], settings),
        table(COLUMNS, lines, left=2),
        reliability(samples, p),
    )
    return "\n\n".join(parts)


def options() -> argparse.ArgumentParser:
    """Of the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with the folders of logs")
    parser.add_argument("--logs", nargs="+", default=list(LOGS), metavar="NAME")
    parser.add_argument("--scans", type=int, default=60, help="asked of each log, about")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("out/fit_belief"))
    parser.add_argument("--page", type=Path, help="fill its marked place")
    return parser


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """The command: ask what is missing, fit, print the tables."""
    wanted = options().parse_args(arguments)
    jobs: dict[str, Job] = {}
    for name in wanted.logs:
        one_of("--logs", name, LOGS)
        file = unpacked(wanted.data / LOGS[name].file, wanted.out / "unpacked")
        of = {"log": asdict(LOGS[name]), "file": str(file), "data": str(wanted.data)}
        jobs[name] = Job(
            name=name, call=explained.sampled, arguments=of | {"scans": wanted.scans},
            suffix=".json",
            code=(ROOT / "slam", Path(explained.__file__), Path(along_log.__file__), file),
        )  # fmt: skip
    title = "asking real logs"
    files = run_jobs(jobs.values(), wanted.out, processes=wanted.jobs, title=title)
    logs = {name: json.loads(files[job.name].read_text()) for name, job in jobs.items()}
    text = told({name: [tuple(one) for one in own] for name, own in logs.items()})
    print(text)
    if wanted.page:
        fill_page(wanted.page, "fit", text)


if __name__ == "__main__":
    sys.exit(main())
