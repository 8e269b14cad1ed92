# SPDX-License-Identifier: Apache-2.0
"""Driving: a tour of a scene's rooms, local avoidance by the dynamic window approach.

(Fox, Burgard, Thrun 1997.) The planner sees what it is given: a static layout, a pose and the discs
around it. Recorded episodes give it the truth, a closed loop gives it a SLAM's estimate.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.actors.config import DRIVE
from sim.actors.robot import DriveConfig, steered, toward
from sim.driving.navgrid import NavGrid
from slam._jit import inner, njit
from slam.errors import InvalidValueError
from slam.frames import Float
from slam.settings import Settings, number

_FAR = 1e6


@dataclass(frozen=True, kw_only=True)
class TourConfig(Settings):
    """Limits of a tour: an indoor Pioneer's usual pace, not its maximum."""

    v_max_mps: float = number(0.7, "m/s", "driving, at most", low=1e-6)
    omega_max_radps: float = number(1.4, "rad/s", "turning, at most", low=1e-6)
    robot_radius_m: float = number(0.285, "m", "kept to walls and discs: 0.26 of a 3-DX", low=1e-6)
    goal_radius_m: float = number(0.5, "m", "from a goal that counts as visited", low=1e-6)
    patience_s: float = number(6.0, "s", "without progress: the next goal is tried", low=1e-6)
    turn_radius_m: float = number(0.0, "m", "of a car's tightest turn; 0: it turns on the spot")


def tour_at(drive: DriveConfig, robot_radius_m: float) -> TourConfig:
    """A tour as fast as the drive can, but not above the usual, with that clearance in m."""
    usual = TourConfig()
    return TourConfig(
        v_max_mps=min(usual.v_max_mps, drive.v_max),
        omega_max_radps=min(usual.omega_max_radps, drive.omega_max),
        robot_radius_m=robot_radius_m,
        turn_radius_m=drive.turn_radius,
    )


@inner
def _field_at(
    field: NDArray[np.float64], x0: float, y0: float, cell: float, x: float, y: float
) -> float:
    i = math.floor((y - y0) / cell)
    j = math.floor((x - x0) / cell)
    if i < 0 or j < 0 or i >= field.shape[0] or j >= field.shape[1]:
        return _FAR
    return float(field[i, j])


@inner
def _between(
    field: NDArray[np.float64], x0: float, y0: float, cell: float, x: float, y: float
) -> float:
    """``field`` at (x, y), bilinear between cell centres; 0 outside."""
    u, v = (x - x0) / cell - 0.5, (y - y0) / cell - 0.5
    j, i = math.floor(u), math.floor(v)
    if i < 0 or j < 0 or i + 1 >= field.shape[0] or j + 1 >= field.shape[1]:
        return 0.0
    a, b = u - j, v - i
    low = (1.0 - a) * field[i, j] + a * field[i, j + 1]
    high = (1.0 - a) * field[i + 1, j] + a * field[i + 1, j + 1]
    return float((1.0 - b) * low + b * high)


@inner
def _nearest_disc(discs: NDArray[np.float64], x: float, y: float, t: float) -> float:
    """Distance to the edge of the nearest disc, each moved on by its velocity for ``t`` s."""
    nearest = _FAR
    for k in range(discs.shape[0]):
        dx = discs[k, 0] + t * discs[k, 3] - x
        dy = discs[k, 1] + t * discs[k, 4] - y
        nearest = min(nearest, math.sqrt(dx * dx + dy * dy) - discs[k, 2])
    return nearest


@inner
def _score(  # noqa: PLR0913 (kernel)
    pose: NDArray[np.float64],
    now: NDArray[np.float64],
    v_asked: float,
    omega_asked: float,
    turn_radius: float,
    discs: NDArray[np.float64],
    grid: tuple[NDArray[np.float64], NDArray[np.float64], float, float, float, float, float],
) -> float:
    """How good 2.1 s under a command would be; minus ``_FAR`` when it would collide.

    The speeds are ramped from what the robot does ``now``, as the drive will.
    """
    clearance, cost_to_go, x0, y0, cell, radius, look = grid
    x, y, theta = pose[0], pose[1], pose[2]
    v, omega, run_over = now[0], now[1], 0.0
    start = min(_between(clearance, x0, y0, cell, x, y), _nearest_disc(discs, x, y, 0.0)) - radius
    closest = _FAR
    for step in range(1, 15):
        t = DRIVE.step_s * step
        v = toward(v, v_asked, DRIVE.accel * DRIVE.step_s)
        omega = toward(omega, omega_asked, DRIVE.alpha * DRIVE.step_s)
        omega = steered(v, omega, turn_radius)
        x += DRIVE.step_s * v * math.cos(theta + 0.5 * DRIVE.step_s * omega)
        y += DRIVE.step_s * v * math.sin(theta + 0.5 * DRIVE.step_s * omega)
        theta += DRIVE.step_s * omega
        free = min(_between(clearance, x0, y0, cell, x, y), _nearest_disc(discs, x, y, t)) - radius
        # an overlap at the start may be driven out of
        if free < 0.0 and free <= start + DRIVE.overlap_m:
            if v_asked != 0.0:
                return -_FAR
            run_over = DRIVE.run_over
        closest = min(closest, free)
    here = _field_at(cost_to_go, x0, y0, cell, x, y)
    ahead = _field_at(
        cost_to_go, x0, y0, cell, x + look * math.cos(theta), y + look * math.sin(theta)
    )
    if here >= _FAR:
        here = 50.0
    ahead = min(ahead, here + 0.5)
    gain = -here - DRIVE.ahead * ahead + DRIVE.free * min(closest, DRIVE.free_m)
    return gain - DRIVE.turning * abs(omega_asked) - run_over


@njit
def _choose(
    pose: NDArray[np.float64],
    now: NDArray[np.float64],
    limits: tuple[float, float, float],
    discs: NDArray[np.float64],
    grid: tuple[NDArray[np.float64], NDArray[np.float64], float, float, float, float, float],
) -> tuple[float, float, float]:
    """The best (v, omega) of the window, and its score."""
    v_max, omega_max, turn_radius = limits
    best_v, best_omega, best = 0.0, 0.0, -_FAR
    for a in range(-1, 7):
        v = v_max * a / 6.0
        if a < 0:
            v = -DRIVE.reverse * v_max
        for b in range(-6, 7):
            omega = omega_max * b / 6.0
            if a < 0 and abs(b) > 3:
                continue
            score = _score(pose, now, v, omega, turn_radius, discs, grid)
            if a <= 0:
                score -= DRIVE.standing
            if score > best:
                best_v, best_omega, best = v, omega, score
    return best_v, best_omega, best


class Driver:
    """Steers to one goal after another; remembers only its own progress.

    goals  (n, 2) m, visited in order and again from the start
    """

    def __init__(self, grid: NavGrid, goals: NDArray[np.float64], config: TourConfig) -> None:
        if len(goals) == 0:
            raise InvalidValueError("a tour needs at least one goal, a mark 'goal:NAME'")
        self.config = config
        self.goals = np.asarray(goals, dtype=np.float64)
        self.visited = 0
        self.look_ahead_m = DRIVE.look_ahead_m  # a robot that is to stop on its goal looks less far
        self._grid = self._walls = grid
        self._index = 0
        self._best = math.inf
        self._idle_s = 0.0

    @property
    def goal(self) -> Float:
        """(2,) m, where it is driving now."""
        goal: Float = self.goals[self._index % len(self.goals)]
        return goal

    def command(
        self, T_world_robot: Float, velocity: Sequence[float], discs: Float, dt: float
    ) -> tuple[float, float]:
        """(v m/s, omega rad/s) for the next ``dt`` s.

        velocity  (v, omega) the robot has now
        discs     (k, 5): x, y, radius (m) and velocity (m/s) of what must not be hit
        """
        offset = T_world_robot[:2] - self.goal
        distance = math.hypot(offset[0], offset[1])
        if distance < self.config.goal_radius_m:
            self.visited += 1
            self._next()
        to_go = self._grid.cost_to(self.goal)
        left = self._grid.cost_near(to_go, T_world_robot[0], T_world_robot[1])
        if left >= _FAR and self._idle_s > 1.0:
            self._next()  # there is no way at present: somewhere else meanwhile
        elif left < self._best - 0.1:
            self._best, self._idle_s = left, 0.0
        else:
            self._idle_s += dt
            if self._idle_s > self.config.patience_s:
                self._next()
        grid, radius = self._grid, self.config.robot_radius_m
        if self._idle_s > 1.5:
            radius *= 0.93  # squeeze past rather than stand before a gap that is just wide enough
        if 2.5 < self._idle_s < 4.5:
            to_go = np.zeros_like(to_go)  # make room first: away from whatever is in the way
        v, omega, _ = _choose(
            np.asarray(T_world_robot, dtype=np.float64),
            np.asarray(velocity, dtype=np.float64),
            (self.config.v_max_mps, self.config.omega_max_radps, self.config.turn_radius_m),
            np.ascontiguousarray(discs, dtype=np.float64).reshape(-1, 5),
            (self._walls.clearance, to_go, grid.x0, grid.y0, grid.cell, radius, self.look_ahead_m),
        )
        return v, omega

    def use(self, grid: NavGrid, *, walls: NavGrid | None = None, afresh: bool = True) -> None:
        """Plan on this layout from now on (a door has opened, say).

        What must not be touched is still the first layout, or ``walls`` of the same extent, and the
        discs of each ``command``. ``afresh`` False: a plan that is made again all the time is no
        progress by itself.
        """
        self._grid = grid
        if walls is not None:
            self._walls = walls
        if afresh:
            self._best = math.inf

    def _next(self) -> None:
        self._index += 1
        self._best, self._idle_s = math.inf, 0.0


def tour(goals: Mapping[str, tuple[float, float]], rng: np.random.Generator) -> NDArray[np.float64]:
    """All goals in an order drawn from ``rng``: (n, 2) m."""
    named = sorted(goals.items())
    order = rng.permutation(len(named))
    return np.array([named[k][1] for k in order], dtype=np.float64)
