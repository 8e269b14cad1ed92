# SPDX-License-Identifier: Apache-2.0
"""Who drives to a goal in ``train_policy``: a network, or the built-in driver without avoidance."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from scripts.experiments.goal_room import bare_room, room
from sim.driving.drive import Driver, TourConfig
from sim.driving.navgrid import NavGrid
from sim.gym.env import OMEGA_MAX_RADPS, V_MAX_MPS, MobiliaEnv
from slam.frames import Float

ARRIVED_M = 0.3  # of the driver's goal, within that of the environment
NO_DISCS: Float = np.zeros((0, 5))
OUTCOMES = ("reached", "collided", "late")


class Policy(Protocol):
    """Whoever drives."""

    def start(self, env: MobiliaEnv) -> None:
        """A new episode has begun."""

    def act(self, env: MobiliaEnv, observation: Any) -> Any:
        """(2,) action."""


class Network:
    """A trained policy of Stable-Baselines3, its most likely action.

    weights  file of its parameters, as ``torch.save`` wrote them; nothing else is read from it
    """

    def __init__(self, weights: Path, scene: str) -> None:
        import torch

        torch.set_num_threads(1)
        self._model = untrained(room(scene, "odometry", 1.0), seed=0)
        state = torch.load(weights, weights_only=True, map_location="cpu")
        self._model.policy.load_state_dict(state)

    def start(self, env: MobiliaEnv) -> None:
        """Nothing to remember."""

    def act(self, env: MobiliaEnv, observation: Any) -> Any:
        """By what the robot sees and believes."""
        return self._model.predict(observation, deterministic=True)[0]


class Rule:
    """The reactive rule alone: what the network is before it learns."""

    def start(self, env: MobiliaEnv) -> None:
        """Nothing to remember."""

    def act(self, env: MobiliaEnv, observation: Any) -> Any:
        """No correction."""
        return np.zeros(2)


class Blind:
    """The built-in driver on the static layout with the true pose: it does not see what moves."""

    def start(self, env: MobiliaEnv) -> None:
        """Plan the way to the goal of this episode."""
        scene, goal = env.simulation.world.scene, env.goal
        assert goal is not None
        config = TourConfig(goal_radius_m=ARRIVED_M)
        grid = NavGrid(scene.bounds, scene.obstacles, config.robot_radius_m - 0.05)
        self._driver = Driver(grid, np.array([goal]), config)
        self._before, self._time_s = env.simulation.world.robot_pose(), 0.0

    def act(self, env: MobiliaEnv, observation: Any) -> Any:
        """By the truth."""
        world = env.simulation.world
        here, now_s = world.robot_pose(), world.time_ns * 1e-9
        dt = max(now_s - self._time_s, env.simulation.scan_period_s)
        moved, turned = here[:2] - self._before[:2], float(here[2] - self._before[2])
        ahead = float(moved[0]) * math.cos(here[2]) + float(moved[1]) * math.sin(here[2])
        self._before, self._time_s = here, now_s
        v, omega = self._driver.command(here, (ahead / dt, turned / dt), NO_DISCS, dt)
        return np.array([v / V_MAX_MPS, omega / OMEGA_MAX_RADPS])


def untrained(env: Any, seed: int) -> Any:
    """PPO before its first step."""
    from stable_baselines3 import PPO

    return PPO(
        "MlpPolicy",
        env,
        n_steps=512,
        batch_size=256,
        n_epochs=6,
        learning_rate=3e-4,
        gamma=0.985,
        gae_lambda=0.95,
        policy_kwargs={"net_arch": [128, 128], "log_std_init": -1.0},
        seed=seed,
        device="cpu",
    )


def digest(who: str) -> str:
    """Of a file of weights; "" for who needs none."""
    return "" if who in ("driver", "rule") else hashlib.sha256(Path(who).read_bytes()).hexdigest()


def drive(  # noqa: PLR0913 (settings)
    who: str,
    scene: str,
    pose_source: str,
    dynamism: float,
    seeds: Sequence[int],
    seconds: float,
    version: str = "",
) -> list[dict[str, Any]]:
    """One episode a seed: outcome, and s until its end.

    who      file of the weights of a network, "driver", or "rule"
    version  ``digest`` of it, for who keeps results by their arguments
    """
    policy: Policy
    if who in ("driver", "rule"):
        policy = Blind() if who == "driver" else Rule()
    else:
        policy = Network(Path(who), scene)
    make = bare_room if who == "driver" else room
    env = make(scene, pose_source, 0.0, seconds)
    inner: MobiliaEnv = env.unwrapped
    rows = []
    for seed in seeds:
        seen, info = env.reset(seed=seed, options={"dynamism": dynamism})
        policy.start(inner)
        over = False
        while not over:
            seen, _, terminated, truncated, info = env.step(policy.act(inner, seen))
            over = terminated or truncated
        outcome = OUTCOMES[1 if info["hard_collision"] else 0 if info["is_success"] else 2]
        end_s = inner.simulation.world.time_ns * 1e-9
        rows.append({"seed": seed, "outcome": outcome, "seconds": end_s})
    return rows
