# SPDX-License-Identifier: Apache-2.0
"""A guard process (``guard``) as seen from mobilia: how it is told, what it says, how it ends."""

from __future__ import annotations

import errno
import marshal
import os
import selectors
import signal
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path

_SCRIPT = Path(__file__).with_name("guard.py")
_BEGIN_S = 60.0  # for the guard's start, on a machine that is busy
_DISMISS_S = 5.0  # for its end: it gives up earlier by itself
_CHUNK = 1 << 16
MARK = "MOBILIA_COMMAND"  # variable that worker processes of one command have in common


class Guard:
    """``command`` below a guard, to which its three streams belong.

    rules  what it may see (``confined.rules``), None: all that we see

    Without a command it guards the processes with ``mark``, "name=value", in their environment.
    Raises ``OSError`` and ``ValueError`` as ``subprocess.Popen`` does.
    """

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str],
        mark: str = "",
        rules: Sequence[tuple[str, int]] | None = None,
    ) -> None:
        encoded = [os.fsencode(word) for word in command]
        variables = {os.fsencode(name): os.fsencode(value) for name, value in environment.items()}
        if any(b"\0" in word for word in (*encoded, *variables, *variables.values())):
            raise ValueError("embedded null byte")
        self._socket, its_end = socket.socketpair()
        with its_end, ExitStack() as if_it_fails:
            if_it_fails.callback(self._socket.close)
            words = [sys.executable, "-I", "-S", str(_SCRIPT), str(its_end.fileno())]
            self.process = subprocess.Popen(
                [*words, str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                pass_fds=[its_end.fileno()],
                env={name: value for name, value in os.environ.items() if name != MARK},
                start_new_session=True,  # what interrupts us at a terminal does not end it
            )
            if_it_fails.pop_all()
        streams = (self.process.stdin, self.process.stdout, self.process.stderr)
        self._streams = [stream for stream in streams if stream is not None]
        for stream in self._streams:
            os.set_blocking(stream.fileno(), False)
        self._status = ""
        try:
            seen = None if rules is None else [(os.fsencode(path), may) for path, may in rules]
            told = (encoded, variables, os.fsencode(mark), seen)
            self.pid = self._begin(marshal.dumps(told))
        except BaseException:
            self.dismiss()
            raise

    def _begin(self, told: bytes) -> int:
        self._socket.settimeout(_BEGIN_S)
        with suppress(BrokenPipeError, ConnectionResetError):
            self._socket.sendall(len(told).to_bytes(8, "little") + told)
        word, number = self._hear()
        if word == "errno":
            raise OSError(number, os.strerror(number))
        if word != "pid":
            raise OSError(errno.ECHILD, "its guard did not start")
        self._socket.setblocking(False)
        return number

    def _hear(self) -> tuple[str, int]:
        """The next that it says; "" when it has gone."""
        line = b""
        with suppress(ConnectionResetError):
            while not line.endswith(b"\n") and (more := self._socket.recv(1)):
                line += more
        word, _, number = line.decode().partition(" ")
        return (word, int(number)) if number else ("", 0)

    def talk(self, unsent: bytes, deadline: float, heard: Callable[[int, bytes], bool]) -> bool:
        """Write to the guest and give what it says to ``heard``, until that is enough.

        ``heard`` gets 1 or 2, for standard output or error, and the bytes, none at its end. False
        when the time (monotonic, s) is up before.
        """
        stdin, *outputs = self._streams
        left = memoryview(unsent)
        with selectors.DefaultSelector() as selector:
            for number, stream in enumerate(outputs, start=1):
                selector.register(stream, selectors.EVENT_READ, number)
            if left:
                selector.register(stdin, selectors.EVENT_WRITE, 0)
            more: bytes | memoryview
            while selector.get_map():
                if (left_s := deadline - time.monotonic()) <= 0.0:
                    return False
                for key, _ in selector.select(left_s):
                    try:
                        if key.data:
                            more = os.read(key.fd, _CHUNK)
                            if heard(key.data, more):
                                return True
                        else:
                            more = left = left[_written(key.fd, left) :]
                    except BlockingIOError:
                        continue
                    if not more:
                        selector.unregister(key.fileobj)
        return True

    def last_words(self) -> bytes:
        """What it has left unread on its standard error."""
        words = b""
        with suppress(OSError):
            while data := os.read(self._streams[2].fileno(), _CHUNK):
                words += data
        return words

    def status(self, within_s: float = 0.0) -> str:
        """How the guest has ended, in words, "" where it lives; it is waited for so long."""
        deadline = time.monotonic() + within_s
        while True:
            with suppress(BlockingIOError):
                if not self._status:
                    self._status = _in_words(*self._hear())
            if self._status or time.monotonic() >= deadline:
                return self._status
            time.sleep(0.005)

    def end_input(self) -> None:
        """The guest has heard all."""
        self._streams[0].close()

    def hush(self) -> None:
        """Close the guest's input and output."""
        for stream in self._streams:
            with suppress(OSError):
                stream.close()

    def dismiss(self, farewell: bytes = b"", leave_s: float = 0.0) -> None:
        """End the guest and all that it started, and the guard.

        Before, the guest hears ``farewell`` and the end of its input, and has a moment to leave.
        """
        if farewell:
            with suppress(OSError, ValueError):
                os.write(self._streams[0].fileno(), farewell)
        self.hush()
        if leave_s:
            self.status(leave_s)
        self._socket.close()
        try:
            self.process.wait(_DISMISS_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def _written(descriptor: int, unsent: memoryview) -> int:
    """Bytes written; all of them when nobody reads any more: its output says why."""
    try:
        return os.write(descriptor, unsent[:_CHUNK])
    except BrokenPipeError:
        return len(unsent)


def _in_words(how: str, number: int) -> str:
    if how == "exited":
        return f"ended with status {number}"
    if how == "signal":
        with suppress(ValueError):
            return f"was ended by {signal.Signals(number).name}"
        return f"was ended by signal {number}"
    return "was ended with its guard"


@contextmanager
def guarded_workers() -> Iterator[None]:
    """What is started meanwhile gets a mark, and is killed when this process ends.

    By SIGKILL too; guests have guards of their own. Linux only, elsewhere nothing.
    """
    if sys.platform != "linux":
        yield
        return
    before = os.environ.get(MARK)  # of a worker that has workers
    os.environ[MARK] = _workers_guard(os.getpid())
    try:
        yield
    finally:
        os.environ.pop(MARK)
        if before is not None:
            os.environ[MARK] = before


_workers_guards: dict[str, Guard] = {}  # they end with this process


@cache
def _workers_guard(_process: int) -> str:
    """The mark; one for each process, as workers stay for the next call."""
    value = uuid.uuid4().hex
    _workers_guards[value] = Guard((), {}, f"{MARK}={value}")
    _workers_guards[value].hush()
    return value
