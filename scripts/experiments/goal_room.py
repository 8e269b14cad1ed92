# SPDX-License-Identifier: Apache-2.0
"""The room of ``train_policy``, as the network sees it and as it acts in it."""

from __future__ import annotations

import math
import time
from typing import Any

import gymnasium
import numpy as np

import sim  # noqa: F401  (registers the environments)
from sim.gym.env import OMEGA_MAX_RADPS, V_MAX_MPS
from sim.gym.memory import LidarMemory
from sim.gym.wrappers import DynamismCurriculum

SCENE = "arena"
TOUCH_M, FADE_M = 0.3, 0.8  # m: nearness is 1 within the one, and 1/e the other beyond it
GOAL_M = 8.0  # m, from here on a goal looks equally far
SHARE = 0.5  # of the greatest command: what an action of 1 adds to the rule's
KEEP_M = 0.62  # m that the rule keeps from any point: a chair's foot and the robot, and some
AHEAD_M = 1.2  # m of free way that it wants
TURN_PER_S = 2.0  # its turn rate over the angle to its heading
STAND_RAD = 0.9  # beyond this angle it turns on the spot
BRAKE_M = 0.7  # m of free way from which on it slows down
NEAR_M, NEAREST_M = 0.7, 0.5  # m from the robot's centre: where being near costs, and costs most
NEAR_COST_PER_S = 0.4
RADII_M = (0.56, 0.33)  # of a robot beside a chair's column, which is all that is seen, or a wall

Step = tuple[Any, Any, bool, bool, dict[str, Any]]


class Residual(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Actions correct the reactive rule, by ``SHARE`` of the greatest command at most.

    Being near to something costs; ``LidarMemory``'s ranges tell what is near. The information is
    what training needs and no more: frames are large to send to another process.
    """

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """As of the wrapped environment."""
        self._seen, _ = self.env.reset(**arguments)
        return self._seen, {}

    def step(self, action: Any) -> Step:
        """As of the wrapped environment, under the corrected command."""
        v, omega = rule(self._seen["ranges"], *self._seen["goal_polar"].tolist())
        began_s = float(self._seen["time"])
        command = np.array([v + SHARE * float(action[0]), omega + SHARE * float(action[1])])
        seen, reward, terminated, truncated, info = self.env.step(np.clip(command, -1.0, 1.0))
        self._seen = seen
        near = (NEAR_M - float(seen["ranges"].min())) / (NEAR_M - NEAREST_M)
        seconds = float(seen["time"]) - began_s
        cost = NEAR_COST_PER_S * min(max(near, 0.0), 1.0) * seconds
        told = {key: info[key] for key in ("is_success", "hard_collision")}
        return seen, float(reward) - cost, terminated, truncated, told

    def processor_s(self) -> float:
        """Seconds of processor time of this process since it began."""
        return time.process_time()


class Senses(gymnasium.ObservationWrapper[Any, Any, Any]):
    """The observation of ``LidarMemory`` as one vector.

    Nearness of each sector now, and half a second ago; how near the robot would get to something
    if it drove that way, for a wide and a narrow robot; the goal's
    range, twice, cosine and sine of its bearing; the robot's speeds.
    """

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        n = (2 + len(RADII_M)) * env.observation_space["ranges"].shape[0] + 6
        self.observation_space = gymnasium.spaces.Box(-2.0, 2.0, (n,), np.float32)

    def observation(self, observation: Any) -> Any:
        """Of the wrapped environment's ``observation``."""
        rings = np.concatenate([observation["ranges"], observation["ranges_before"]])
        ways = [free_way(observation["ranges"], radius) for radius in RADII_M]
        left = np.concatenate([np.maximum(rings - TOUCH_M, 0.0), *ways])
        near = np.exp(-left / FADE_M)
        away, bearing = observation["goal_polar"].tolist()
        v, omega = observation["velocity"].tolist()
        rest = [
            min(away / GOAL_M, 1.0), math.exp(-away), math.cos(bearing), math.sin(bearing),
            v / V_MAX_MPS, omega / OMEGA_MAX_RADPS,
        ]  # fmt: skip
        return np.clip(np.concatenate([near, rest]), -2.0, 2.0).astype(np.float32)


def free_way(ranges: Any, radius_m: float) -> Any:
    """(n,) m that a disc can go in the direction of each sector, until a point is in its way.

    ranges  (n,) m around the disc's centre; the greatest of them is taken as free
    """
    n = len(ranges)
    turns = np.arange(n) * (2.0 * np.pi / n)
    apart = turns[:, None] - turns[None, :]
    along, beside = ranges * np.cos(apart), ranges * np.sin(apart)
    until = along - np.sqrt(np.maximum(radius_m**2 - beside**2, 0.0))
    hits = (np.abs(beside) < radius_m) & (along > 0.0)
    most = float(ranges.max())
    return np.minimum(np.where(hits, np.maximum(until, 0.0), most).min(axis=1), most)


def rule(ranges: Any, away_m: float, bearing: float) -> tuple[float, float]:
    """(forward, turn) in [-1, 1]: to the nearest direction to the goal with enough of free way.

    A vector field histogram in few words: it knows no motion and remembers no choice.

    ranges  (n,) m, of ``LidarMemory``
    """
    n = len(ranges)
    ways = (np.arange(n) + 0.5) * (2.0 * np.pi / n) - np.pi
    free = free_way(ranges, min(KEEP_M, max(float(ranges.min()) - 0.02, TOUCH_M)))
    off = np.abs((ways - bearing + np.pi) % (2.0 * np.pi) - np.pi)
    wanted = min(away_m, AHEAD_M)
    short = np.maximum(wanted - free, 0.0) / wanted
    heading = float(ways[np.argmin(off + 0.25 * np.abs(ways) + 4.0 * short)])
    if free.max() < TOUCH_M:
        heading = float(ways[np.argmax(free)])
    elif free[np.argmin(off)] >= 0.9 * away_m:
        heading = bearing
    turn = min(max(TURN_PER_S * heading / OMEGA_MAX_RADPS, -1.0), 1.0)
    if abs(heading) > STAND_RAD:
        return 0.0, turn
    left = max(float(free[np.argmin(np.abs(ways))]) - 0.02, 0.0)
    return math.cos(heading) ** 2 * min(1.0, left / BRAKE_M), turn


def bare_room(pose_source: str, level: float, seconds: float = 30.0) -> Any:
    """One room; its dynamism is drawn from 0 to ``level``."""
    env = gymnasium.make(
        f"mobilia/{SCENE.title()}Goal-v2",
        disable_env_checker=True,
        pose_source=pose_source,
        time_limit_s=seconds,
        terminate_on_collision=True,
    )
    return DynamismCurriculum(env, level)


def room(pose_source: str, level: float, seconds: float = 30.0) -> Any:
    """The same as the network sees it."""
    return Senses(Residual(LidarMemory(bare_room(pose_source, level, seconds))))
