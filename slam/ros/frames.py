# SPDX-License-Identifier: Apache-2.0
"""Frames as the messages of their topics: what a bag holds and what goes over the network."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from slam import se2
from slam._jit import njit
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import NS_PER_S, Float, Frame, LaserSpec, Odometry
from slam.laser_scan import turn_time_s, turns_of
from slam.ros import messages as ros
from slam.ros.link import Topic

BEGAN = "/ground_truth/time"  # read by ``slam.logs.bag_topics``, too
_LATCHED: dict[str, Any] = {"latched": True, "depth": 1}  # sent once, kept for who comes later
STATE = (  # in the order of a bag's connections
    Topic(name=BEGAN, kind=ros.BeganMessage.KIND, **_LATCHED),
    Topic(name="/clock", kind=ros.ClockMessage.KIND, reliable=False, depth=1),
    Topic(name="/map", kind=ros.MapMessage.KIND, **_LATCHED),
    Topic(name="/initialpose", kind=ros.PoseMessage.KIND),
    Topic(name="/tf_static", kind=ros.TransformMessage.KIND, **_LATCHED),
    Topic(name="/tf", kind=ros.TransformMessage.KIND, depth=100),
    Topic(name="/odom", kind=ros.OdometryMessage.KIND),
    Topic(name="/odom_increment", kind=ros.PoseMessage.KIND),
    Topic(name="/ground_truth/pose", kind=ros.TruthMessage.KIND),
    Topic(name="/ground_truth/tf", kind=ros.TransformMessage.KIND),
)
SCANS = (  # best effort, as drivers have it
    Topic(name="/scan", kind=ros.ScanMessage.KIND, reliable=False, depth=5),
    Topic(name="/scan_turn", kind=ros.ScanMessage.KIND, reliable=False),
)


class Message(NamedTuple):
    """One message; ``data`` is valid until the next of its topic."""

    topic: str
    stamp_ns: int
    data: bytearray


@njit
def _accumulate(covariance: Float, theta: float, step: Float, increment: Float) -> None:
    """``se2.propagate`` in place, without NumPy's matmul: F P F' + G Q G'."""
    c, s = math.cos(theta), math.sin(theta)
    carry, turn = np.eye(3), np.eye(3)
    carry[0, 2], carry[1, 2] = -s * step[0] - c * step[1], c * step[0] - s * step[1]
    turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1] = c, -s, s, c
    out = np.zeros((3, 3))
    for i in range(3):
        for j in range(i + 1):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    total += carry[i, k] * covariance[k, m] * carry[j, m]
                    total += turn[i, k] * increment[k, m] * turn[j, m]
            out[i, j] = out[j, i] = total
    covariance[:] = out


class _Wheels:
    """/odom, /tf and /odom_increment of one frame after another."""

    def __init__(self) -> None:
        self.odometry, self.increment = ros.OdometryMessage(), ros.PoseMessage()
        self.tf = ros.TransformMessage((ros.ODOM, ros.FOOTPRINT, 0.0))
        self._covariance, self._known = np.zeros((3, 3)), True
        self._last: Odometry | None = None

    def next(self, now: Odometry) -> tuple[bytearray, bytearray, bytearray | None]:
        """The messages of these three topics, the last only with an increment's covariance."""
        last, self._last = self._last, now
        dt, step, theta = 0.0, np.zeros(3), float(now.T_odom_robot[2])
        if last is not None:
            dt = (now.stamp_ns - last.stamp_ns) / NS_PER_S
            step = se2.between(last.T_odom_robot, now.T_odom_robot)
            theta = float(last.T_odom_robot[2])
        spread = now.increment_covariance
        self._known = self._known and spread is not None
        if spread is not None:
            _accumulate(self._covariance, theta, step, spread)
        return (
            self.odometry(now, self._covariance if self._known else None, dt),
            self.tf(now.stamp_ns, now.T_odom_robot),
            None if spread is None else self.increment(now.stamp_ns, step, spread),
        )


def place_of(number: int) -> str:
    """What topics and the frame of that scanner of a robot end in: the first, 0, in nothing."""
    return f"_{number + 1}" if number else ""


def scan_topics(number: int) -> tuple[Topic, ...]:
    """``SCANS`` of that scanner of a robot."""
    return tuple(
        replace(topic, name=topic.name.replace("/scan", f"/scan{place_of(number)}"))
        for topic in SCANS
    )


class _Scans:
    """The scans of one scanner, whole and turn by turn."""

    def __init__(self, spec: LaserSpec, number: int, *, intensities: bool) -> None:
        self.spec, turns = spec, turns_of(spec)
        turn_s = turn_time_s(spec, turns)
        whole, turn = (topic.name for topic in scan_topics(number))
        parts = [(whole, ros.Part(turns * turn_s, 0, 1))]
        parts += [(turn, ros.Part(turn_s, k, turns)) for k in range(turns)]
        frame = ros.LASER + place_of(number)
        self._messages = [
            (topic, ros.ScanMessage(spec, part, frame=frame, intensities=intensities))
            for topic, part in parts
        ]

    def __call__(self, frame: Frame) -> Iterator[Message]:
        """Raises ``InvalidValueError`` for a frame without a scan or of another scanner."""
        scan = frame.scan
        if scan is None or (scan.spec is not self.spec and scan.spec != self.spec):
            raise InvalidValueError("messages are of one scanner: this frame has another one")
        for topic, message in self._messages:
            yield Message(topic, *message(scan))


class FrameMessages:
    """The messages of frames of one robot, frame by frame.

    spec      of its scanner; ``others`` of those beside it
    height_m  of the scanners, for /tf_static
    static_map  what never moves, for /map
    intensities  whether scans have them
    """

    def __init__(
        self,
        spec: LaserSpec,
        *,
        others: Sequence[LaserSpec] = (),
        height_m: float = 0.0,
        static_map: Raster | None = None,
        intensities: bool = False,
    ) -> None:
        self.spec, self._specs = spec, (spec, *others)
        self._scans = [
            _Scans(one, number, intensities=intensities) for number, one in enumerate(self._specs)
        ]
        lasers = [(ros.ROBOT, ros.LASER + place_of(k), height_m) for k in range(len(self._specs))]
        self._mount = ros.TransformMessage((ros.FOOTPRINT, ros.ROBOT, 0.0), *lasers)
        self._wheels, self._clock, self._truth = _Wheels(), ros.ClockMessage(), ros.TruthMessage()
        self._true = ros.TransformMessage(
            (ros.WORLD, ros.MAP, 0.0), (ros.MAP, ros.ODOM, 0.0),
            (ros.WORLD, ros.TRUE_FOOTPRINT, 0.0),
        )  # fmt: skip
        self._map = None if static_map is None else ros.MapMessage(static_map)

    def begin(self, frame: Frame) -> Iterator[Message]:
        """What is sent once, before the first frame."""
        stamp_ns = frame.stamp_ns
        yield Message(BEGAN, stamp_ns, ros.BeganMessage()(stamp_ns))
        mounts = [spec.T_robot_laser for spec in self._specs]
        links = self._mount(stamp_ns, se2.IDENTITY, *mounts)
        yield Message("/tf_static", stamp_ns, links)
        if self._map is not None:
            yield Message("/map", stamp_ns, self._map(stamp_ns))
        if frame.truth is not None:
            start = ros.PoseMessage(ros.MAP)(stamp_ns, frame.truth, ros.START_COVARIANCE)
            yield Message("/initialpose", stamp_ns, start)

    def state(self, frame: Frame) -> Iterator[Message]:
        """Clock, odometry and truth of a frame."""
        stamp_ns = frame.stamp_ns
        yield Message("/clock", stamp_ns, self._clock(stamp_ns))
        odometry, tf, increment = self._wheels.next(frame.odometry)
        yield Message("/tf", stamp_ns, tf)
        yield Message("/odom", stamp_ns, odometry)
        if increment is not None:
            yield Message("/odom_increment", stamp_ns, increment)
        if frame.truth is not None:  # map -> odom is what a SLAM without error would say
            T_map_odom = se2.compose(frame.truth, se2.inverse(frame.odometry.T_odom_robot))
            links = self._true(stamp_ns, se2.IDENTITY, T_map_odom, frame.truth)
            yield Message("/ground_truth/pose", stamp_ns, self._truth(stamp_ns, frame.truth))
            yield Message("/ground_truth/tf", stamp_ns, links)

    def scans(self, *frames: Frame) -> Iterator[Message]:
        """The scans of all scanners, frames in their order, whole and turn by turn.

        Raises ``InvalidValueError`` for a frame without a scan or of another scanner.
        """
        for scans, frame in zip(self._scans, frames, strict=True):
            yield from scans(frame)
