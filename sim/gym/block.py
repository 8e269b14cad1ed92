# SPDX-License-Identifier: Apache-2.0
"""Rooms of a vector environment that one process steps, and the arrays that they write to.

The arrays are of all rooms and may lie in memory that several processes see: each block writes the
rows of its own rooms, so that nothing that a room shows is copied or sent from one to the other.
"""

import math
import mmap
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from sim.gym.env import MobiliaEnv
from sim.gym.observation import Observation
from slam.errors import InvalidValueError

TOLD: dict[str, Any] = {  # shape and type of what the infos tell of a room
    "pose": ((3,), np.float64), "goal": ((2,), np.float64), "goal_distance": ((), np.float64),
    "hard_collision": ((), np.bool_), "is_success": ((), np.bool_),
}  # fmt: skip
_LINE = 64  # bytes, of a line of the processor's cache: where each array begins
Rows = dict[str, NDArray[Any]]


class Board:
    """What n rooms are told to do and what they show, in one piece of memory.

    commands     (n, 2) in [-1, 1]: of the next step
    rewards      (n,)
    ends         (2, n) whether the episode was terminated, truncated
    seen, told   observations and infos by name, a row for each room
    last_seen, last_told  the same of the end of an episode, where the room has begun anew since
    """

    def __init__(self, space: spaces.Dict, n: int, memory: mmap.mmap | None = None) -> None:
        memory = mmap.mmap(-1, self.size(space, n)) if memory is None else memory
        arrays: dict[str, Rows] = {}
        at = 0
        for group, name, shape, kind in _entries(space, n):
            array = np.frombuffer(memory, kind, math.prod(shape), at).reshape(shape)
            arrays.setdefault(group, {})[name] = array
            at += _rounded(array.nbytes)
        own = arrays["own"]
        self.commands, self.rewards, self.ends = own["commands"], own["rewards"], own["ends"]
        self.seen, self.told = arrays["seen"], arrays["told"]
        self.last_seen, self.last_told = arrays["last_seen"], arrays["last_told"]

    @staticmethod
    def size(space: spaces.Dict, n: int) -> int:
        """Bytes of memory that it takes."""
        return sum(
            _rounded(math.prod(shape) * np.dtype(kind).itemsize)
            for _, _, shape, kind in _entries(space, n)
        )


def _entries(space: spaces.Dict, n: int) -> Iterator[tuple[str, str, tuple[int, ...], Any]]:
    yield "own", "commands", (n, 2), np.float64
    yield "own", "rewards", (n,), np.float64
    yield "own", "ends", (2, n), np.bool_
    for when in ("", "last_"):
        for name, one in space.items():
            yield f"{when}seen", name, (n, *(one.shape or ())), one.dtype
        for name, (shape, kind) in TOLD.items():
            yield f"{when}told", name, (n, *shape), kind


def _rounded(size: int) -> int:
    return -(-size // _LINE) * _LINE


class Block:
    """Some rooms of ``board``, by their number.

    mode     what becomes of those whose episode is over
    frames   whether ``reset`` and ``step`` return the frame of each room, by its number, and that
             of the end of an episode where the room has begun anew since
    threads  where rooms of next episodes are built ahead of time; None: not at all
    """

    def __init__(
        self,
        rooms: Mapping[int, MobiliaEnv],
        board: Board,
        mode: AutoresetMode,
        *,
        frames: bool,
        threads: Executor | None = None,
    ) -> None:
        self.board = board
        self._rooms, self._mode, self._frames, self._threads = rooms, mode, frames, threads
        self._last: dict[int, Any] = {}  # frames

    def reset(
        self, seeds: Mapping[int, int | None], options: dict[str, Any] | None
    ) -> dict[int, tuple[Any, Any]]:
        """Reset those of its rooms that have a seed, be that None."""
        mine = [i for i in self._rooms if i in seeds]
        for i in mine:
            self._restart(i, seeds[i], options)
        return self._both(mine)

    def step(self) -> dict[int, tuple[Any, Any]]:
        """One step of each room; one whose episode is over begins anew."""
        self._last = {}
        for i in self._rooms:
            self._step(i)
        return self._both(list(self._rooms))

    def _step(self, i: int) -> None:
        board = self.board
        if self._mode == AutoresetMode.NEXT_STEP and board.ends[:, i].any():
            self._restart(i, None, None)
            board.rewards[i] = 0.0
            return
        told = self._rooms[i].act(*board.commands[i].tolist())
        observation, board.rewards[i], board.ends[0, i], board.ends[1, i] = told
        self._keep(i, observation)
        if self._mode == AutoresetMode.SAME_STEP and board.ends[:, i].any():
            for now, last in (board.seen, board.last_seen), (board.told, board.last_told):
                for name, rows in now.items():
                    last[name][i] = rows[i]
            self._last |= self._shown([i])
            ends = board.ends[:, i].copy()
            self._restart(i, None, None)
            board.ends[:, i] = ends

    def _restart(self, i: int, seed: int | None, options: dict[str, Any] | None) -> None:
        room = self._rooms[i]
        observation, _ = room.reset(seed=seed, options=options)
        for name, stacked in self.board.seen.items():
            if observation[name].shape != stacked[i].shape:
                raise InvalidValueError(
                    f"observation '{name}' has shape {observation[name].shape}, the others "
                    f"{stacked[i].shape}: set the laser when making the environments"
                )
        self._keep(i, observation)
        self.board.ends[:, i] = False
        plain = seed is None and not options  # so it may go on in this mode
        if self._threads is not None and (plain or self._mode != AutoresetMode.DISABLED):
            room.prepare(self._threads)

    def _keep(self, i: int, observation: Observation) -> None:
        room, told = self._rooms[i], self.board.told
        for name, stacked in self.board.seen.items():
            stacked[i] = observation[name]
        told["pose"][i] = room.simulation.world.robot_pose()
        told["goal"][i] = room.goal or math.nan
        told["goal_distance"][i] = math.nan if room.goal is None else room.goal_distance
        told["hard_collision"][i] = any(contact.hard for contact in room.contacts)
        told["is_success"][i] = room.is_success

    def _shown(self, rooms: Sequence[int]) -> dict[int, Any]:
        return {i: self._rooms[i].simulation.frame for i in rooms} if self._frames else {}

    def _both(self, rooms: Sequence[int]) -> dict[int, tuple[Any, Any]]:
        return {i: (frame, self._last.get(i)) for i, frame in self._shown(rooms).items()}

    def each(self, work: Callable[[MobiliaEnv], Any], rooms: Sequence[int]) -> dict[int, Any]:
        """What ``work`` of each of these rooms returns, by their number."""
        return {i: work(self._rooms[i]) for i in rooms if i in self._rooms}

    def close(self) -> None:
        """Free the rooms."""
        for room in self._rooms.values():
            room.close()
