# SPDX-License-Identifier: Apache-2.0
"""A program that is run to its end, within a time limit, and always ended and reaped."""

from __future__ import annotations

import os
import resource
import selectors
import time
from collections.abc import Sequence

from slam.errors import SlamFailedError
from slam.guests.guarding import Guard
from slam.names import child_environment

_CHUNK = 1 << 16
_KEPT_WORDS = 4000  # bytes of what it prints


def run(command: Sequence[str], limit_s: float) -> float:
    """Run ``command`` without input; processor time it took, s.

    Raises ``SlamFailedError``: "hung" after ``limit_s`` of wall-clock time, "raised" where it
    cannot be started, or ends with another status than 0, with its last words.
    """
    before = _children_s()
    try:
        guard = Guard(command, child_environment(guest=True))
    except (OSError, ValueError) as error:
        raise SlamFailedError(f"cannot start {command[0]!r}: {error}") from error
    try:
        deadline = time.monotonic() + limit_s
        words = _listened(guard, deadline, limit_s)
        while not (status := guard.status()) and time.monotonic() < deadline:
            time.sleep(0.005)
    finally:
        guard.dismiss()
    if not status:
        raise SlamFailedError(f"hung: did not end within {limit_s:g} s", "hung")
    if status != "ended with status 0":
        last = " | ".join(text for line in words.splitlines() if (text := " ".join(line.split())))
        raise SlamFailedError(f"{command[0]!r} {status}: {last[-400:]!r}")
    return _children_s() - before


def _listened(guard: Guard, deadline: float, limit_s: float) -> str:
    """The end of what it prints, when it has closed both outputs."""
    process, heard = guard.process, bytearray()
    assert process.stdin is not None
    process.stdin.close()
    with selectors.DefaultSelector() as selector:
        for stream in (process.stdout, process.stderr):
            assert stream is not None
            selector.register(stream, selectors.EVENT_READ)
        while selector.get_map():
            if (left_s := deadline - time.monotonic()) <= 0.0:
                raise SlamFailedError(f"hung: did not end within {limit_s:g} s", "hung")
            for key, _ in selector.select(left_s):
                data = os.read(key.fd, _CHUNK)
                heard += data
                del heard[:-_KEPT_WORDS]
                if not data:
                    selector.unregister(key.fileobj)
    return heard.decode(errors="replace")


def _children_s() -> float:
    """Processor time of all children that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
