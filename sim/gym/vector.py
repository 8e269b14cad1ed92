# SPDX-License-Identifier: Apache-2.0
"""Many rooms at once: ``gymnasium.make_vec(id, num_envs=8)``, bit for bit the single ones.

One physics model per room, each stepped in one compiled call a scan. MuJoCo's ``Batch`` steps no
faster on one core (46 us a step of the office either way), and it wants models of one size, which
two seeds need not have. What is saved here is what a single environment builds at each step and a
policy for many does not read: frames and the info of each room. With ``n_workers`` processes step
the rooms side by side; the results do not depend on it.
"""

import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sim.gym.block import Block, board_of, row_of
from sim.gym.env import MobiliaEnv, ResetNeededError
from sim.gym.observation import Observation
from sim.gym.options import array_of, checked_seed, of_rooms
from sim.gym.workers import RoomsEndedError, Workers
from slam.errors import InvalidValueError
from slam.shaped import one_of, whole

MOST_ENVS = 4096  # each holds a physics model of its own
MOST_WORKERS = 1024
MODES = ("next_step", "disabled")


class MobiliaVectorEnv(VectorEnv[Observation, NDArray[np.float32], Any]):
    """``num_envs`` independent ``MobiliaEnv`` with stacked observations.

    ### Seeds
    ``reset(seed=s)`` gives room i the seed s + i, as ``SyncVectorEnv`` does; a list gives each its
    own. ``reset(options=...)`` holds for all rooms, and ``options["reset_mask"]`` (num_envs,) bool
    resets some of them only.

    ### Autoreset
    ``autoreset_mode`` "next_step" (Gymnasium's default): the step after the one that ended an
    episode ignores that room's action and returns its reset observation with reward 0; drop that
    transition when learning. "disabled": stepping a room that has ended is an error, ``reset`` with
    a ``reset_mask`` comes first. A room that resets by itself goes on with its own generator, and
    without options.

    ### Infos
    ``pose`` (n, 3), ``goal`` (n, 2) and ``goal_distance`` (n,) NaN without a goal,
    ``hard_collision`` (n,), ``is_success`` (n,), all with a mask of the same name and a leading
    "_", here always true. Whatever else a room knows, ``each`` asks for:
    ``rooms.each(attrgetter("simulation.frame"))``.

    ### Workers
    ``n_workers`` processes have the rooms in blocks; 0, the default: this one has them all. Arrays
    are shared, a step sends some bytes. Where a room begins anew by itself, its worker builds the
    room of the next episode meanwhile, so that a reset hardly holds the others up.

    ``settings`` are those of ``MobiliaEnv``, ``pose_source`` by name only, so that each room has a
    SLAM of its own; rendering is left to the single environment.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        n_workers: int = 0,
        **settings: Any,
    ) -> None:
        whole("num_envs", num_envs, 1, MOST_ENVS)
        whole("n_workers", n_workers, 0, MOST_WORKERS)
        source = settings.get("pose_source")
        if num_envs > 1 and source is not None and not isinstance(source, str):
            raise InvalidValueError(
                f"pose_source must be a name for {num_envs} environments, so that each has its "
                f"own SLAM, got {source!r:.80}"
            )
        self.num_envs = num_envs
        self.mode = _mode(autoreset_mode)
        self.metadata = {**MobiliaEnv.metadata, "autoreset_mode": self.mode}
        rooms = [MobiliaEnv(**settings) for _ in range(1 if n_workers else num_envs)]
        space = rooms[0].observation_space
        assert isinstance(space, spaces.Dict)
        self.single_observation_space, self.single_action_space = space, rooms[0].action_space
        self.observation_space = batch_space(space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._begun: NDArray[np.bool_] = np.zeros(num_envs, dtype=np.bool_)
        self._rooms: Block | Workers
        if n_workers:
            workers = min(n_workers, num_envs)
            self._rooms = Workers(workers, space, num_envs, self.mode, settings)
            weakref.finalize(self, self._rooms.close)  # where nobody closes it
        else:
            board = board_of(row_of(space), num_envs)
            self._rooms = Block(dict(enumerate(rooms)), board, self.mode)
        self._board = self._rooms.board

    def each(
        self, work: Callable[[MobiliaEnv], Any], rooms: Sequence[int] | None = None
    ) -> list[Any]:
        """What ``work`` of each of these rooms (default all) returns.

        With workers it must be something that can be sent, as ``operator.attrgetter`` and
        ``methodcaller`` make it, and so must what it returns.
        """
        asked = list(range(self.num_envs) if rooms is None else rooms)
        for i in asked:
            whole("room", i, 0, self.num_envs - 1)
        found = self._rooms.each(work, asked)
        return [found[i] for i in asked]

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
        self._refuse_closed()
        own = dict(options or {})
        mask = array_of(own.pop("reset_mask", np.ones(self.num_envs, dtype=np.bool_)))
        if mask.dtype != np.bool_ or mask.shape != (self.num_envs,) or not mask.any():
            raise InvalidValueError(
                f"option reset_mask must be ({self.num_envs},) bool with one true, got {mask!r}"
            )
        seeds = self._seeds(seed)
        chosen = {i: seeds[i] for i in np.flatnonzero(mask).tolist()}
        self._rooms.reset(chosen, own)
        self._begun |= mask
        return _copied(self._board["seen"]), self._infos()

    def _refuse_closed(self) -> None:
        if self.closed:
            raise RoomsEndedError("the environment is closed")

    def _seeds(self, seed: Any) -> list[int | None]:
        """One for each room."""
        if isinstance(seed, (list, tuple, np.ndarray)):
            if len(np.atleast_1d(np.array(seed, dtype=object))) != self.num_envs:
                raise InvalidValueError(f"seed must be {self.num_envs} seeds, got {seed!r:.200}")
            return [checked_seed(one) for one in seed]
        first = checked_seed(seed)
        return [None if first is None else first + i for i in range(self.num_envs)]

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[
        Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:
        """One scan in every room.

        Actions as in the single environment: finite ones are clipped, anything else is refused with
        ``InvalidValueError`` before any room moves. ``ResetNeededError`` before the first reset.
        """
        board = self._board
        commands = np.clip(of_rooms(actions, self.num_envs), -1.0, 1.0)
        self._refuse_closed()
        if not self._begun.all():
            raise ResetNeededError("call reset() before using the environment")
        if self.mode == AutoresetMode.DISABLED and (ended := board["ends"].any(axis=1)).any():
            raise ResetNeededError(
                f"rooms {np.flatnonzero(ended).tolist()} have ended: reset(options={{'reset_mask': "
                "terminated | truncated}), or make them with autoreset_mode='next_step'"
            )
        board["command"] = commands
        self._rooms.step()
        terminated, truncated = board["ends"].T.copy()
        rewards, infos = board["reward"].copy(), self._infos()
        return _copied(board["seen"]), rewards, terminated, truncated, infos

    def _infos(self) -> dict[str, Any]:
        told = _copied(self._board["told"])
        return told | {f"_{name}": np.ones(self.num_envs, dtype=np.bool_) for name in told}

    def render(self) -> None:
        """None: pictures are left to the single environment."""

    def close_extras(self, **kwargs: Any) -> None:
        """Called by ``close``."""
        self._rooms.close()


def _copied(rows: NDArray[Any]) -> dict[str, Any]:
    return {name: rows[name].copy() for name in rows.dtype.names or ()}


def _mode(value: str | AutoresetMode) -> AutoresetMode:
    name = value.name.lower() if isinstance(value, AutoresetMode) else value
    return AutoresetMode[one_of("autoreset_mode", name, MODES).upper()]
