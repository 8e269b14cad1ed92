# SPDX-License-Identifier: Apache-2.0
"""A SLAM of this project as a ROS 2 node: scans in, map -> odom out, without ROS.

    python -m slam.ros.serve shunting dds

It hears /scan, /odom and /tf_static, and says /tf, /pose and, each second, /map. Domain and
namespace are those of ``slam.ros.link``. Ctrl-C ends it.
"""

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from typing import Any

import numpy as np

from slam import se2
from slam.answers import asked, asked_map
from slam.errors import MobiliaError
from slam.frames import NS_PER_S, Frame
from slam.logs.bag import Assembly
from slam.logs.bag_laser import Laser, stamp_of
from slam.logs.bag_tf import MOST_TRANSFORMS, mounting
from slam.logs.bag_topics import Topics
from slam.ros.link import Link, Topic, open_link
from slam.ros.messages import MAP, ODOM, MapMessage, PoseMessage, TransformMessage
from slam.ros.node import GRID, POSES, TF, decoded
from slam.ros.robot import topics
from slam.ros.template import EPOCH_NS
from slam.system import SlamSystem, create

MAP_NS = NS_PER_S  # between two maps
MOST_WAITING = 1000  # messages of a topic, until the first scan and odometry are there
FIRST_S = 0.3  # that the first scan waits for what comes with it
_log = logging.getLogger(__name__)
_SCAN, _TURNS, _ODOM, _STEPS, _STATIC = (
    replace(topics()[name], depth=100)
    for name in ("/scan", "/scan_turn", "/odom", "/odom_increment", "/tf_static")
)
_TF, _POSE, _MAP = (replace(topic, waits=True) for topic in (TF, POSES[0], GRID))
_HEARD = (_SCAN, _TURNS, _ODOM, _STEPS, _STATIC)


class Served:
    """One SLAM on a link; frames are put together as out of a bag (``slam.logs.bag``)."""

    def __init__(self, link: Link, system: SlamSystem) -> None:
        self._link, self._system = link, system
        for topic in reversed(_HEARD):  # who waits for a listener to scans has the others, too
            link.subscribe(topic)
        for topic in (_TF, _POSE, _MAP):
            link.advertise(topic)
        self._tf, self._pose = TransformMessage((MAP, ODOM, 0.0)), PoseMessage(MAP)
        self._links: dict[tuple[str, str], Any] = {}
        self._waiting: dict[Topic, list[Any]] = {topic: [] for topic in _HEARD}
        self._assembly: Assembly | None = None
        self._map_ns = -MAP_NS

    def turn(self) -> None:
        """Take what has come and answer it."""
        self._link.wait(0.5)
        for topic in _HEARD:  # scans first: what belongs to them was sent before them
            self._waiting[topic] = (self._waiting[topic] + self._taken(topic))[-MOST_WAITING:]
        for message in self._waiting[_STATIC]:
            for link in message.transforms[: MOST_TRANSFORMS - len(self._links)]:
                self._links[(link.header.frame_id, link.child_frame_id)] = link.transform
        if self._assembly is None:
            if not self._waiting[_SCAN] or not self._waiting[_ODOM]:
                return
            self._assembly = self._begin()
        now_ns = time.monotonic_ns()
        for topic in (_STEPS, _ODOM, _SCAN):
            for message in self._waiting[topic]:
                with _reading(topic):
                    self._assembly.take(topic.name, now_ns, message)
        for waiting in self._waiting.values():
            waiting.clear()
        for frame in self._assembly.ready(now_ns):
            self._answer(frame)

    def _taken(self, topic: Topic) -> list[Any]:
        found = []
        for taken in self._link.take(topic):
            with _reading(topic):
                found.append(decoded(topic.kind, taken.data))
        return found

    def _begin(self) -> Assembly:
        """The scanner, from the first scan and what came with it."""
        time.sleep(FIRST_S)
        for topic in _HEARD[1:]:
            self._waiting[topic] += self._taken(topic)
        first, odometry = self._waiting[_SCAN][0], self._waiting[_ODOM][0]
        began_ns = stamp_of(first, 0)
        end_ns = began_ns + round(first.scan_time * NS_PER_S)
        turns = [t for t in self._waiting[_TURNS] if began_ns <= stamp_of(t, 0) < end_ns]
        mount = mounting(self._links, odometry.child_frame_id, first.header.frame_id)
        laser = Laser(first, turns, (np.zeros(3), False) if mount is None else mount)
        steps = _STEPS.name if self._waiting[_STEPS] else None
        known = Topics(
            scan=_SCAN.name, odometry=_ODOM.name, truth=None, turns=None, increment=steps,
            labels=None, transforms=(),
        )  # fmt: skip
        return Assembly(known, laser, EPOCH_NS if began_ns >= EPOCH_NS else 0)

    def _answer(self, frame: Frame) -> None:
        estimate = asked(self._system, frame)
        T_map_odom = se2.compose(estimate.T_map_robot, se2.inverse(frame.odometry.T_odom_robot))
        stamp_ns = frame.stamp_ns
        said = bytes(self._pose(stamp_ns, estimate.T_map_robot, estimate.covariance))
        self._link.publish(_POSE, said)
        self._link.publish(_TF, bytes(self._tf(stamp_ns, T_map_odom)))
        if stamp_ns - self._map_ns >= MAP_NS:
            self._map_ns = stamp_ns
            raster = asked_map(self._system)
            if raster is not None:
                self._link.publish(_MAP, bytes(MapMessage(raster)(stamp_ns)))


@contextmanager
def _reading(topic: Topic) -> Iterator[None]:
    """A message of strangers that cannot be used is left out."""
    try:
        yield
    except MobiliaError as error:
        _log.warning("%s: left out: %s", topic.name, error)


def main(name: str, middleware: str = "dds") -> None:
    """Serve until interrupted."""
    link = open_link(middleware)
    served = Served(link, create(name))
    with closing(link), suppress(KeyboardInterrupt):
        while True:
            served.turn()


if __name__ == "__main__":
    main(*sys.argv[1:3])
