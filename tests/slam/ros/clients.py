# SPDX-License-Identifier: Apache-2.0
"""Domains of their own, and clients in them."""

import os
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from slam.ros.link import Link, open_link
from slam.ros.robot import Robot
from slam.ros.slam import Domain

ANYWHERE = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}  # what ROS does by default
PREFIXES = {"dds": "ros2", "zenoh": "ros2-zenoh"}  # of SLAMs


@contextmanager
def started(
    words: Sequence[object], domain: Domain, **environment: str
) -> Iterator[subprocess.Popen[str]]:
    """A client that listens, until it is let go."""
    out = {"stdout": subprocess.PIPE, "text": True}
    inherited = {**os.environ, **domain.environment(), **environment}
    with subprocess.Popen([*map(str, words)], env=inherited, **out) as child:
        assert child.stdout.readline() == "ready\n"
        try:
            yield child
        finally:
            child.kill()


@contextmanager
def on(middleware: str) -> Iterator[tuple[Domain, Link]]:
    """A link in a domain of its own."""
    domain = Domain(middleware, own=True, wait_s=10.0)
    link = open_link(middleware, domain=domain.number, router=domain.router)
    yield domain, link
    link.close()
    domain.free()


def met(link: Link, robot: Robot, clients: int = 1) -> None:
    """Until so many clients listen to the scans, and have found their sender in their turn."""
    while link.listeners(robot.topics["/scan"]) < clients:
        time.sleep(0.02)
    time.sleep(1.0)
