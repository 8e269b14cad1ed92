# SPDX-License-Identifier: Apache-2.0
"""Rooms of a vector environment that one process steps, and the board that they write to.

The board has a row for each room and may lie in memory that several processes see: each block
writes the rows of its own rooms, so that nothing that a room shows is copied or sent.
"""

import math
import mmap
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from sim.gym.env import MobiliaEnv
from sim.gym.observation import Observation
from slam.errors import InvalidValueError

TOLD = np.dtype(  # what the infos tell of a room, ``MobiliaEnv.told``
    [
        ("pose", "f8", (3,)), ("goal", "f8", (2,)), ("goal_distance", "f8"),
        ("hard_collision", "?"), ("is_success", "?"),
    ],
    align=True,
)  # fmt: skip
Board = NDArray[Any]


def row_of(space: spaces.Dict) -> np.dtype[Any]:
    """A row of the board: what a room is told to do and what it shows.

    command  (2,) in [-1, 1]: of the next step          reward
    ends     (2,) whether the episode was terminated, truncated
    seen, told  observations and infos by name
    """
    seen = np.dtype([(name, one.dtype, one.shape or ()) for name, one in space.items()], align=True)
    own = [("command", "f8", (2,)), ("reward", "f8"), ("ends", "?", (2,))]
    return np.dtype([*own, ("seen", seen), ("told", TOLD)], align=True)


def board_of(row: np.dtype[Any], n: int, memory: mmap.mmap | None = None) -> Board:
    """(n,) rows in that memory, or in memory of their own."""
    return np.zeros(n, row) if memory is None else np.frombuffer(memory, row, n)


class Block:
    """Some rooms of ``board``, by their number.

    mode     what becomes of those whose episode is over
    threads  where rooms of next episodes are built ahead of time; None: not at all
    """

    def __init__(
        self,
        rooms: Mapping[int, MobiliaEnv],
        board: Board,
        mode: AutoresetMode,
        threads: Executor | None = None,
    ) -> None:
        self.board = board
        self._rooms, self._mode, self._threads = rooms, mode, threads

    def reset(self, seeds: Mapping[int, int | None], options: dict[str, Any] | None) -> None:
        """Reset those of its rooms that have a seed, be that None."""
        for i in self._rooms:
            if i in seeds:
                self._restart(i, seeds[i], options)

    def step(self) -> None:
        """One step of each room; one whose episode is over begins anew."""
        for i in self._rooms:
            self._step(i)

    def _step(self, i: int) -> None:
        row = self.board[i]
        if self._mode == AutoresetMode.NEXT_STEP and row["ends"].any():
            self._restart(i, None, None)
            row["reward"] = 0.0
            return
        observation, row["reward"], *ends = self._rooms[i].act(*row["command"].tolist())
        row["ends"] = ends
        self._keep(i, observation)

    def _restart(self, i: int, seed: int | None, options: dict[str, Any] | None) -> None:
        room = self._rooms[i]
        observation, _ = room.reset(seed=seed, options=options)
        for name, value in observation.items():
            shape = self.board["seen"][name].shape[1:]
            if value.shape != shape:
                raise InvalidValueError(
                    f"observation '{name}' has shape {value.shape}, the others {shape}: set the "
                    "laser when making the environments"
                )
        self._keep(i, observation)
        self.board["ends"][i] = False
        plain = seed is None and not options  # so it may go on in this mode
        if self._threads is not None and (plain or self._mode != AutoresetMode.DISABLED):
            room.prepare(self._threads)

    def _keep(self, i: int, observation: Observation) -> None:
        row = self.board[i]
        for name, value in observation.items():
            row["seen"][name] = value
        for name, value in self._rooms[i].told().items():
            row["told"][name] = math.nan if value is None else value

    def each(self, work: Callable[[MobiliaEnv], Any], rooms: Sequence[int]) -> dict[int, Any]:
        """What ``work`` of each of these rooms returns, by their number."""
        return {i: work(self._rooms[i]) for i in rooms if i in self._rooms}

    def close(self) -> None:
        """Free the rooms."""
        for room in self._rooms.values():
            room.close()
