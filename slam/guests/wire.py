# SPDX-License-Identifier: Apache-2.0
"""A child process asked line by line, within a time limit, and always ended and reaped."""

from __future__ import annotations

import os
import selectors
import subprocess
import time
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

from slam.errors import InvalidValueError, SlamFailedError
from slam.guests.guarding import Guard

MAX_LINE_BYTES = 1 << 28  # a map of 5000 x 5000 cells with all digits of a float32
KEPT_WORDS = 4000  # bytes of its standard error
_CHUNK = 1 << 16
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
        try:
            environment = os.environ if environment is None else environment
            self._guard = Guard(command, environment, rules=rules)
            self._confined = rules is not None
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise InvalidValueError(f"cannot start {command[0]!r}: {why}") from error
        self._stdin, self._stdout, self._stderr = _pipes(self._guard.process)
        self._finalizer = weakref.finalize(self, _end, self._guard, farewell)
        self._heard = bytearray()
        self._words = bytearray()

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
            return self._exchange(request, time.monotonic() + limit_s, limit_s)
        except BaseException:
            if self._finalizer.detach():
                _end(self._guard, leave_s=0.0)
            raise

    def _exchange(self, request: bytes, deadline: float, limit_s: float) -> bytes:
        unsent = memoryview(request)
        searched = 0  # each byte once: a map comes in thousands of pieces
        with selectors.DefaultSelector() as selector:
            selector.register(self._stdin, selectors.EVENT_WRITE)
            selector.register(self._stdout, selectors.EVENT_READ)
            selector.register(self._stderr, selectors.EVENT_READ)
            while (end := self._heard.find(b"\n", searched)) < 0:
                searched = len(self._heard)
                left_s = deadline - time.monotonic()
                if left_s <= 0.0:
                    raise SlamFailedError(
                        f"hung: no answer within {limit_s:g} s{self._last_words()}", "hung"
                    )
                for key, _ in selector.select(left_s):
                    if key.fileobj is self._stdin:
                        unsent = unsent[self._write(unsent) :]
                        if not unsent:
                            selector.unregister(self._stdin)
                    elif not self._read(key.fileobj):
                        selector.unregister(key.fileobj)
                        if key.fileobj is self._stdout:
                            raise SlamFailedError(self._epitaph())
        answer = bytes(self._heard[:end])
        del self._heard[: end + 1]
        return answer

    def _write(self, unsent: memoryview) -> int:
        """Bytes written; all of them when nobody reads any more: its output says why."""
        try:
            return os.write(self._stdin.fileno(), unsent[:_CHUNK])
        except BlockingIOError:
            return 0
        except BrokenPipeError:
            return len(unsent)

    def _read(self, stream: object) -> bool:
        """Take what is there; False at the end."""
        source, into = (
            (self._stdout, self._heard) if stream is self._stdout else (self._stderr, self._words)
        )
        try:
            data = os.read(source.fileno(), _CHUNK)
        except BlockingIOError:
            return True
        into += data
        if source is self._stderr:
            del self._words[:-KEPT_WORDS]
        elif len(self._heard) > MAX_LINE_BYTES:
            raise SlamFailedError(f"answered a line of more than {MAX_LINE_BYTES} bytes", "bad")
        return bool(data)

    def _epitaph(self) -> str:
        """How it ended."""
        deadline = time.monotonic() + _STATUS_S
        while not (status := self._guard.status()) and time.monotonic() < deadline:
            time.sleep(0.005)
        if not status:
            return f"closed its standard output{self._last_words()}"
        return f"its process {status}{self._last_words()}"

    def _last_words(self) -> str:
        with suppress(BlockingIOError):
            while data := os.read(self._stderr.fileno(), _CHUNK):
                self._words += data
        lines = self._words[-KEPT_WORDS:].decode(errors="replace").split("\n")
        said = [text for text in (" ".join(part.split()) for part in lines) if text]
        words = " ".join(said)
        refused = "Permission denied" in words or "No module named" in words
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


def _pipes(process: subprocess.Popen[bytes]) -> tuple[IO[bytes], IO[bytes], IO[bytes]]:
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    streams = (process.stdin, process.stdout, process.stderr)
    for stream in streams:
        os.set_blocking(stream.fileno(), False)
    return streams


def _end(guard: Guard, farewell: bytes = b"", leave_s: float = _LEAVE_S) -> None:
    """Say farewell, close the guest's input, wait a moment, have it killed."""
    process = guard.process
    if process.stdin is not None and farewell:
        with suppress(OSError):
            os.write(process.stdin.fileno(), farewell)
    guard.hush()
    deadline = time.monotonic() + leave_s
    while not guard.status() and time.monotonic() < deadline:
        time.sleep(0.005)
    guard.dismiss()
