# SPDX-License-Identifier: Apache-2.0
"""A ROS 2 node as a SLAM: scans go out on the network, its map -> odom comes back.

``create("ros2")`` asks the node that is there; ``create("ros2:COMMAND")`` starts one, with
``ROS_DOMAIN_ID`` set to a number of its own. "ros2-zenoh" is the same for ``rmw_zenoh_cpp``.

A scan is sent when the node has answered the one before, or ``ANSWER_S`` after it. The answer is a
transform "map" -> "odom" on /tf with the scan's stamp or a later one; a pose on /pose or /amcl_pose
at the stamp of a scan counts where no such transform ever came. Until the next answer the last one
stands, carried on by odometry. No run repeats to the byte: what a node says depends on its clock.
A node that is started here has a domain of its own.
"""

import fcntl
import os
import shlex
import tempfile
import time
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from slam.errors import InvalidValueError, SlamFailedError
from slam.estimate import Estimate, Raster
from slam.frames import Frame
from slam.guests.pipe import Limits
from slam.guests.wire import Guard, started
from slam.names import child_environment
from slam.path import OnPath, PosePath
from slam.ros.link import MOST_DOMAIN, Link, domain_of_environment, open_link, open_to_others
from slam.ros.messages import MAP, ODOM
from slam.ros.node import Node
from slam.ros.robot import Robot
from slam.ros.template import said_ns

ROUTER = 7447  # port of rmw_zenohd
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


SETTLE_S = 0.5  # from our finding the node to its finding us: what is sent before may be lost
ANSWER_S = 1.0  # that a scan's answer is waited for, wall clock: a node may skip scans


class Ros2Slam(OnPath):
    """A ROS 2 node over DDS: the one that is there, or that a command starts.

    command  words as a shell would split them (no shell runs it), "" for a node that runs already
    scan_limit_s   of silence, wall clock: then the node counts as hung
    first_limit_s  until it listens to /scan, and until its first answer

    Raises ``InvalidValueError`` for a command that cannot be started, ``MissingDependencyError``
    without the extra, ``SlamFailedError`` with its outcome for what goes wrong on the other side.
    After a failure it is over; ``reset`` starts it again.
    """

    middleware = "dds"

    def __init__(
        self,
        command: str = "",
        *,
        scan_limit_s: float = Limits.scan_s,
        first_limit_s: float = Limits.first_s,
    ) -> None:
        self._limits = Limits(scan_s=scan_limit_s, first_s=first_limit_s)
        try:
            self._command = shlex.split(command)
        except ValueError as error:
            raise InvalidValueError(f"'{command}': {error}") from error
        self._other: _Other | None = None
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next frame is the first. A command is started again then."""
        self.close()
        self._path, self._over, self._waited_s = PosePath(), False, 0.0

    def update(self, frame: Frame) -> Estimate:
        """Send the frame and wait for the answer.

        Raises ``SlamFailedError``: "hung" for a node that says nothing, "raised" for one that has
        ended, and whatever ``Robot.send`` does.
        """
        self._path.check_order(frame.stamp_ns)
        if self._over:
            raise SlamFailedError("is over since it failed")
        began_s = time.monotonic()
        try:
            if self._other is None:
                self._other = _Other(self.middleware, self._command, self._limits)
            answered = self._other.ask(frame)
        except BaseException:
            self.close()
            self._over = True
            raise
        self._waited_s += time.monotonic() - began_s
        node = self._other.node
        estimate = node.estimate({"answered": answered, **node.odd})
        self._path.add(frame.stamp_ns, estimate.T_map_robot)
        return estimate

    def map(self) -> Raster | None:
        """What it says on /map, None where it does not."""
        return None if self._other is None else self._other.node.map()

    def processor_s(self) -> float:
        """Time waited for its answers, wall clock, s: its processor time is not known here."""
        return self._waited_s

    def close(self) -> None:
        """Leave the network and end what was started; happens by itself when the object goes."""
        if self._other is not None:
            self._other.close()
            self._other = None


class Ros2ZenohSlam(Ros2Slam):
    """A ROS 2 node over Zenoh (``rmw_zenoh_cpp``), the same way."""

    middleware = "zenoh"


class _Other:
    """The other side: a link, a node on it, and the process where we started one."""

    def __init__(self, middleware: str, command: Sequence[str], limits: Limits) -> None:
        self._limits, self._first = limits, True
        domain = Domain(middleware, own=bool(command), wait_s=limits.first_s)
        link: Link | None = None
        child: Guard | None = None
        try:
            link = open_link(middleware, domain=domain.number, router=domain.router)
            self.node, self._robot = Node(link), Robot(link, paced=True)
            if command:
                child = started(command, domain.environment())
        finally:
            self.close = weakref.finalize(self, _leave, link, child, domain)
        self._link, self._child, self._domain = link, child, domain

    def ask(self, frame: Frame) -> bool:
        """Send a frame; whether it was answered in time."""
        if self._first:
            self._meet()
        self.node.sent(frame.odometry, said_ns(frame.stamp_ns))
        self._robot.send(frame)
        answered = frame.scan is None
        deadline = time.monotonic() + ANSWER_S
        while not answered:
            answered = self.node.answered()
            left_s = deadline - time.monotonic()
            if answered or left_s <= 0.0:
                break
            self._link.wait(min(left_s, 0.1))
            self._check_alive()
        self._check_heard(answered)
        return answered

    def _meet(self) -> None:
        """Wait until somebody listens to /scan."""
        scan, deadline = self._robot.topics["/scan"], time.monotonic() + self._limits.first_s
        while not self._link.listeners(scan):
            self._check_alive()
            if time.monotonic() > deadline:
                raise SlamFailedError(
                    f"hung: nobody listens to /scan after {self._limits.first_s:g} s "
                    f"(ROS_DOMAIN_ID {self._domain.number})", "hung",
                )  # fmt: skip
            time.sleep(0.02)
        time.sleep(SETTLE_S)
        self._first, self._heard_s = False, time.monotonic()

    def _check_alive(self) -> None:
        if self._child is not None and (how := self._child.ended()):
            raise SlamFailedError(f"its process {how}")

    def _check_heard(self, answered: bool) -> None:
        """``SlamFailedError`` after too long a silence."""
        now_s = time.monotonic()
        if answered:
            self._heard_s = now_s
        begun = self.node.T_own_odom is not None
        limit_s = self._limits.scan_s if begun else self._limits.first_s
        if now_s - self._heard_s > limit_s:
            raise SlamFailedError(
                f"hung: no transform {MAP} -> {ODOM} for {limit_s:g} s{self.node.why_silent()}",
                "hung",
            )


def _leave(link: Link | None, child: Guard | None, domain: Domain) -> None:
    if child is not None:
        child.dismiss()
    if link is not None:
        link.close()
    domain.free()
