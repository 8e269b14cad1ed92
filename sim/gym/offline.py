# SPDX-License-Identifier: Apache-2.0
"""Episodes of an environment to learn from offline, as datasets of Minari (the extra ``data``).

The robot is driven to its goals by the driver of recorded episodes, which knows the truth.
"""

import importlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from scenes import is_file
from sim.core.versions import WORLD
from sim.driving.pilot import Pilot, tour_of
from sim.gym.env import OMEGA_MAX_RADPS, V_MAX_MPS, MobiliaEnv
from sim.recording.recipe import Recipe
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S

POLICY = "driver of mobilia: plans on the layout, avoids what truly moves"
FRAME_SKIP = 4  # scans to a step, as of the environments to train in
_SETTINGS = ("scene", "dynamism", "motion", "change", "crowd", "odometry", "scan_height_m")
_ELSEWHERE = ("seed", "labels", "laser", "scene_sha256")  # what else every recipe has


def spec_of(recipe: Recipe) -> EnvSpec:
    """The environment with the room of a recipe, a random goal and the shaped reward.

    Raises ``InvalidValueError`` for what a recipe has and no environment takes.
    """
    given = recipe.simulation()
    for name in sorted(set(given) - {*_SETTINGS, *_ELSEWHERE}):
        raise InvalidValueError(f"Recipe.{name} is no setting of an environment: leave it out")
    scene = Path(recipe.scene).stem if is_file(recipe.scene) else recipe.scene
    name = re.sub(r"[\W_]", "", scene.title())
    settings = {key: given[key] for key in _SETTINGS if key in given}
    return EnvSpec(
        id=f"mobilia/{name}Goal-v{WORLD}",
        entry_point="sim.gym.env:MobiliaEnv",
        kwargs={
            **settings, "laser": recipe.scanner, "time_limit_s": recipe.seconds,
            "goal": "random", "reward": "shaped", "frame_skip": FRAME_SKIP,
        },
    )  # fmt: skip


class Expert:
    """Actions for a room that has just been reset, to its goal and round what truly is there."""

    def __init__(self, env: MobiliaEnv) -> None:
        self._simulation = env.simulation
        world = env.simulation.world
        usual = tour_of(world.robot)
        most = min(usual.omega_max_radps, OMEGA_MAX_RADPS)
        self._pilot = Pilot(world, replace(usual, omega_max_radps=most, goal_radius_m=0.1))
        self._pilot.driver.goals = np.array([env.goal])
        self._time_ns = world.time_ns - round(env.simulation.scan_period_s * NS_PER_S)

    def action(self) -> NDArray[np.float32]:
        """(2,) of the next step."""
        before, self._time_ns = self._time_ns, self._simulation.world.time_ns
        v, omega = self._pilot.command((self._time_ns - before) / NS_PER_S)
        return np.array([v / V_MAX_MPS, omega / OMEGA_MAX_RADPS], np.float32)


@dataclass(frozen=True, kw_only=True)
class Drive:
    """One episode of n steps.

    observations, infos  arrays by name, with an entry for the reset: n + 1
    actions, rewards, terminations, truncations  n
    """

    seed: int
    observations: dict[str, NDArray[Any]]
    actions: NDArray[np.float32]
    rewards: NDArray[np.float64]
    terminations: NDArray[np.bool_]
    truncations: NDArray[np.bool_]
    infos: dict[str, Any]


def driven(recipe: Recipe) -> Drive:
    """The episode of a recipe's seed."""
    env = MobiliaEnv(**spec_of(recipe).kwargs)
    seen, _ = env.reset(seed=recipe.seed)
    observations, infos, steps, expert = [seen], [env.told()], list[Any](), Expert(env)
    while not steps or not (steps[-1][2] or steps[-1][3]):
        action = expert.action()
        seen, reward, *ends = env.act(*action.tolist())
        observations.append(seen)
        infos.append(env.told())
        steps.append((action, reward, *ends))
    actions, rewards, terminations, truncations = map(np.array, zip(*steps, strict=True))
    return Drive(
        seed=recipe.seed, observations=_stacked(observations), infos=_stacked(infos),
        actions=actions, rewards=rewards, terminations=terminations, truncations=truncations,
    )  # fmt: skip


def _stacked(rows: list[dict[str, Any]]) -> dict[str, NDArray[Any]]:
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def write(folder: Path, name: str, recipe: Recipe, drives: Iterable[Drive]) -> None:
    """A dataset of Minari called ``name`` in ``folder``, one drive of that room after the other.

    Of a scene by its file it tells the file's name: a path is of this machine.
    """
    minari = importlib.import_module("minari")
    buffer = importlib.import_module("minari.data_collector.episode_buffer").EpisodeBuffer
    storage_of = importlib.import_module("minari.dataset.minari_storage").MinariStorage
    spec = spec_of(recipe)
    env = MobiliaEnv(**spec.kwargs)
    if is_file(recipe.scene):
        spec.kwargs["scene"] = Path(recipe.scene).name
    (folder / "data").mkdir(parents=True)
    storage = storage_of.new(
        folder / "data", observation_space=env.observation_space, action_space=env.action_space,
        env_spec=spec, data_format="parquet",
    )  # fmt: skip
    storage.update_metadata(
        {"dataset_id": name, "minari_version": minari.__version__, "algorithm_name": POLICY}
    )
    reached = 0
    for drive in drives:
        told = {k: v if v.ndim > 1 else v.tolist() for k, v in drive.infos.items()}
        storage.update_episodes([buffer(**{**vars(drive), "infos": told})])
        reached += bool(drive.terminations[-1])
    storage.update_metadata({"description": f"{reached} reach their goal"})
