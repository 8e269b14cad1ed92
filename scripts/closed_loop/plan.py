# SPDX-License-Identifier: Apache-2.0
"""What is to be driven, and the job that one run is."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import scenes
import sim
import slam
from scripts.closed_loop import runs
from scripts.comparison.plan import MAX_RUNS, Asked, Run
from scripts.imports import code_of
from scripts.jobs import Job
from scripts.names import file_name
from scripts.options import options_with
from sim.loop import LoopConfig
from slam.errors import InvalidValueError

RUNS = "runs"  # folder of the jobs' files
SCHEMA = 1  # of the tables of a drive
# "dynamism" is the level, as in ``scripts.comparison.entry``.
IDENTITY = ("scene", "dynamism", "seed", "slam")


@dataclass(frozen=True, kw_only=True)
class DrivePlan(Asked):
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
        world = {"scene": self.scene, "seed": seed, "laser": self.scanner}
        world |= self.levels_of.at(level) | options_with(self.crowd)
        goals = list(self.goals) if isinstance(self.goals, tuple) else self.goals
        run = Run(scene=self.scene, dynamism=level, seed=seed, axis=self.axis)
        return Job(
            name=f"{run.name}_{file_name(name)}",
            call=runs.run_one,
            arguments={
                "world": world, "slam": name, "goals": goals or None, "loop": asdict(self.loop),
            },
            code=code_of(runs.run_one, sim, scenes, slam, slam=name, scene=self.scene),
        )  # fmt: skip
