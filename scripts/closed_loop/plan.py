# SPDX-License-Identifier: Apache-2.0
"""What is to be driven, the job that one run is, and its file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

import scenes
import sim
import slam
from scripts.comparison.plan import MAX_RUNS, Asked, Run
from scripts.imports import code_of
from scripts.jobs import Job
from scripts.names import file_name
from scripts.options import options_with
from sim.loop import GoalResult, LoopConfig, LoopRun, closed_loop
from sim.loop.run import Tally, goal_order
from sim.simulation import Simulation
from slam.archives import read_arrays
from slam.errors import InvalidValueError, LogFormatError, SlamFailedError
from slam.guests import Limits, limited


def run_one(  # noqa: PLR0913 (the arguments of a job)
    path: Path,
    *,
    scene: str,
    room: Mapping[str, Any],
    seed: int,
    slam: str,
    goals: list[str] | int | None,
    loop: Mapping[str, Any],
    laser: str = "full",
) -> None:
    """A job: one run, into ``path``. A SLAM that cannot be made has failed at every goal.

    room  dynamism, motion, change and crowd, as ``Simulation`` takes them
    """
    simulation = Simulation(scene, seed=seed, laser=laser, **room)
    try:
        system = limited(slam, Limits(hidden=(path.parent.parent,)))
    except SlamFailedError as error:
        save(path, _failed(goal_order(simulation.world, goals), error))
        return
    run = closed_loop(simulation, system, config=LoopConfig(**loop), goals=goals, name=slam)
    save(path, run)


def _failed(goals: Sequence[str], error: SlamFailedError) -> LoopRun:
    """The run of a SLAM that never was."""
    return LoopRun(
        goals=tuple(
            GoalResult(goal=goal, outcome="failed", reason=error.outcome, tally=Tally())
            for goal in goals
        ),
        stamps_ns=np.zeros(0, dtype=np.int64),
        believed=np.zeros((0, 3)),
        true=np.zeros((0, 3)),
        commands=np.zeros((0, 2)),
        trusted=np.zeros(0, dtype=np.bool_),
        goal_of=np.zeros(0, dtype=np.int64),
        lost_s=None,
        found_s=None,
        failure=(error.outcome, str(error)),
    )


_ARRAYS = ("stamps_ns", "believed", "true", "commands", "trusted", "goal_of")


def save(path: Path, run: LoopRun) -> None:
    """Arrays as they are, goals and the rest as JSON."""
    arrays = {name: getattr(run, name) for name in _ARRAYS}
    rest = {f.name: getattr(run, f.name) for f in fields(run) if f.name not in _ARRAYS}
    rest["goals"] = [asdict(goal) for goal in run.goals]
    np.savez_compressed(path, **arrays, rest=np.array(json.dumps(rest)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Driven:
    """A run read back: who and where, goals and the rest as ``LoopRun`` has them, arrays."""

    identity: Mapping[str, Any]
    goals: list[dict[str, Any]]
    rest: Mapping[str, Any]
    arrays: Mapping[str, Any]


def load(path: Path, identity: Mapping[str, Any]) -> Driven:
    """What ``save`` wrote; ``LogFormatError`` for anything else."""
    arrays = read_arrays(path, (*_ARRAYS, "rest"))
    try:
        rest = json.loads(arrays.pop("rest").item())
        return Driven(identity=identity, goals=rest.pop("goals"), rest=rest, arrays=arrays)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise LogFormatError(path, f"no run of a drive: {error}") from error


RUNS = "runs"  # folder of the jobs' files
SCHEMA = 1  # of the tables of a drive
# "dynamism" is the level, as in ``scripts.comparison.entry``.
IDENTITY = ("scene", "dynamism", "seed", "slam")


@dataclass(frozen=True, kw_only=True)
class Plan(Asked):
    """Every SLAM in the same worlds: at every level, with every seed.

    goals    names, or how many of the seed's order; () is all
    """

    scene: str
    goals: tuple[str, ...] | int = ()
    loop: LoopConfig = field(default_factory=LoopConfig)

    def __post_init__(self) -> None:
        self.levels_of.at(0.0)  # complains of an axis that cannot be
        self.check_each_once("slams", "levels", "seeds")
        if any(not 0.0 <= level <= 1.0 for level in self.levels):
            raise InvalidValueError(f"--{self.axis} must lie in [0, 1], got {self.levels}")
        if min(self.seeds) < 0:
            raise InvalidValueError(f"--seeds must be >= 0, got {self.seeds}")
        if isinstance(self.goals, int) and self.goals < 1:
            raise InvalidValueError(f"--goals must be names or a number >= 1, got {self.goals}")
        if len(self.slams) * len(self.levels) * len(self.seeds) > MAX_RUNS:
            raise InvalidValueError(f"at most {MAX_RUNS} runs can be driven at once")

    def jobs(self) -> Iterator[tuple[dict[str, Any], Job]]:
        """Identity and job of each run, SLAM by SLAM within a seed, seeds within a level."""
        for level in self.levels:
            for seed in self.seeds:
                for name in self.slams:
                    identity = (self.scene, level, seed, name)
                    yield dict(zip(IDENTITY, identity, strict=True)), self._job(level, seed, name)

    def _job(self, level: float, seed: int, name: str) -> Job:
        room = self.levels_of.at(level) | options_with(self.crowd)
        goals = list(self.goals) if isinstance(self.goals, tuple) else self.goals
        run = Run(scene=self.scene, dynamism=level, seed=seed, axis=self.axis)
        return Job(
            name=f"{run.name}_{file_name(name)}",
            call=run_one,
            arguments={
                "scene": self.scene, "room": room, "seed": seed, "slam": name,
                "goals": goals or None, "loop": asdict(self.loop), "laser": self.scanner,
            },
            code=code_of(run_one, sim, scenes, slam, slam=name, scene=self.scene),
        )  # fmt: skip
