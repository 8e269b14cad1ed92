# SPDX-License-Identifier: Apache-2.0
"""Processes that step the rooms of a vector environment, each its own block of them.

What rooms are told and what they show lies in memory that all see (``sim.gym.block``): a request
and its answer are some bytes through a pipe. A worker ends with its parent, whatever became of
that, since its pipe does.
"""

import mmap
import os
import pickle
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

import gymnasium
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from sim.gym.block import Block, Board, board_of, row_of
from sim.gym.env import MobiliaEnv
from slam.errors import InvalidValueError, MobiliaError
from slam.names import child_environment, load, loaded

_BEGIN = """
import sys
from multiprocessing.connection import Connection
parent = Connection(int(sys.argv[1]))
sys.path[:] = parent.recv()
from sim.gym.workers import serve
serve(parent, *map(int, sys.argv[2:]))
"""
_SWITCH_S = 0.0005  # for which building ahead may hold up a step, where nothing else lets go
_LEAVE_S = 10.0  # for workers that are asked to end: they may be building a room
_LEAVE = pickle.dumps((0, "leave", b""))


class RoomsEndedError(MobiliaError, gymnasium.error.ClosedEnvironmentError):
    """The rooms are closed, or a process that stepped some of them has ended."""


class Workers:
    """``n_workers`` processes, each with a block of the ``n`` rooms of ``board``.

    space     of the observations of one room
    mode, settings  as for ``Block``

    Raises ``InvalidValueError`` for settings that cannot be sent to another process, and whatever
    ``MobiliaEnv`` says of them there.
    """

    def __init__(
        self,
        n_workers: int,
        space: spaces.Dict,
        n: int,
        mode: AutoresetMode,
        settings: Mapping[str, Any],
    ) -> None:
        self._asked, self._ended = 0, ""
        self._workers: list[tuple[subprocess.Popen[bytes], Connection]] = []
        row = row_of(space)
        size = n * row.itemsize
        try:
            with tempfile.TemporaryFile(dir=_folder()) as file:
                _reserve(file.fileno(), size)
                self.board: Board = board_of(row, n, mmap.mmap(file.fileno(), size))
                for k in range(n_workers):
                    self._start(file.fileno(), k, n_workers)
            self._all("begin", loaded(), _packed(row, n, mode, dict(settings)))
        except BaseException:
            self.close()
            raise

    def _start(self, memory: int, *which: int) -> None:
        ours, its = Pipe()
        with its:
            process = subprocess.Popen(
                [sys.executable, "-c", _BEGIN, *map(str, (its.fileno(), memory, *which))],
                stdin=subprocess.DEVNULL,
                pass_fds=[its.fileno(), memory],
                env=child_environment(guest=False),
                start_new_session=True,  # what interrupts us at a terminal does not end it
            )
        self._workers.append((process, ours))
        with suppress(OSError):  # it has ended: the first answer says so
            ours.send(sys.path)

    def reset(self, seeds: Mapping[int, int | None], options: dict[str, Any] | None) -> None:
        """As of a ``Block``, and so are ``step`` and ``each``."""
        self._all("reset", seeds, options)

    def step(self) -> None:
        """One step of each room; one whose episode is over begins anew."""
        self._all("step")

    def each(self, work: Callable[[MobiliaEnv], Any], rooms: Sequence[int]) -> dict[int, Any]:
        """What ``work`` of each of these rooms returns; both are sent."""
        return self._all("each", work, rooms)

    def _all(self, name: str, *words: Any) -> dict[int, Any]:
        """That method of every block, side by side; what they return, by room.

        Raises the first error of any, and ``RoomsEndedError``, which ends the others, where a
        worker has ended.
        """
        if self._ended:
            raise RoomsEndedError(self._ended)
        self._asked += 1
        told = _packed(self._asked, name, _packed(*words))
        for _, worker in self._workers:
            with suppress(OSError):
                worker.send_bytes(told)
        answers, errors = dict[int, Any](), list[Exception]()
        for process, worker in self._workers:
            try:
                number, error, answer = worker.recv()
                while number != self._asked:  # one that an interrupt kept from being read
                    number, error, answer = worker.recv()
            except (EOFError, OSError):
                self.close(
                    f"a process of the rooms has ended ({_how(process)}), perhaps for want of "
                    "memory: make the environment again"
                )
                raise RoomsEndedError(self._ended) from None
            errors += [] if error is None else [error]
            answers |= answer
        if errors:
            raise errors[0]
        return answers

    def close(self, why: str = "the environment is closed") -> None:
        """End all; a room that is just being built is waited for."""
        self._ended = self._ended or why
        for _, worker in self._workers:
            with suppress(OSError):
                worker.send_bytes(_LEAVE)  # where a fork of ours holds the pipe open, too
            worker.close()
        end = time.monotonic() + _LEAVE_S
        for process, _ in self._workers:
            try:
                process.wait(max(end - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._workers = []


def _reserve(file: int, size: int) -> None:
    """Memory that is promised and not there would end the process that writes to it."""
    try:
        os.ftruncate(file, size)
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file, 0, size)
    except OSError as error:
        raise InvalidValueError(f"n_workers needs {size} bytes of shared memory: {error}") from None


def _packed(*words: Any) -> bytes:
    try:
        return pickle.dumps(words)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InvalidValueError(
            f"with n_workers this is for what another process can be sent: {error}"
        ) from error


def _unpacked(told: bytes) -> Any:
    """The words; a worker has the modules of the script that started it, and not the script."""
    try:
        return pickle.loads(told)
    except Exception as error:
        raise InvalidValueError(
            f"with n_workers this is for what another process can be sent, by a module and not by "
            f"the script that runs: {error}"
        ) from error


def _folder() -> str | None:
    """Where files stay in memory, if there is such a place."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def _how(process: subprocess.Popen[bytes]) -> str:
    """How it has ended."""
    try:
        status = process.wait(_LEAVE_S)
    except subprocess.TimeoutExpired:
        return "it hangs"
    return f"status {status}" if status >= 0 else f"signal {-status}"


def serve(parent: Connection, memory: int, k: int, n_workers: int) -> None:
    """Worker ``k`` of so many: answer each request, until the pipe ends."""
    sys.setswitchinterval(_SWITCH_S)
    block: Any = None
    threads = ThreadPoolExecutor(1)
    with suppress(EOFError, OSError):
        while True:
            number, name, told = parent.recv()
            if name == "leave":
                break
            try:
                words = _unpacked(told)
                if name == "begin":
                    block, answer = _block(memory, k, n_workers, threads, *words), None
                else:
                    answer = getattr(block, name)(*words)
                told = pickle.dumps((number, None, answer or {}))
            except Exception as error:  # noqa: BLE001 (the parent raises it)
                told = _failed(number, error)
            parent.send_bytes(told)
    threads.shutdown(cancel_futures=True)


def _block(
    memory: int, k: int, n_workers: int, threads: Executor, modules: Sequence[str], told: bytes
) -> Block:
    load(modules)  # before what is told, which may be of them
    row, n, mode, settings = _unpacked(told)
    board = board_of(row, n, mmap.mmap(memory, n * row.itemsize))
    mine = range(k * n // n_workers, (k + 1) * n // n_workers)
    rooms = {i: MobiliaEnv(**settings) for i in mine}
    return Block(rooms, board, mode, threads)


def _failed(number: int, error: Exception) -> bytes:
    """An error as an answer, with the worker's own lines where it is none of ours."""
    if not isinstance(error, MobiliaError):
        error.add_note("".join(traceback.format_exception(error)))
    try:
        told = pickle.dumps((number, error, {}))
        pickle.loads(told)
    except Exception:  # noqa: BLE001 (somebody else's class, whatever it does)
        told = pickle.dumps((number, MobiliaError(f"{type(error).__name__}: {error}"), {}))
    return told
