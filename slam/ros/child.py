# SPDX-License-Identifier: Apache-2.0
"""The node that a command starts, and the domain that it has to itself."""

from __future__ import annotations

import fcntl
import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from slam.errors import InvalidValueError, SlamFailedError
from slam.guests.wire import Guard
from slam.names import child_environment
from slam.ros.link import MOST_DOMAIN, domain_of_environment, open_to_others

ROUTER = 7447  # port of rmw_zenohd
_KEPT_WORDS = 2000  # bytes of what it says
_DRAIN_S = 0.001
LEASE_S = 15.0  # s; DDS takes an ended node for alive for 10 s, and a scan sent meanwhile is lost


class Domain:
    """A number that one world at a time uses on this machine: two of them would drive one node.

    own  any free number but the environment's; else that one, waited for
    """

    def __init__(self, middleware: str, *, own: bool, wait_s: float) -> None:
        self.middleware, self.own = middleware, own
        first = domain_of_environment()
        among = [(first + k) % (MOST_DOMAIN + 1) for k in range(1, 100)] if own else [first]
        deadline = time.monotonic() + wait_s
        while True:
            for number in among:
                if self._held(number):
                    return
            if time.monotonic() > deadline:
                raise SlamFailedError(
                    f"another run uses ROS_DOMAIN_ID {first}: let one run at a time ask this "
                    "node, or let each start its own by ros2:COMMAND", "hung",
                )  # fmt: skip
            time.sleep(0.1)

    def _held(self, number: int) -> bool:
        """Whether the number is ours now."""
        name = f"mobilia-{os.getuid()}-{self.middleware}-{number}.lock"
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW
        file = os.open(Path(tempfile.gettempdir(), name), flags, 0o600)
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            used = os.fstat(file)
            if not self.own or not used.st_size or time.time() - used.st_mtime > LEASE_S:
                self.number, self._file = number, file
                return True
        os.close(file)
        return False

    @property
    def router(self) -> int:
        """Port of the Zenoh router."""
        return ROUTER + self.number if self.own else ROUTER

    def environment(self) -> Mapping[str, str]:
        """Of the node."""
        more = {"ROS_DOMAIN_ID": str(self.number)}
        if self.middleware == "zenoh":
            where = f'connect/endpoints=["tcp/127.0.0.1:{self.router}"]'
            more |= {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp", "ZENOH_CONFIG_OVERRIDE": where}
        if not open_to_others():
            more |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_LOCALHOST_ONLY": "1"}
        return {**child_environment(guest=True), **more}

    def free(self) -> None:
        """Another may have it, once a node that was ended here is forgotten."""
        os.pwrite(self._file, b"used", 0)
        os.close(self._file)


class Child:
    """``command`` below a guard, which ends it and all that it started with us.

    Raises ``InvalidValueError`` where it cannot be started.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str]) -> None:
        try:
            self._guard = Guard(command, environment)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise InvalidValueError(f"cannot start {command[0]!r}: {why}") from error
        self._words = bytearray()

    def ended(self) -> str:
        """How it has ended, with its last words; "" where it lives. What it says is drained."""
        self._guard.talk(b"", time.monotonic() + _DRAIN_S, self._hear)
        how = self._guard.status()
        if not how:
            return ""
        lines = self._words.decode(errors="replace").split("\n")
        said = [text for line in lines if (text := " ".join(line.split()))]
        return f"{how}; its last words: {' | '.join(said[-3:])[-400:]!r}" if said else how

    def _hear(self, _stream: int, data: bytes) -> bool:
        self._words += data
        del self._words[:-_KEPT_WORDS]
        return False

    def end(self) -> None:
        """Now."""
        self._guard.dismiss()
