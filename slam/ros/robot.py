# SPDX-License-Identifier: Apache-2.0
"""A robot on the network: frames go out as its drivers would send them."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

from slam.estimate import Raster
from slam.frames import Frame
from slam.ros.frames import SCANS, STATE, FrameMessages, Message
from slam.ros.link import Link, Topic

_RENAMED = {"/map": "/ground_truth/map"}  # "/map" is the SLAM's
_UNSENT = frozenset(("/initialpose",))  # somebody else's to say


def topics(*, paced: bool = False) -> dict[str, Topic]:
    """What is published, by the name that it has in a bag.

    paced  whether each message is waited for: then none may be lost
    """
    return {
        topic.name: replace(
            topic,
            name=_RENAMED.get(topic.name, topic.name),
            reliable=paced or topic.reliable,
            waits=paced,
        )
        for topic in (*STATE, *SCANS)
        if topic.name not in _UNSENT
    }


class Robot:
    """Publishes frames.

    paced  as of ``topics``
    """

    def __init__(self, link: Link, *, paced: bool = False) -> None:
        self._link, self.topics = link, topics(paced=paced)
        for topic in self.topics.values():
            link.advertise(topic)
        self.restart()

    def restart(self, static_map: Raster | None = None, height_m: float = 0.0) -> None:
        """The next frame is the first of another drive.

        static_map  what never moves, for /ground_truth/map
        height_m    of the scanner, for /tf_static
        """
        self._messages: FrameMessages | None = None
        self._map, self._height_m = static_map, height_m

    def send(self, frame: Frame) -> None:
        """All messages of a frame; without a scan, only those about its motion.

        Nothing before the first scan, which says what scanner it is.
        """
        scan, messages, said = frame.scan, self._messages, list[Iterator[Message]]()
        if messages is None:
            if scan is None:
                return
            messages = self._messages = FrameMessages(
                scan.spec,
                height_m=self._height_m,
                static_map=self._map,
                intensities=scan.intensities is not None,
            )
            said.append(messages.begin(frame))
        said.append(messages.state(frame))
        if scan is not None:
            said.append(messages.scans(frame))
        for topic, _, data in chain(*said):
            if topic in self.topics:
                self._link.publish(self.topics[topic], bytes(data))
