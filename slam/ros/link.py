# SPDX-License-Identifier: Apache-2.0
"""The network as ROS 2 nodes see it: topics that carry the bytes of messages, both ways.

Two middlewares carry them: DDS (``dds``, what ROS 2 speaks by default) and Zenoh (``zenoh``, for
nodes with ``rmw_zenoh_cpp``). Messages are the same bytes in both: CDR, as in a bag.
"""

import importlib
import os
import re
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from slam.errors import InvalidValueError, MissingDependencyError

MIDDLEWARES = ("dds", "zenoh")
MOST_DOMAIN = 232  # ports of a DDS domain end there
NODE = "mobilia"
_PACKAGES = {"dds": "cyclonedds", "zenoh": "eclipse-zenoh"}
_NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A topic and its quality of service.

    name   as ROS has it: "/scan"; a namespace comes before it, but for names of ROS itself
    kind   "sensor_msgs/msg/LaserScan"; of two kinds under one name each is a topic of its own
    reliable  sent again until it is received, else best effort
    latched   the last message is kept for who comes later (transient local)
    depth     messages that are kept for a slow reader
    waits     whether publishing over Zenoh may wait for seconds where the network is busy or cut
    """

    name: str
    kind: str
    reliable: bool = True
    latched: bool = False
    depth: int = 10
    waits: bool = False

    def within(self, namespace: str) -> str:
        """Its full name; clock and transforms are the same for all robots."""
        return self.name if self.name in ("/clock", "/tf", "/tf_static") else namespace + self.name


class Taken(NamedTuple):
    """Bytes that came on a topic, and who sent them: the same word as long as the sender lives."""

    data: bytes
    sender: str


class Link(Protocol):
    """One node on the network, in one thread. It does not hear itself."""

    def advertise(self, topic: Topic) -> None:
        """Show that messages will come; before the first, so that nobody misses it."""

    def publish(self, topic: Topic, data: bytes) -> None:
        """Send a message."""

    def subscribe(self, topic: Topic) -> None:
        """Listen from now on."""

    def take(self, topic: Topic) -> list[Taken]:
        """What has come since it was last asked, the oldest first; never waits."""

    def wait(self, timeout_s: float) -> None:
        """Until something may have come, or for so long."""

    def listeners(self, topic: Topic) -> int:
        """Who listens to a topic that is published: how many, or 1 for any number."""

    def close(self) -> None:
        """Leave the network."""


def open_link(
    middleware: str, *, domain: int | None = None, namespace: str | None = None, router: int = 7447
) -> Link:
    """A node on the network.

    middleware  "dds" or "zenoh"
    domain      0..232; None: the environment's ROS_DOMAIN_ID, or 0
    router      port at which nodes of Zenoh meet
    namespace   "/robot1" before the names of topics; None: the environment's ROS_NAMESPACE, or none

    Raises ``MissingDependencyError`` where the extra is not installed, ``InvalidValueError``.
    """
    if middleware not in MIDDLEWARES:
        known = " or ".join(MIDDLEWARES)
        raise InvalidValueError(f"a middleware of ROS 2 is {known}, got {middleware!r}")
    domain = domain_of_environment() if domain is None else domain
    if not 0 <= domain <= MOST_DOMAIN:
        raise InvalidValueError(f"ROS_DOMAIN_ID must lie in 0..{MOST_DOMAIN}, got {domain}")
    spoken = os.environ.get("ROS_NAMESPACE", "") if namespace is None else namespace
    before = "/" + spoken.strip("/") if spoken.strip("/") else ""
    if not _NAMESPACE.fullmatch(before):
        raise InvalidValueError(f"ROS_NAMESPACE must be names between '/', got {spoken!r:.80}")
    try:
        module = importlib.import_module(f"slam.ros.{middleware}_link")
    except ImportError as error:
        raise MissingDependencyError(
            f"ROS 2 over {middleware} needs {_PACKAGES[middleware]}: pip install 'mobilia[ros2]'"
        ) from error
    link: Link = module.open_link(domain, before, router)
    return link


def domain_of_environment() -> int:
    """ROS_DOMAIN_ID; ``InvalidValueError`` for what is no number."""
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isdecimal():
        raise InvalidValueError(f"ROS_DOMAIN_ID must be a whole number, got {text!r:.40}")
    return int(text)


def open_to_others() -> bool:
    """Whether other machines may see us: ROS's own variable, closed where it says nothing."""
    return os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper() == "SUBNET"


def type_name(kind: str) -> str:
    """Name of a type there: "sensor_msgs::msg::dds_::LaserScan_" of "sensor_msgs/msg/LaserScan"."""
    package, _, own = kind.rpartition("/")
    return f"{package.replace('/', '::')}::dds_::{own}_"
