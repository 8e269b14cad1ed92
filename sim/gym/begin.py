# SPDX-License-Identifier: Apache-2.0
"""The room of one episode, built up to its first scan: here, or ahead of time on another thread."""

from concurrent.futures import Future
from dataclasses import dataclass

from sim.core.seeds import Seeds
from sim.gym.goals import Goal, Ground, Task
from sim.gym.options import Episode
from sim.sensors.lidar.device import ScanResult
from sim.simulation import Simulation
from sim.world.world import World
from slam.frames import Float


@dataclass(frozen=True, eq=False)
class Begun:
    """A room at the start of an episode.

    start  (x m, y m, heading rad) of the robot before the first scan
    scan   the first, taken standing still
    """

    simulation: Simulation
    task: Task | None
    start: Float
    scan: ScanResult


def begun(plan: Episode, seed: int, reward: str) -> Begun:
    """Build that room; nothing outside it is read or changed, so any thread may."""
    simulation = Simulation(seed=Seeds(seed, **plan.seeds), **plan.settings)
    world = simulation.world
    task = _task_of(plan.goal, reward, world)
    start = world.robot_pose()
    simulation.live()
    scan = simulation.look()
    if task is not None:
        x, y, _ = world.robot_pose().tolist()
        task.begin(x, y)
    return Begun(simulation, task, start, scan)


def _task_of(goal: Goal | str | None, reward: str, world: World) -> Task | None:
    if goal is None:
        return None
    ground = Ground(world)
    if isinstance(goal, str):
        there = ground.drawn(world.seeds.generator("goals"))
    else:
        there = ground.checked(goal)
    return Task(there, reward, ground)


@dataclass(frozen=True, eq=False)
class Ahead:
    """The room of ``seed``, which is built somewhere else, or will be."""

    seed: int
    built: Future[Begun]

    def room(self, seed: int | None) -> Begun | None:
        """What was built, waited for where it is being built now.

        None where another is wanted, or it was not begun, or failed: whoever builds it again gets
        the same error where errors are expected.
        """
        if self.built.cancel() or seed != self.seed or self.built.exception() is not None:
            return None
        return self.built.result()
