# SPDX-License-Identifier: Apache-2.0
"""Goals of an environment, on floor that the robot can reach, and what a step towards one is worth.

There are three rewards for a robot that is to reach a goal. All go by the truth.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta

from sim.driving.navgrid import NavGrid
from sim.world.kidnapping import hull_discs
from sim.world.world import World
from slam.errors import InvalidValueError
from slam.frames import Float
from slam.shaped import shaped

GOAL_RADIUS_M = 0.4  # m from the goal at which it counts as reached
FAR_M = 1e4  # m, of a goal from the world's origin: the observation space tells no more
RANDOM = "random"
NEAR_M = 1.5  # m in a straight line from the start to a random goal, at least
WAY_M = 15.0  # m of way from the start to a random goal, at most; those near walls count up to 3
ROOM_M = 0.1  # m beside the robot that stands at a random goal, at least
_AJAR_M = 0.03  # m, half the thickness of a door's leaf
_BLOCKED = 1e6  # cost of a cell that cannot be reached (``NavGrid.cost_to``)

Goal = tuple[float, float]
_Near = Annotated[float, Meta(ge=-FAR_M, le=FAR_M)]  # m


def goal_of(name: str, value: Any) -> Goal | str | None:
    """None, "random" or (x, y) m, both finite and within 10 km; else ``InvalidValueError``."""
    goal: Goal | str | None = shaped(name, value, Literal["random"] | tuple[_Near, _Near] | None)
    return goal


class Ground:
    """The floor of a world that has just been built, and the way from its robot to a goal."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._radius = float(world.scene.movers[-1].radius)
        self._start = world.robot_pose()
        self.layout = NavGrid(world.scene.bounds, world.scene.obstacles, self._radius)

    def checked(self, goal: Goal) -> Goal:
        """``goal``, where the robot can get to on the static layout, shut doors left aside.

        Raises ``InvalidValueError`` with the nearest free place for one elsewhere.
        """
        grid = self.layout
        ways = grid.cost_to(self._start[:2])
        if grid.cost_near(ways, *goal) < _BLOCKED:
            return goal
        points, free = _centres(grid), (ways < _BLOCKED) & (grid.clearance >= self._radius)
        gaps = np.where(free, np.hypot(points[..., 0] - goal[0], points[..., 1] - goal[1]), np.inf)
        x, y = points[np.unravel_index(int(np.argmin(gaps)), gaps.shape)].tolist()
        nearest = f"; the nearest is ({x:.2f}, {y:.2f})" if free.any() else ""
        raise InvalidValueError(
            f"goal ({goal[0]:g}, {goal[1]:g}) does not lie on free floor that the robot can reach "
            f"from ({self._start[0]:.2f}, {self._start[1]:.2f}){nearest}"
        )

    def drawn(self, rng: np.random.Generator) -> Goal:
        """A goal evenly over the floor that the robot can reach as everything stands now.

        At least ``NEAR_M`` away and at most ``WAY_M`` of way, with ``ROOM_M`` beside the robot and
        out of the swing of doors. Where a room is too small or too full for that, the farthest
        tenth of the floor that can be reached takes its place. ``InvalidValueError`` where the
        robot cannot go anywhere.
        """
        discs = hull_discs(self._world)
        points = _centres(self.layout)
        away = np.hypot(points[..., 0] - self._start[0], points[..., 1] - self._start[1])
        for things in (self._things(), np.zeros((0, 5))):
            grid = self.layout.with_boxes(things)
            ways = grid.cost_to(self._start[:2])
            free = (ways < _BLOCKED) & (grid.clearance >= self._radius + ROOM_M)
            for x, y, radius in discs.tolist() if len(things) else ():
                gap = np.hypot(points[..., 0] - x, points[..., 1] - y) - radius
                free &= gap >= self._radius + ROOM_M
            fit = free & (away >= NEAR_M) & (ways <= WAY_M)
            if not fit.any() and free.any():
                fit = free & (away >= np.quantile(away[free], 0.9))
            if fit.any():
                at = np.argwhere(fit)
                i, j = at[int(rng.integers(len(at)))]
                x, y = points[i, j].tolist()
                return x, y
        raise InvalidValueError(
            f"scene '{self._world.scene.name}' has no floor for a random goal that the robot can "
            f"reach from ({self._start[0]:.2f}, {self._start[1]:.2f})"
        )

    def _things(self) -> Float:
        """(k, 5) boxes as large as everything that stands about, and the leaves of doors."""
        rows = []
        for mover, (x, y, yaw) in zip(
            self._world.scene.movers, self._world.mover_poses().tolist(), strict=True
        ):
            if mover.group == "door":
                half = 0.5 * float(mover.radius)
                rows.append(
                    (x + half * math.cos(yaw), y + half * math.sin(yaw), half, _AJAR_M, yaw)
                )
        for x, y, radius in hull_discs(self._world, doors=False).tolist():
            half = 0.5 * math.sqrt(math.pi) * radius  # of a square as large as the disc
            rows.append((x, y, half, half, 0.0))
        return np.array(rows, dtype=np.float64).reshape(-1, 5)


class Way:
    """m of way to a goal on the static layout, those near walls counted up to three times."""

    def __init__(self, grid: NavGrid, goal: Goal) -> None:
        self._grid, self._centres = grid, _centres(grid)
        self._costs = grid.cost_to(np.array(goal))
        self._left = math.inf

    def left(self, x: float, y: float) -> float:
        """From (x, y); where nothing can be told there, what was told last."""
        near = self._grid.around(x, y)
        costs, centres = self._costs[near].ravel(), self._centres[near].reshape(-1, 2)
        known = costs < _BLOCKED
        ways = [
            cost + math.hypot(cx - x, cy - y)
            for cost, (cx, cy) in zip(costs[known].tolist(), centres[known].tolist(), strict=True)
        ]
        self._left = min(ways, default=self._left)
        return self._left


def _centres(grid: NavGrid) -> Float:
    """(rows, columns, 2) m of the middles of the cells."""
    rows, columns = grid.clearance.shape
    x = grid.x0 + (np.arange(columns) + 0.5) * grid.cell
    y = grid.y0 + (np.arange(rows) + 0.5) * grid.cell
    return np.stack(np.meshgrid(x, y), axis=-1)


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
            self._way = Way(self.ground.layout, self.goal)
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
