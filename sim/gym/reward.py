# SPDX-License-Identifier: Apache-2.0
"""What a step is worth: three rewards for a robot that is to reach a goal. All go by the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.gym.goals import GOAL_RADIUS_M, Goal, Ground, Way

REWARDS = ("progress", "sparse", "shaped")
GOAL_BONUS = 10.0  # "shaped": once, for reaching the goal
COLLISION_COST = 5.0  # "shaped": of a step with a hard contact
TIME_COST_PER_S = 0.1  # "shaped": of each second, so that standing still is no good


@dataclass
class Task:
    """One goal of one episode.

    kind      one of ``REWARDS``
    distance  m from the robot to the goal in a straight line, as it was told last
    """

    goal: Goal
    kind: str
    ground: Ground
    distance: float = math.inf
    _way: Way | None = None
    _left: float = math.inf

    def begin(self, x: float, y: float) -> None:
        """The robot starts at (x, y) m."""
        self.distance = self._distance(x, y)
        if self.kind == "shaped":
            self._way = self.ground.way(self.goal)
            self._left = self._way.left(x, y)

    def reached(self, x: float, y: float) -> bool:
        """Whether a robot at (x, y) m is at its goal."""
        return self._distance(x, y) < GOAL_RADIUS_M

    def reward(self, x: float, y: float, *, hard: bool, seconds: float) -> float:
        """Of a step of ``seconds`` that ended at (x, y) m, with a hard contact or without."""
        before, self.distance = self.distance, self._distance(x, y)
        reached = self.distance < GOAL_RADIUS_M
        if self._way is None:
            return float(reached) if self.kind == "sparse" else before - self.distance
        old, self._left = self._left, self._way.left(x, y)
        progress = old - self._left if math.isfinite(old) else 0.0
        bonus, cost = GOAL_BONUS * reached, COLLISION_COST * hard
        return progress + bonus - cost - TIME_COST_PER_S * seconds

    def _distance(self, x: float, y: float) -> float:
        return math.hypot(x - self.goal[0], y - self.goal[1])
