# SPDX-License-Identifier: Apache-2.0
"""Many rooms in one process: ``gymnasium.make_vec(id, num_envs=8)``, bit for bit the single ones.

One physics model per room, each stepped in one compiled call a scan. MuJoCo's ``Batch`` steps no
faster on one core (46 us a step of the office either way), and it wants models of one size, which
two seeds need not have. What is saved here is what a single environment builds at each step and a
policy for many does not read: frames and the info of each room. With ``n_threads`` the rooms step
side by side; physics, crowd and scanner let go of the interpreter lock, and the results do not
depend on it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
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
TOLD: dict[str, Any] = {  # shape and type of what the infos tell of a room
    "pose": ((3,), np.float64), "goal": ((2,), np.float64), "goal_distance": ((), np.float64),
    "hard_collision": ((), np.bool_), "is_success": ((), np.bool_),
}  # fmt: skip


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
        self._told = {k: np.zeros((num_envs, *s), kind) for k, (s, kind) in TOLD.items()}
        if frames:
            self._told["frame"] = np.empty(num_envs, dtype=object)
        self._ended: NDArray[np.bool_] = np.zeros(num_envs, dtype=np.bool_)
        self._helpers = min(n_threads, num_envs) - 1
        self._pool = ThreadPoolExecutor(self._helpers) if self._helpers else None

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
        self._each(lambda i: self._restart(i, seeds[i], own), np.flatnonzero(mask).tolist())
        self._ended[mask] = False
        return _copied(self._seen), self._infos()

    def _each(self, work: Callable[[int], None], rooms: Sequence[int]) -> None:
        """``work`` of every room, on all threads: whichever is free takes the next."""
        left = iter(rooms)  # one thread at a time has the interpreter's lock, and so its ``next``

        def some() -> None:
            for i in left:
                work(i)

        others = [self._pool.submit(some) for _ in range(self._helpers)] if self._pool else []
        try:
            some()
        finally:
            wait(others)
        for other in others:
            other.result()

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
        for name, stacked in self._seen.items():
            if observation[name].shape != stacked[i].shape:
                raise InvalidValueError(
                    f"observation '{name}' has shape {observation[name].shape}, the others "
                    f"{stacked[i].shape}: set the laser when making the environments"
                )
        self._keep(i, observation)

    def _keep(self, i: int, observation: Observation) -> None:
        for name, stacked in self._seen.items():
            stacked[i] = observation[name]
        env, told = self.envs[i], self._told
        told["pose"][i] = env.simulation.world.robot_pose()
        told["goal"][i] = env.goal or math.nan
        told["goal_distance"][i] = math.nan if env.goal is None else env.goal_distance
        told["hard_collision"][i] = any(contact.hard for contact in env.contacts)
        told["is_success"][i] = env.is_success
        if self._frames:
            told["frame"][i] = env.simulation.frame

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[
        Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        """One scan in every room.

        Actions as in the single environment: finite ones are clipped, anything else is refused with
        ``InvalidValueError`` before any room moves. ``ResetNeededError`` before the first reset.
        """
        commands = np.clip(of_rooms(actions, self.num_envs), -1.0, 1.0).tolist()
        for env in self.envs:
            env.simulation  # noqa: B018  (raises where it was never reset)
        if self.mode == AutoresetMode.DISABLED and self._ended.any():
            raise ResetNeededError(f"reset first: {np.flatnonzero(self._ended)}")
        rewards, ends = np.zeros(self.num_envs), np.zeros((2, self.num_envs), dtype=np.bool_)
        last: dict[int, Any] = {}

        def one(i: int) -> None:
            if self._ended[i]:
                self._restart(i, None, None)
                return
            observation, rewards[i], ends[0, i], ends[1, i] = self.envs[i].act(*commands[i])
            self._keep(i, observation)
            if self.mode == AutoresetMode.SAME_STEP and ends[:, i].any():
                seen = {name: np.array(rows[i]) for name, rows in self._seen.items()}
                last[i] = seen, {name: rows[[i]] for name, rows in self._told.items()}
                self._restart(i, None, None)

        self._each(one, np.argsort(~self._ended, kind="stable").tolist())  # what takes long, first
        self._ended = ends[0] | ends[1]
        final = {}
        if self.mode == AutoresetMode.SAME_STEP:
            final = self._final(last) if last else {}
            self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        return _copied(self._seen), rewards, ends[0], ends[1], self._infos() | final

    def _final(self, last: dict[int, Any]) -> dict[str, Any]:
        """The last observations and infos of the rooms that ended and began anew."""
        seen, infos = np.full(self.num_envs, None, dtype=object), self._infos()
        for i, (observation, told) in last.items():
            seen[i] = observation
            for name, value in told.items():
                infos[name][[i]] = value
        return {
            "final_obs": seen, "_final_obs": self._ended,
            "final_info": infos, "_final_info": self._ended,
        }  # fmt: skip

    def _infos(self) -> dict[str, Any]:
        there = {f"_{name}": np.ones(self.num_envs, dtype=np.bool_) for name in self._told}
        return _copied(self._told) | there

    def render(self) -> None:
        """None: pictures are left to the single environment."""

    def close_extras(self, **kwargs: Any) -> None:
        """Called by ``close``."""
        if self._pool is not None:
            self._pool.shutdown()
        for env in self.envs:
            env.close()


def _copied(rows: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    return {name: stacked.copy() for name, stacked in rows.items()}


def _mode(value: str | AutoresetMode) -> AutoresetMode:
    if isinstance(value, AutoresetMode):
        return value
    try:
        return AutoresetMode[value.upper()]
    except (KeyError, AttributeError):
        known = ", ".join(mode.name.lower() for mode in AutoresetMode)
        raise InvalidValueError(f"autoreset_mode must be one of {known}, got {value!r}") from None
