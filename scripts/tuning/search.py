# SPDX-License-Identifier: Apache-2.0
"""The search: trial after trial on the training seeds of a track, by Optuna's TPE sampler.

Every run is a job on file, and the sampler has a seed: a search that was killed asks for the same
trials again and finds them done.
"""

import json
import math
import time
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from msgspec import to_builtins

from scripts import engine, pace
from scripts.benchmark.tracks import Track
from scripts.comparison.plan import Plan
from scripts.console import progress
from scripts.engine import Stage
from scripts.jobs import Job
from scripts.options import whole
from scripts.tuning.run import run
from scripts.tuning.space import Space, defaults, variant
from slam.archives import read_arrays
from slam.bounded import json_of
from slam.errors import needed
from slam.files import write_text
from slam.shaped import within

SEED = 1  # of the sampler
SIDE_BY_SIDE = 5  # runs of a trial before it is asked whether it can still win, whatever --jobs is
MOST_AGAIN = 100  # proposals in a row that were tried before: the space has no others
RESERVE = 2.0  # times the time that judging is expected to take
RUNS, JUDGED = "search", "judged"  # folders: of the search, of a comparison on fresh seeds
SPENT = "spent.json"  # s of earlier calls, by task


@dataclass(frozen=True, kw_only=True)
class Task:
    """What is tuned, and where.

    level    one of the track's
    seeds    of the search: of the track's training seeds the first
    minutes  for all of it; how long the search is follows from it
    trials   at most; None: as many as there is time for
    seconds  of a run, in place of the track's own, to try out
    """

    slam: str
    space: Space
    track: Track
    level: float
    seeds: int
    minutes: float = 30.0
    trials: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        within("--minutes", self.minutes, 0.0, 1e5)
        whole("--seeds", self.seeds, 2, len(self.track.train))
        if self.trials is not None:
            whole("--trials", self.trials, 1, 100_000)
        self.plan((self.slam,), self.track.train)  # complains of the level

    def plan(self, slams: Sequence[str], seeds: Sequence[int]) -> Plan:
        """The runs of these SLAMs alone."""
        plan = self.track.plan(slams, tuple(seeds), levels=(self.level,), seconds=self.seconds)
        return replace(plan, slams=tuple(slams))

    def runs(self, slam: str, seeds: Sequence[int]) -> dict[int, Job]:
        """Those of one SLAM in the search, by seed."""
        return {one.seed: job for one, _, job in self.plan((slam,), seeds).entries(run)}

    def settings(self) -> dict[str, Any]:
        """For a recipe."""
        return {
            "slams": [self.slam], "space": to_builtins(self.space), "track": self.track.name,
            "level": self.level, "seeds": self.seeds, "seconds": self.seconds,
            "minutes": self.minutes, "trials": self.trials,
        }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One set of numbers, and the scores of its runs (``scripts.tuning.run``) by training seed.

    value  what the sampler is told: the mean, unseen seeds as with the numbers of before
    """

    name: str
    numbers: Mapping[str, Any]
    scores: Mapping[int, float]
    lost: int
    stopped: bool
    value: float


class Clock:
    """How much time is left, what earlier calls on the same task took counted."""

    def __init__(self, out: Path, task: Task) -> None:
        told = {k: v for k, v in task.settings().items() if k not in ("minutes", "trials")}
        self._path, self._key = out / SPENT, json.dumps(told, sort_keys=True)
        self._known = json_of(self._path, 1 << 20, "time") if self._path.exists() else {}
        before = within(f"{self._path}: time", self._known.get(self._key, 0.0), 0.0, 1e9)
        self._since = time.monotonic() - before
        self.limit_s = 60.0 * task.minutes

    def spent_s(self) -> float:
        """s; noted on file."""
        spent = time.monotonic() - self._since
        write_text(self._path, json.dumps({**self._known, self._key: round(spent, 1)}) + "\n")
        return spent


class Search:
    """Trials by the names of their variants; the first is the SLAM as it was named.

    Raises ``MissingDependencyError`` without Optuna.
    """

    def __init__(self, task: Task, out: Path, jobs: int) -> None:
        self.task, self.out, self.jobs = task, out, jobs
        self.clock = Clock(out, task)
        self._seeds = list(task.track.train[: task.seeds])
        recordings, _ = task.plan((task.slam,), self._seeds).stages()
        engine.make([recordings], out, jobs=jobs)
        first = self._run(task.slam, {}, "running it as it is")
        assert first is not None
        self.first, self.trials = first, {first.name: first}
        self._study, self._distributions = _study(task, first)
        # Where the SLAM does worst now, another shows soonest whether it is better.
        self._seeds.sort(key=lambda seed: -first.scores[seed])

    @property
    def best(self) -> Trial:
        """Of those that ran on all seeds; of equals the first."""
        return min((t for t in self.trials.values() if not t.stopped), key=lambda t: t.value)

    def go_on(self) -> None:
        """As long as there is time to judge besides, and the space has other trials."""
        most, again = self.task.trials or math.inf, 0
        self._end_s = self.clock.limit_s - RESERVE * self._judging_s()
        with progress() as bar:
            now = self.clock.spent_s()
            shown = bar.add_task("searching", total=self._end_s, unit="", before=now)
            while len(self.trials) <= most and again < MOST_AGAIN:
                asked = self._study.ask(self._distributions)
                numbers = {k: one.rounded(asked.params[k]) for k, one in self.task.space.items()}
                name = variant(self.task.slam, numbers)
                again = again + 1 if name in self.trials else 0
                trial = self.trials.get(name) or self._run(name, numbers)
                if trial is None:
                    break
                self.trials[name] = trial
                self._study.tell(asked, trial.value)
                unit = f"{len(self.trials) - 1} trials, lost {self.best.lost} of {len(self._seeds)}"
                bar.update(shown, completed=self.clock.spent_s(), unit=unit)
            bar.update(shown, total=0.0)

    def _judging_s(self) -> float:
        """What judging two SLAMs on the fresh seeds is expected to take; 0 where nobody knows."""
        plan, folder = self.task.plan((self.task.slam,), self.task.track.test), self.out / JUDGED
        recordings, entries = (stage.missing(folder) for stage in plan.stages())
        works = [job.work() for job in (*recordings, *entries, *entries)]
        return pace.estimate(works, self.jobs) or 0.0

    def _run(self, name: str, numbers: Mapping[str, Any], title: str = "") -> Trial | None:
        """A trial, some seeds at a time, the first whole; None where time ends before it does."""
        scores: dict[int, float] = {}
        lost, first = 0, bool(title)
        at_once = len(self._seeds) if first else SIDE_BY_SIDE
        for k in range(0, len(self._seeds), at_once):
            jobs = self.task.runs(name, self._seeds[k : k + at_once])
            stage = Stage(title=title, folder=RUNS, jobs=list(jobs.values()))
            if not first and self.clock.spent_s() > self._end_s and stage.missing(self.out):
                return None
            files = engine.make([stage], self.out, jobs=self.jobs)
            for seed, job in jobs.items():
                found = read_arrays(files[job.name])
                scores[seed] = float(found["score"])
                lost += int(found["lost"])
            if not first and sum(scores.values()) >= sum(self.best.scores.values()):
                break
        unseen = [seed for seed in self._seeds if seed not in scores]
        total = sum(scores.values()) + sum(self.first.scores[seed] for seed in unseen)
        return Trial(
            name=name, numbers=numbers, scores=scores, lost=lost, stopped=bool(unseen),
            value=total / len(self._seeds),
        )  # fmt: skip


def _study(task: Task, first: Trial) -> tuple[Any, dict[str, Any]]:
    """Optuna's study, which knows the first trial where it lies in the space; what it varies."""
    optuna = needed("optuna", "optuna", "tune")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the sampler is "experimental", of some versions
        sampler = optuna.samplers.TPESampler(seed=SEED, multivariate=True)
    study = optuna.create_study(sampler=sampler)
    varied = {path: one.distribution(optuna.distributions) for path, one in task.space.items()}
    known = {"params": defaults(task.slam, task.space), "distributions": varied}
    with suppress(ValueError):  # of numbers that lie outside, or do not say what they are
        study.add_trial(optuna.trial.create_trial(**known, value=first.value))
    return study, varied
