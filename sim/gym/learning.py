# SPDX-License-Identifier: Apache-2.0
"""Many rooms as Stable-Baselines3 takes them (the extra ``rl``).

rooms = learning_rooms("mobilia/ArenaGoal-v2", 8)
PPO("MlpPolicy", rooms).learn(150_000)
"""

from collections.abc import Callable
from operator import attrgetter, methodcaller
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from sim.gym.vector import MobiliaVectorEnv
from sim.gym.wrappers import goal_rooms
from slam.errors import InvalidValueError, MissingDependencyError

try:
    from stable_baselines3.common.vec_env import VecEnv, VecFrameStack, VecMonitor
except ImportError as error:
    raise MissingDependencyError(
        "Stable-Baselines3 is not there: pip install 'mobilia[rl]' "
        "--extra-index-url https://download.pytorch.org/whl/cpu"
    ) from error

TOLD = ("is_success", "hard_collision")  # of the infos of a room


class Rooms(VecEnv):  # type: ignore[misc]
    """A vector environment of Gymnasium for Stable-Baselines3.

    rooms  autoreset mode "disabled": those that have ended are reset here, in the same step

    A room's info has ``TOLD``, and at the end of an episode ``terminal_observation`` and
    ``TimeLimit.truncated``. Seeds, which a reset gives to the rooms, are those of ``seed``.
    """

    def __init__(self, rooms: VectorEnv[Any, Any, Any]) -> None:
        mode = rooms.metadata.get("autoreset_mode")
        if mode != AutoresetMode.DISABLED:
            raise InvalidValueError(f"rooms must have autoreset_mode 'disabled', got {mode}")
        self.rooms, self.render_mode = rooms, None
        super().__init__(rooms.num_envs, rooms.single_observation_space, rooms.single_action_space)

    def reset(self) -> Any:
        """All rooms again; their observations."""
        seeds: Any = None if None in self._seeds else list(self._seeds)
        observations, _ = self.rooms.reset(seed=seeds)
        self._reset_seeds()
        return observations

    def step_async(self, actions: Any) -> None:
        """What ``step_wait`` is to do."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Observations, rewards (float32), ends and infos of one step in every room."""
        seen, rewards, terminated, truncated, told = self.rooms.step(self._actions)
        ended = terminated | truncated
        infos = [
            {key: bool(told[key][i]) for key in TOLD if key in told} for i in range(len(ended))
        ]
        if ended.any():
            last, (seen, _) = seen, self.rooms.reset(options={"reset_mask": ended})
            for i in np.flatnonzero(ended).tolist():
                infos[i]["terminal_observation"] = last[i]
                infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        return seen, rewards.astype(np.float32), ended, infos

    def close(self) -> None:
        """Free the rooms."""
        self.rooms.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Of the rooms."""
        return self._each(attrgetter(attr_name), indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Of the rooms."""
        self._each(methodcaller("__setattr__", attr_name, value), indices)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **named: Any) -> Any:
        """What that method of each room returns."""
        return self._each(methodcaller(method_name, *args, **named), indices)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Never: the rooms are wrapped together."""
        return [False for _ in self._get_indices(indices)]

    def _each(self, work: Callable[[Any], Any], indices: Any) -> list[Any]:
        rooms, asked = self.rooms.unwrapped, list(self._get_indices(indices))
        if isinstance(rooms, MobiliaVectorEnv):
            return rooms.each(work, asked)
        return [work(rooms.envs[i]) for i in asked]  # type: ignore[attr-defined]


def learning_rooms(id_: str, num_envs: int = 8, *, n_stack: int = 3, **settings: Any) -> Any:
    """``sim.gym.wrappers.goal_rooms``, the last ``n_stack`` observations as one, with a monitor."""
    rooms = Rooms(goal_rooms(id_, num_envs, **settings))
    return VecFrameStack(VecMonitor(rooms, info_keywords=("is_success",)), n_stack)
