# SPDX-License-Identifier: Apache-2.0
"""The robot of a live view on a network of ROS 2: what it sees goes out, twists and hands come in.

Whoever is on that network drives and disturbs as a page does; every message is checked the same.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from scripts.live.requests import Drive, OnWorld
from sim.view.moment import Shown
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import InvalidValueError, MobiliaError
from slam.estimate import Raster
from slam.ros.link import Link, Topic
from slam.ros.node import decoded, pose_of
from slam.ros.robot import Robot

_STRING = "std_msgs/msg/String"
_OPEN = {"open": True, "shut": False}


def _drive(message: Any) -> OnWorld:
    twist = getattr(message, "twist", message)  # of a TwistStamped
    ahead, side = float(twist.linear.x), float(twist.linear.y)
    return Drive(v=ahead, omega=float(twist.angular.z), side=side)


def _carry(message: Any) -> OnWorld:
    x, y, theta = pose_of(message).pose.tolist()
    return Kidnap(pose=(x, y, theta))


def _push(message: Any) -> OnWorld:
    return Push(name=message.data)


def _kidnap(message: Any) -> OnWorld:
    return Kidnap(goal=message.data)


def _door(message: Any) -> OnWorld:
    word, _, name = message.data.partition(" ")
    if word not in _OPEN:
        raise InvalidValueError(f"expected 'open' or 'shut' and a door's name, got {word!r:.40}")
    return MoveDoor(opened=_OPEN[word], name=name)


TAKES = (
    (Topic(name="/cmd_vel", kind="geometry_msgs/msg/Twist"), _drive),
    (Topic(name="/cmd_vel", kind="geometry_msgs/msg/TwistStamped"), _drive),  # newer stacks
    (Topic(name="/initialpose", kind="geometry_msgs/msg/PoseWithCovarianceStamped"), _carry),
    (Topic(name="/mobilia/push", kind=_STRING), _push),
    (Topic(name="/mobilia/door", kind=_STRING), _door),
    (Topic(name="/mobilia/kidnap", kind=_STRING), _kidnap),
)
SILENCE_S = 1.0  # between two complaints: a stream of bad messages does not flood the page


class Network:
    """One robot on ``link``."""

    def __init__(self, link: Link) -> None:
        self._link, self._robot = link, Robot(link)
        self._sent = -1
        self._refused: MobiliaError | None = None
        self._told_s = -SILENCE_S
        for topic, _ in TAKES:
            link.subscribe(topic)

    def send(self, shown: Shown) -> None:
        """Publish a moment that is due; one that is looked back at is not sent again."""
        if shown.number > self._sent:
            self._sent = shown.number
            self._robot.send(shown.frame)

    def begin(self, static_map: Raster | None, height_m: float) -> None:
        """A run begins; arguments of ``Robot.restart``."""
        self._sent = -1
        self._robot.restart(static_map, height_m)

    def requests(self) -> Iterator[OnWorld]:
        """What others ask for, of each topic the last; what cannot be is kept for ``refused``."""
        for topic, read in TAKES:
            for taken in self._link.take(topic)[-1:]:
                try:
                    yield read(decoded(topic.kind, taken.data))
                except MobiliaError as error:
                    self.refuse(f"{topic.name}: {error}")

    def refuse(self, why: str) -> None:
        """Keep this to be told."""
        self._refused = InvalidValueError(f"ROS 2: {why}")

    def refused(self) -> str | None:
        """What is to be told, once a ``SILENCE_S`` at most."""
        now_s = time.monotonic()
        if self._refused is None or now_s - self._told_s < SILENCE_S:
            return None
        said, self._refused, self._told_s = str(self._refused), None, now_s
        return said

    def close(self) -> None:
        """Leave the network."""
        self._link.close()
