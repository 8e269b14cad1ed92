# SPDX-License-Identifier: Apache-2.0
"""The job that one driven run is, and its file."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sim.loop import GoalResult, LoopConfig, LoopRun, closed_loop
from sim.loop.run import Tally, goal_order
from sim.simulation import Simulation
from slam.archives import read_arrays
from slam.errors import LogFormatError, SlamFailedError
from slam.guests import Limits, limited


def run_one(
    path: Path,
    *,
    world: Mapping[str, Any],
    slam: str,
    goals: list[str] | int | None,
    loop: Mapping[str, Any],
) -> None:
    """A job: one run, into ``path``. A SLAM that cannot be made has failed at every goal.

    world  as ``Simulation`` takes it;   loop  as ``LoopConfig``
    """
    simulation = Simulation(**world)
    try:
        system = limited(slam, Limits())
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
class DrivenRun:
    """A run read back: who and where, goals and the rest as ``LoopRun`` has them, arrays."""

    identity: Mapping[str, Any]
    goals: list[dict[str, Any]]
    rest: Mapping[str, Any]
    arrays: Mapping[str, Any]


def load(path: Path, identity: Mapping[str, Any]) -> DrivenRun:
    """What ``save`` wrote; ``LogFormatError`` for anything else."""
    arrays = read_arrays(path, (*_ARRAYS, "rest"))
    try:
        rest = json.loads(arrays.pop("rest").item())
        return DrivenRun(identity=identity, goals=rest.pop("goals"), rest=rest, arrays=arrays)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise LogFormatError(path, f"no run of a drive: {error}") from error
