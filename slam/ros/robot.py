# SPDX-License-Identifier: Apache-2.0
"""A robot on the network: frames go out as its drivers would send them."""

from __future__ import annotations

from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import Frame
from slam.ros.frames import LATCHED, SCANS, STATE, FrameMessages
from slam.ros.link import Link, Topic

_RENAMED = {"/map": "/ground_truth/map"}  # "/map" is the SLAM's
_UNSENT = frozenset(("/initialpose",))  # somebody else's to say
_LOSSY = frozenset(("/clock", *SCANS))  # sensor data: best effort, as drivers have it
_DEPTHS = {"/clock": 1, "/tf": 100, "/scan": 5, "/scan_turn": 10}


def topics(*, paced: bool = False) -> dict[str, Topic]:
    """What is published, by the name that it has in a bag.

    paced  whether each message is waited for: then none may be lost
    """
    found = {}
    for name, kind in {**STATE, **SCANS}.items():
        if name in _UNSENT:
            continue
        latched = name in LATCHED
        found[name] = Topic(
            name=_RENAMED.get(name, name),
            kind=kind,
            reliable=paced or name not in _LOSSY,
            latched=latched,
            depth=1 if latched else _DEPTHS.get(name, 10),
        )
    return found


class Robot:
    """Publishes frames.

    height_m  of the scanner, for /tf_static
    paced     as of ``topics``
    """

    def __init__(self, link: Link, *, height_m: float = 0.0, paced: bool = False) -> None:
        self._link, self._height_m = link, height_m
        self.topics = topics(paced=paced)
        for topic in self.topics.values():
            link.advertise(topic)
        self._messages: FrameMessages | None = None
        self._map: Raster | None = None

    def restart(self, static_map: Raster | None = None, height_m: float | None = None) -> None:
        """The next frame is the first of another drive; what never moves is /ground_truth/map.

        height_m  of the scanner from now on; None: as it was
        """
        self._messages, self._map = None, static_map
        self._height_m = self._height_m if height_m is None else height_m

    def send(self, frame: Frame) -> None:
        """All messages of a frame; without a scan, only those about its motion."""
        scan, messages = frame.scan, self._messages
        if messages is None:
            if scan is None:
                raise InvalidValueError("ROS 2: the first frame has no scan to say its scanner by")
            messages = self._messages = FrameMessages(
                scan.spec,
                height_m=self._height_m,
                static_map=self._map,
                intensities=scan.intensities is not None,
            )
            for topic, _, data in messages.begin(frame):
                self._put(topic, data)
        for topic, _, data in messages.state(frame):
            self._put(topic, data)
        if scan is not None:
            for topic, _, data in messages.scans(frame):
                self._put(topic, data)

    def _put(self, topic: str, data: bytearray) -> None:
        if topic in self.topics:
            self._link.publish(self.topics[topic], bytes(data))
