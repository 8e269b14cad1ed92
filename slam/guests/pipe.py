# SPDX-License-Identifier: Apache-2.0
"""A SLAM in a process of its own, in any language, spoken to over a pipe (``protocol``).

``create("pipe:./my_slam --option")`` starts such a command; ``guarded("my_package:MySlam")`` runs a
Python class the same way, so that neither its crash nor its endless loop is ours.
"""

import json
import os
import shlex
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import ReferenceType, ref

from slam.errors import InvalidValueError, SlamFailedError
from slam.estimate import Estimate, Raster
from slam.frames import Frame, LaserSpec
from slam.guests import protocol
from slam.guests.wire import Wire
from slam.interface import SlamSystem
from slam.names import child_environment, join_folders, refuse_code
from slam.oracle import Oracle
from slam.path import PosePath
from slam.shaped import Positive, check
from slam.system import create
from slam.trajectory import Trajectory
from slam.variants import COMMANDS, PIPE, oracle_of


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How long an answer may take, seconds of wall-clock time.

    scan_s   one scan
    first_s  its start, the first scan after it, a reset, the map and the final poses: compilers and
             great maps are no hang
    """

    scan_s: Positive = 10.0
    first_s: Positive = 120.0

    def __post_init__(self) -> None:
        check(self)


class PipeSlam:
    """The system behind a command. After a failure it is over; ``reset`` starts it again.

    It has ``estimates_at_end`` (``slam.interface.RunsAtTheEnd``) where its hello promises that.

    command      a line as a shell would split it (no shell runs it), or its words
    scan_limit_s, first_limit_s  see ``Limits``
    environment  of the command, None: ours

    Raises ``InvalidValueError`` for a command that cannot be started, ``SlamFailedError`` with its
    outcome for everything that goes wrong behind it.
    """

    def __init__(
        self,
        command: str | Sequence[str],
        *,
        scan_limit_s: float = Limits.scan_s,
        first_limit_s: float = Limits.first_s,
        environment: dict[str, str] | None = None,
    ) -> None:
        self.limits = Limits(scan_s=scan_limit_s, first_s=first_limit_s)
        self._command = _words(command)
        self._environment = child_environment(guest=True) if environment is None else environment
        self._start()

    def _start(self) -> None:
        bye = protocol.line({"type": "bye"})
        self._wire = Wire(self._command, self._environment, farewell=bye)
        with self._over_if_it_fails():
            hello = protocol.line(protocol.hello_message())
            said = self._ask("hello", hello, self.limits.first_s)
            protocol.check_hello(said)
        self._born_bytes = self._wire.memory_bytes("VmRSS")
        self._has_map, self._has_trajectory = (
            said.get(key) is True for key in ("map", "trajectory")
        )
        if said.get("estimates_at_end") is True:
            self.estimates_at_end = partial(_at_end, ref(self))  # a cycle would keep the process
        self._forget()

    def _forget(self) -> None:
        self._laser: LaserSpec | None = None
        self._path = PosePath()

    def _ask(self, wanted: str, request: bytes, limit_s: float) -> dict[str, Any]:
        """The answer, which must be of the type ``wanted``."""
        if not self._wire.open:
            raise SlamFailedError("is over since it failed")
        with self._over_if_it_fails():
            message = protocol.message_of(self._wire.ask(request, limit_s))
            if message.get("type") not in (wanted, "error"):
                raise SlamFailedError(
                    f"answered {message.get('type')!r:.40} where {wanted!r} was expected", "bad"
                )
        if message["type"] == "error":
            raise protocol.failure_of(message)
        return message

    @contextmanager
    def _over_if_it_fails(self) -> Iterator[None]:
        """Who is out of step once is not asked again."""
        try:
            yield
        except SlamFailedError:
            self.close()
            raise

    def reset(self) -> None:
        """Forget everything; the next frame is the first."""
        if not self._wire.open:
            self._start()
            return
        self._ask("reset", protocol.line({"type": "reset"}), self.limits.first_s)
        self._forget()

    def update(self, frame: Frame) -> Estimate:
        """Send the frame, without truth, and read the estimate.

        Raises ``InvalidValueError`` for a frame that does not come after the last one.
        """
        self._path.check_order(frame.stamp_ns)
        request = protocol.frame_line(frame, self._laser)
        limit_s = self.limits.scan_s if len(self._path) else self.limits.first_s
        with self._over_if_it_fails():
            message = self._ask("estimate", request, limit_s)
            estimate = protocol.estimate_of(message, frame.stamp_ns)
        if frame.scan is not None:
            self._laser = frame.scan.spec
        self._path.add(frame.stamp_ns, estimate.T_map_robot)
        return estimate

    def map(self) -> Raster | None:
        """Its map, None where its hello promised none."""
        if not self._has_map:
            return None
        request = protocol.line({"type": "map"})
        return protocol.map_of(self._ask("map", request, self.limits.first_s))

    def trajectory(self) -> Trajectory:
        """Its final poses; the online ones where its hello promised none."""
        if self._has_trajectory:
            request = protocol.line({"type": "trajectory"})
            return protocol.trajectory_of(self._ask("trajectory", request, self.limits.first_s))
        return self._path.trajectory()

    def asked_at_end(self) -> list[tuple[Estimate, float]]:
        """Its estimate of each frame so far, and the processor time each took, s."""
        stamps = self._path.trajectory().stamps_ns.tolist()
        limit_s = self.limits.first_s + len(stamps) * self.limits.scan_s
        request = protocol.line({"type": "estimates_at_end"})
        message = self._ask("estimates_at_end", request, limit_s)
        with self._over_if_it_fails():
            return protocol.at_end_of(message, stamps)

    def processor_s(self) -> float:
        """Processor time its process has used, s; wall-clock time where no system says it."""
        spent = self._wire.processor_s()
        return time.monotonic() if spent is None else spent

    def memory_growth_bytes(self) -> int | None:
        """The most resident memory its process has had, over that after its hello."""
        peak = self._wire.memory_bytes("VmHWM")
        return None if peak is None or self._born_bytes is None else peak - self._born_bytes

    def close(self) -> None:
        """End its process; happens by itself when the object goes."""
        self._wire.close()


def _at_end(of: ReferenceType[PipeSlam]) -> list[tuple[Estimate, float]]:
    slam = of()
    assert slam is not None
    return slam.asked_at_end()


def _words(command: str | Sequence[str]) -> list[str]:
    try:
        words = shlex.split(command) if isinstance(command, str) else list(command)
    except ValueError as error:
        raise InvalidValueError(f"'{PIPE}{command}': {error}") from error
    if not words:
        raise InvalidValueError(f"'{PIPE}' needs a command, as in {PIPE}./my_slam --option")
    return words


def guarded(name: str, limits: Limits | None = None, **config: Any) -> PipeSlam:
    """``create(name, **config)`` in a child process: what it does there cannot stop this one."""
    limits = limits or Limits()
    refuse_code(name, "SLAM")
    join_folders()
    words = [sys.executable, "-m", "slam.guests.serve", name]
    if config:
        words += ["--options", json.dumps(config)]
    path = os.pathsep.join(folder or os.getcwd() for folder in sys.path)
    try:
        return PipeSlam(
            words,
            scan_limit_s=limits.scan_s,
            first_limit_s=limits.first_s,
            environment={**child_environment(guest=False), "PYTHONPATH": path},
        )
    except SlamFailedError as error:
        where = f"SLAM '{name}' cannot be made:"
        if error.message.startswith(where):  # the child has said so
            raise
        raise error.at(where) from error


def limited(name: str, limits: Limits | None) -> SlamSystem:
    """``create(name)`` for comparisons: with limits, whatever is not ours runs in a child."""
    if limits is None or ":" not in name:
        return create(name)
    if (wanted := oracle_of(name)) is not None:  # its labels stay on this side
        refuse_code(name, "SLAM")
        return Oracle(limited(wanted[0], limits), wanted[1])
    if name.startswith(COMMANDS):
        return create(name, scan_limit_s=limits.scan_s, first_limit_s=limits.first_s)
    return guarded(name, limits)
