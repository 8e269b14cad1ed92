# SPDX-License-Identifier: Apache-2.0
"""Many rooms in one process: ``gymnasium.make_vec(id, num_envs=8)``, bit for bit the single ones.

One physics model per room, each stepped in one compiled call a scan. MuJoCo's ``Batch`` steps no
faster on one core (46 us a step of the office either way), and it wants models of one size, which
two seeds need not have. What is saved here is what a single environment builds at each step and a
policy for many does not read: frames and the info of each room. With ``n_threads`` the rooms step
side by side; physics, crowd and scanner let go of the interpreter lock, and the results do not
depend on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sim.core.checks import switch, whole
from sim.gym.env import MobiliaEnv, ResetNeededError
from sim.gym.observation import Observation
from sim.gym.options import array_of, checked_seed, of_rooms
from slam.errors import InvalidValueError

MOST_ENVS = 4096  # each holds a physics model of its own
MOST_THREADS = 1024
Outcome = tuple[float, bool, bool]


class MobiliaVectorEnv(VectorEnv[Observation, NDArray[np.float32], Any]):
    """``num_envs`` independent ``MobiliaEnv`` with stacked observations.

    ### Seeds
    ``reset(seed=s)`` gives room i the seed s + i, as ``SyncVectorEnv`` does; a list gives each its
    own. ``reset(options=...)`` holds for all rooms, and ``options["reset_mask"]`` (num_envs,) bool
    resets some of them only.

    ### Autoreset
    ``autoreset_mode`` "next_step" (Gymnasium's default): the step after the one that ended an
    episode ignores that room's action and returns its reset observation with reward 0; drop that
    transition when learning. "same_step": the ending step already returns the observation of the
    new episode, the last one of the old is in ``infos["final_obs"][i]``. "disabled": stepping a
    room that has ended is an error. A room that resets by itself goes on with its own generator,
    and without options.

    ### Infos
    ``pose`` (n, 3), ``goal`` (n, 2) and ``goal_distance`` (n,) NaN without a goal,
    ``hard_collision`` (n,), ``is_success`` (n,), and with ``frames`` also ``frame`` (n,) objects;
    all with a mask of the same name and a leading "_", here always true. They are of the new
    episode where "same_step" began one; ``infos["final_info"]`` has those of the old one.

    ``settings`` are those of ``MobiliaEnv``, ``pose_source`` by name only, so that each room has a
    SLAM of its own; rendering is left to the single environment.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        n_threads: int = 1,
        frames: bool = False,
        **settings: Any,
    ) -> None:
        whole("num_envs", num_envs, 1, MOST_ENVS)
        whole("n_threads", n_threads, 1, MOST_THREADS)
        switch("frames", frames)
        source = settings.get("pose_source")
        if num_envs > 1 and source is not None and not isinstance(source, str):
            raise InvalidValueError(
                f"pose_source must be a name for {num_envs} environments, so that each has its "
                f"own SLAM, got {source!r:.80}"
            )
        self.num_envs = num_envs
        self.mode = _mode(autoreset_mode)
        self._frames = frames
        self.metadata = {**MobiliaEnv.metadata, "autoreset_mode": self.mode}
        self.envs = [MobiliaEnv(**settings) for _ in range(num_envs)]
        self.single_observation_space = self.envs[0].observation_space
        self.single_action_space = self.envs[0].action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        zero = self.single_observation_space.sample()
        self._seen = {k: np.zeros((num_envs, *v.shape), v.dtype) for k, v in zero.items()}
        self._ended = np.zeros(num_envs, dtype=np.bool_)
        self._pool = ThreadPoolExecutor(n_threads) if n_threads > 1 else None

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Reset all rooms, or those of ``options["reset_mask"]``."""
        if not isinstance(options, Mapping | None):
            raise InvalidValueError(
                f"reset options must be a dictionary or None, got {options!r:.200}"
            )
        own = dict(options or {})
        mask = array_of(own.pop("reset_mask", np.ones(self.num_envs, dtype=np.bool_)))
        if mask.dtype != np.bool_ or mask.shape != (self.num_envs,) or not mask.any():
            raise InvalidValueError(
                f"option reset_mask must be ({self.num_envs},) bool with one true, got {mask!r}"
            )
        seeds = self._seeds(seed)
        chosen = np.flatnonzero(mask).tolist()
        run = map if self._pool is None else self._pool.map
        list(run(lambda i: self._restart(i, seeds[i], own), chosen))
        self._ended[mask] = False
        return self._observations(), self._infos()

    def _seeds(self, seed: Any) -> list[int | None]:
        """One for each room."""
        if isinstance(seed, (list, tuple, np.ndarray)):
            if len(np.atleast_1d(np.array(seed, dtype=object))) != self.num_envs:
                raise InvalidValueError(f"seed must be {self.num_envs} seeds, got {seed!r:.200}")
            return [checked_seed(one) for one in seed]
        first = checked_seed(seed)
        return [None if first is None else first + i for i in range(self.num_envs)]

    def _restart(self, i: int, seed: int | None, options: dict[str, Any] | None) -> None:
        observation, _ = self.envs[i].reset(seed=seed, options=options)
        self._keep(i, observation)

    def _keep(self, i: int, observation: Observation) -> None:
        for name, stacked in self._seen.items():
            if observation[name].shape != stacked[i].shape:
                raise InvalidValueError(
                    f"observation '{name}' has shape {observation[name].shape}, the others "
                    f"{stacked[i].shape}: set the laser when making the environments"
                )
            stacked[i] = observation[name]

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[
        Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        """One scan in every room.

        Actions as in the single environment: finite ones are clipped, anything else is refused with
        ``InvalidValueError`` before any room moves. ``ResetNeededError`` before the first reset.
        """
        commands = of_rooms(actions, self.num_envs)
        for env in self.envs:
            env.simulation  # noqa: B018  (raises where it was never reset)
        if self.mode == AutoresetMode.DISABLED and self._ended.any():
            raise ResetNeededError(f"reset first: {np.flatnonzero(self._ended)}")
        rooms = range(self.num_envs)
        if self._pool is None:
            results = [self._one(i, commands[i]) for i in rooms]
        else:
            results = list(self._pool.map(self._one, rooms, commands))
        rewards = np.array([r[0] for r in results], dtype=np.float64)
        terminated = np.array([r[1] for r in results], dtype=np.bool_)
        truncated = np.array([r[2] for r in results], dtype=np.bool_)
        self._ended = terminated | truncated
        final = None
        if self.mode == AutoresetMode.SAME_STEP and self._ended.any():
            final = self._start_over()
        return self._observations(), rewards, terminated, truncated, self._infos(final)

    def _one(self, i: int, action: NDArray[np.float32]) -> Outcome:
        if self._ended[i] and self.mode == AutoresetMode.NEXT_STEP:
            self._restart(i, None, None)
            return 0.0, False, False
        observation, reward, terminated, truncated = self.envs[i].act(action)
        self._keep(i, observation)
        return reward, terminated, truncated

    def _start_over(self) -> dict[str, Any]:
        """Reset the rooms that ended; the last observations of their old episodes."""
        final, of_old = np.full(self.num_envs, None, dtype=object), self._infos()
        for i in np.flatnonzero(self._ended).tolist():
            final[i] = {name: np.array(stacked[i]) for name, stacked in self._seen.items()}
            self._restart(i, None, None)
        ended, self._ended = self._ended, np.zeros(self.num_envs, dtype=np.bool_)
        return {
            "final_obs": final, "_final_obs": ended, "final_info": of_old, "_final_info": ended,
        }  # fmt: skip

    def _observations(self) -> Observation:
        return {name: stacked.copy() for name, stacked in self._seen.items()}

    def _infos(self, final: dict[str, Any] | None = None) -> dict[str, Any]:
        n, simulations = self.num_envs, [env.simulation for env in self.envs]
        distances = [env.goal_distance for env in self.envs]
        infos: dict[str, Any] = {
            "pose": np.array([s.world.robot_pose() for s in simulations]),
            "goal": np.array([env.goal or (np.nan, np.nan) for env in self.envs]),
            "goal_distance": np.array([np.nan if d is None else d for d in distances]),
            "hard_collision": np.array([any(c.hard for c in env.contacts) for env in self.envs]),
            "is_success": np.array([env.is_success for env in self.envs]),
        }
        if self._frames:
            infos["frame"] = np.empty(n, dtype=object)
            infos["frame"][:] = [s.frame for s in simulations]
        infos |= {f"_{name}": np.ones(n, dtype=np.bool_) for name in tuple(infos)}
        return infos | (final or {})

    def render(self) -> None:
        """None: pictures are left to the single environment."""

    def close_extras(self, **kwargs: Any) -> None:
        """Called by ``close``."""
        if self._pool is not None:
            self._pool.shutdown()
        for env in self.envs:
            env.close()


def _mode(value: str | AutoresetMode) -> AutoresetMode:
    if isinstance(value, AutoresetMode):
        return value
    try:
        return AutoresetMode[value.upper()]
    except (KeyError, AttributeError):
        known = ", ".join(mode.name.lower() for mode in AutoresetMode)
        raise InvalidValueError(f"autoreset_mode must be one of {known}, got {value!r}") from None
