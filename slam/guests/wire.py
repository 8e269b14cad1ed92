# SPDX-License-Identifier: Apache-2.0
"""A child process with a time limit, always ended and reaped: asked line by line, or just run."""

from __future__ import annotations

import os
import resource
import time
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from slam.errors import InvalidValueError, SlamFailedError
from slam.guests.guarding import Guard
from slam.names import child_environment

MAX_LINE_BYTES = 1 << 28  # a map of 5000 x 5000 cells with all digits of a float32
KEPT_WORDS = 4000  # bytes of its standard error
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
        rules: Sequence[tuple[str, int]] | None = None,
    ) -> None:
        """``rules``: what it may see (``confined.rules``), None: all that we see."""
        environment = os.environ if environment is None else environment
        try:
            self._guard = Guard(command, environment, rules=rules)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise InvalidValueError(f"cannot start {command[0]!r}: {why}") from error
        self._confined = rules is not None
        self._finalizer = weakref.finalize(self, self._guard.dismiss, farewell, _LEAVE_S)
        self._heard, self._words = bytearray(), bytearray()

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
                why = f"hung: no answer within {limit_s:g} s{self._last_words()}"
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
            self._words += data
            del self._words[:-KEPT_WORDS]
            return False
        if not data:
            status = self._guard.status(_STATUS_S)
            how = f"its process {status}" if status else "closed its standard output"
            raise SlamFailedError(f"{how}{self._last_words()}")
        self._heard += data
        if len(self._heard) > MAX_LINE_BYTES:
            raise SlamFailedError(f"answered a line of more than {MAX_LINE_BYTES} bytes", "bad")
        return b"\n" in data

    def _last_words(self) -> str:
        words = (self._words + self._guard.last_words())[-KEPT_WORDS:]
        said = _said(words)
        refused = any(why in " ".join(said) for why in ("Permission denied", "No module named"))
        hint = ""
        if self._confined and refused:
            hint = "; it sees only its own folder: docs/bring_your_own.md"
        return f"; its last words: {' | '.join(said[-3:])[-400:]!r}{hint}" if said else ""

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
        guard = Guard(command, child_environment(guest=True))
    except (OSError, ValueError) as error:
        raise SlamFailedError(f"cannot start {command[0]!r}: {error}") from error
    words = bytearray()

    def heard(_stream: int, data: bytes) -> bool:
        words.extend(data)
        del words[:-KEPT_WORDS]
        return False

    deadline = time.monotonic() + limit_s
    try:
        guard.end_input()
        guard.talk(b"", deadline, heard)
        status = guard.status(deadline - time.monotonic())
    finally:
        guard.dismiss()
    if not status:
        raise SlamFailedError(f"hung: did not end within {limit_s:g} s", "hung")
    if status != "ended with status 0":
        raise SlamFailedError(f"{command[0]!r} {status}: {' | '.join(_said(words))[-400:]!r}")
    return _children_s() - before


def _said(words: bytearray) -> list[str]:
    """Its lines, but empty ones, blanks in them made one."""
    lines = words.decode(errors="replace").split("\n")
    return [text for line in lines if (text := " ".join(line.split()))]


def _children_s() -> float:
    """Processor time of all children that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
