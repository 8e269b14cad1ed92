# SPDX-License-Identifier: Apache-2.0
"""A child process with a time limit, always ended and reaped: asked line by line, or just run.

``Guard`` is the process that ends it (``guard``), as seen from mobilia; ``Wire`` and ``run`` are
what it is used for.
"""

import errno
import os
import resource
import selectors
import signal
import socket
import subprocess
import sys
import time
import uuid
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path

from slam.errors import InvalidValueError, SlamFailedError
from slam.names import child_environment

_SCRIPT = Path(__file__).with_name("guard.py")
_BEGIN_S = 60.0  # for the guard's start, on a machine that is busy
_DISMISS_S = 5.0  # for its end: it gives up earlier by itself
_CHUNK = 1 << 16
_DRAIN_S = 0.001
KEPT_WORDS = 4000  # bytes of what it says
MARK = "MOBILIA_COMMAND"  # variable that worker processes of one command have in common


class Guard:
    """``command`` below a guard, to which its three streams belong.

    Without a command it guards the processes with ``mark``, "name=value", in their environment.
    Raises ``OSError`` and ``ValueError`` as ``subprocess.Popen`` does.
    """

    def __init__(
        self, command: Sequence[str], environment: Mapping[str, str], mark: str = ""
    ) -> None:
        self._socket, its_end = socket.socketpair()
        # Python adds one where there is no locale, which is not to be the guest's.
        unset = "" if "LC_CTYPE" in environment else "LC_CTYPE"
        words = [sys.executable, "-I", "-S", str(_SCRIPT), str(its_end.fileno())]
        with its_end, ExitStack() as if_it_fails:
            if_it_fails.callback(self._socket.close)
            self.process = subprocess.Popen(
                [*words, str(os.getpid()), mark, unset, *command],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                pass_fds=[its_end.fileno()],
                env={name: value for name, value in environment.items() if name != MARK},
                start_new_session=True,  # what interrupts us at a terminal does not end it
            )
            if_it_fails.pop_all()
        streams = (self.process.stdin, self.process.stdout, self.process.stderr)
        self._streams = [stream for stream in streams if stream is not None]
        for stream in self._streams:
            os.set_blocking(stream.fileno(), False)
        self._status, self._words = "", bytearray()
        try:
            self.pid = self._begin()
        except BaseException:
            self.dismiss()
            raise

    def _begin(self) -> int:
        self._socket.settimeout(_BEGIN_S)
        word, number = self._hear()
        if word == "errno":
            raise OSError(number, os.strerror(number))
        if word != "pid":
            raise OSError(errno.ECHILD, "its guard did not start")
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
        left = memoryview(unsent)
        with selectors.DefaultSelector() as selector:
            for number, stream in enumerate(self._streams):
                if number or left:
                    way = selectors.EVENT_READ if number else selectors.EVENT_WRITE
                    selector.register(stream, way, number)
            while selector.get_map():
                if (left_s := deadline - time.monotonic()) <= 0.0:
                    return False
                for key, _ in selector.select(left_s):
                    with suppress(BlockingIOError):
                        if key.data:
                            data = os.read(key.fd, _CHUNK)
                            if heard(key.data, data):
                                return True
                        else:
                            left = left[_written(key.fd, left) :]
                        if not (data if key.data else left):
                            selector.unregister(key.fileobj)
        return True

    def keep(self, _stream: int, data: bytes) -> bool:
        """For ``talk``: keep the last that it says, and listen on."""
        self._words += data
        del self._words[:-KEPT_WORDS]
        return False

    def said(self) -> list[str]:
        """The last lines kept, and left unread on its standard error; blanks in them made one."""
        with suppress(OSError):
            while data := os.read(self._streams[2].fileno(), _CHUNK):
                self.keep(2, data)
        lines = self._words.decode(errors="replace").split("\n")
        return [text for line in lines if (text := " ".join(line.split()))]

    def last_words(self) -> str:
        """For the end of a message what it said last; "" where that is nothing."""
        lines = self.said()
        return f"; its last words: {_last(lines)!r}" if lines else ""

    def ended(self) -> str:
        """How it has ended, with its last words; "" where it lives. What it says is drained."""
        self.talk(b"", time.monotonic() + _DRAIN_S, self.keep)
        how = self.status()
        return f"{how}{self.last_words()}" if how else ""

    def status(self, within_s: float = 0.0) -> str:
        """How the guest has ended, in words, "" where it lives; it is waited for so long."""
        if not self._status:
            self._socket.settimeout(max(within_s, 0.0))
            with suppress(BlockingIOError, TimeoutError):
                self._status = _in_words(*self._hear())
        return self._status

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


def started(command: Sequence[str], environment: Mapping[str, str]) -> Guard:
    """A ``Guard``; raises ``InvalidValueError`` for a command that cannot be started."""
    try:
        return Guard(command, environment)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise InvalidValueError(f"cannot start {command[0]!r}: {why}") from error


def _last(lines: list[str]) -> str:
    return " | ".join(lines[-3:])[-400:]


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
    os.environ[MARK] = _workers_guard(os.getpid())[0]
    try:
        yield
    finally:
        os.environ.pop(MARK)
        if before is not None:
            os.environ[MARK] = before


@cache
def _workers_guard(_process: int) -> tuple[str, Guard]:
    """The mark, and who ends with this process; one for each, as workers stay for the next call."""
    value = uuid.uuid4().hex
    guard = Guard((), os.environ, f"{MARK}={value}")
    guard.hush()
    return value, guard


MAX_LINE_BYTES = 1 << 28  # a map of 5000 x 5000 cells with all digits of a float32
_OUTPUT = 1
_LEAVE_S = 1.0  # from the end of its input to the end of its life
_STATUS_S = 0.2  # from the end of its output to the end of its life


class Wire:
    """``command`` running in a session of its own.

    The child reads requests from its standard input and answers each with one line on its standard
    output; ``farewell`` and the end of its input mean that it is to end. When it is not needed any
    more, whether closed, garbage collected or at the end of this program, it is killed with all
    that it started, in whatever session; its parent, a ``guard``, sees to it even when this program
    is killed. POSIX only; where there is no Linux, only its process group is killed.
    """

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str] | None = None,
        farewell: bytes = b"",
    ) -> None:
        self._guard = started(command, os.environ if environment is None else environment)
        self._finalizer = weakref.finalize(self, self._guard.dismiss, farewell, _LEAVE_S)
        self._heard = bytearray()

    @property
    def pid(self) -> int:
        """Process and process group."""
        return self._guard.pid

    @property
    def open(self) -> bool:
        """Whether it can be asked."""
        return self._finalizer.alive

    def close(self) -> None:
        """End the child and all it started."""
        self._finalizer()

    def ask(self, request: bytes, limit_s: float) -> bytes:
        """Write ``request``, return the next line.

        Raises ``SlamFailedError``: "hung" after ``limit_s`` of wall-clock time, "raised" when the
        process ends, "bad" for a line past all measure. Then, as after any exception, it is over.
        """
        try:
            deadline = time.monotonic() + limit_s
            there = b"\n" in self._heard
            if not there and not self._guard.talk(request, deadline, self._hear):
                why = f"hung: no answer within {limit_s:g} s{self._guard.last_words()}"
                raise SlamFailedError(why, "hung")
        except BaseException:
            if self._finalizer.detach():
                self._guard.dismiss()
            raise
        end = self._heard.find(b"\n")
        answer = bytes(self._heard[:end])
        del self._heard[: end + 1]
        return answer

    def _hear(self, stream: int, data: bytes) -> bool:
        """Take what it says; whether that ends a line. Each byte is looked at once."""
        if stream != _OUTPUT:
            return self._guard.keep(stream, data)
        if not data:
            status = self._guard.status(_STATUS_S)
            how = f"its process {status}" if status else "closed its standard output"
            raise SlamFailedError(f"{how}{self._guard.last_words()}")
        self._heard += data
        if len(self._heard) > MAX_LINE_BYTES:
            raise SlamFailedError(f"answered a line of more than {MAX_LINE_BYTES} bytes", "bad")
        return b"\n" in data

    def processor_s(self) -> float | None:
        """Processor time it has used, all its threads, s; None where that cannot be known."""
        if not Path("/proc/self").exists():
            return None
        with suppress(OSError):
            return time.clock_gettime((~self.pid << 3) | 2)  # Linux: the clock of that process
        return None

    def memory_bytes(self, line: str) -> int | None:
        """Resident memory, "VmRSS" now or "VmHWM" at its most; None where that cannot be known."""
        with suppress(OSError, ValueError):
            for row in Path(f"/proc/{self.pid}/status").read_text().splitlines():
                if row.startswith(line + ":"):
                    return int(row.split()[1]) * 1024
        return None


def run(command: Sequence[str], limit_s: float) -> float:
    """Run a program without input to its end; processor time it took, s.

    Raises ``SlamFailedError``: "hung" after ``limit_s`` of wall-clock time, "raised" where it
    cannot be started, or ends with another status than 0, with its last words.
    """
    before = _children_s()
    try:
        guard = started(command, child_environment(guest=True))
    except InvalidValueError as error:
        raise SlamFailedError(str(error)) from error
    deadline = time.monotonic() + limit_s
    try:
        guard.end_input()
        guard.talk(b"", deadline, guard.keep)
        status, said = guard.status(deadline - time.monotonic()), guard.said()
    finally:
        guard.dismiss()
    if not status:
        raise SlamFailedError(f"hung: did not end within {limit_s:g} s", "hung")
    if status != "ended with status 0":
        raise SlamFailedError(f"{command[0]!r} {status}: {_last(said)!r}")
    return _children_s() - before


def _children_s() -> float:
    """Processor time of all children that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
