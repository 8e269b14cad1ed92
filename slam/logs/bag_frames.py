# SPDX-License-Identifier: Apache-2.0
"""The messages of a bag put together to frames: what belongs to one stamp."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from slam.constant_velocity import standing
from slam.errors import InvalidValueError, LogFormatError
from slam.frames import MOST_TWIST, NS_PER_S, BeamLabels, Float, Frame, Odometry, Scan
from slam.logs.bag_laser import Laser
from slam.logs.bag_odometry import PoseTrack, Stamped, increment_covariance
from slam.logs.bag_topics import Bag, Topics
from slam.logs.ros_numbers import yaw_of
from slam.logs.text import about

PATIENCE_NS = 2 * NS_PER_S  # how long a scan waits for its odometry
PLANAR = np.array([[6 * i + j for j in (0, 1, 5)] for i in (0, 1, 5)])
MOST_POSE_M = 1e9  # from the origin of its frame, which may be that of a map of the earth
_log = logging.getLogger(__name__)


def frames_of(path: Path, topics: Topics, laser: Laser, epoch_ns: int) -> Iterator[Frame]:
    """The frames of the bag at ``path``, stamps less ``epoch_ns``.

    Raises ``LogFormatError`` for messages that cannot be, and where no scan has odometry.
    """
    names = (topics.scan, topics.odometry, topics.truth, topics.increment, topics.labels)
    with Bag(path) as bag:
        assembly = Assembly(topics, laser, epoch_ns)
        for topic, log_ns, message in bag.messages({name for name in names if name}):
            with about(path, bag.at):
                assembly.take(topic, log_ns, message)
                ready = assembly.ready(log_ns) if assembly.waiting else []
            yield from ready
        with about(path, "at the end"):
            ready = assembly.ready(None)
        yield from ready
    assembly.report(path)


def stamp_of(message: Any, log_ns: int) -> int:
    """Of the header; drivers that leave it empty get the time of the log."""
    stamp = message.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec) or log_ns


class Assembly:
    """Puts together what belongs to one stamp."""

    def __init__(self, topics: Topics, laser: Laser, epoch_ns: int) -> None:
        self._topics, self._laser, self._epoch_ns = topics, laser, epoch_ns
        self.waiting: deque[tuple[Scan, int]] = deque()  # scans and when they were logged
        self._odometry, self._truth = PoseTrack(), PoseTrack()
        self._increments: dict[int, Float] = {}
        self._labels: dict[int, BeamLabels] = {}
        self._before: Stamped | None = None
        self._last_ns: int | None = None
        self._before_ns: int | None = None  # the scan before, of a bag without odometry
        self._disordered = self._without_odometry = self._given = 0

    def take(self, topic: str, log_ns: int, message: Any) -> None:
        """One message of one of the topics."""
        stamp_ns, topics = stamp_of(message, log_ns) - self._epoch_ns, self._topics
        if topic == topics.scan:
            scan = self._laser.scan(message, stamp_ns)
            if self._last_ns is not None and scan.stamp_ns <= self._last_ns:
                self._disordered += 1
                return
            self._last_ns = scan.stamp_ns
            self.waiting.append((scan, log_ns))
        elif topic == topics.odometry:
            self._odometry.add(_odometry(message, stamp_ns, topics.increment is None))
        elif topic == topics.truth:
            self._truth.add(_pose(message, stamp_ns))
        elif topic == topics.increment:
            self._increments[stamp_ns] = message.pose.covariance[PLANAR]
        elif topic == topics.labels:
            self._labels[stamp_ns] = _labels(message)

    def ready(self, now_ns: int | None) -> list[Frame]:
        """Frames that are complete, or have waited long enough; None: nothing more comes."""
        out = []
        while self.waiting:
            scan, log_ns = self.waiting[0]
            late = now_ns is None or now_ns - log_ns > PATIENCE_NS
            stamp_ns = scan.stamp_ns
            if not (late or self._complete(stamp_ns)):
                break
            self.waiting.popleft()
            frame = self._frame(scan)
            if frame is not None:
                out.append(frame)
        return out

    def _complete(self, stamp_ns: int) -> bool:
        topics = self._topics
        return (
            (topics.odometry is None or self._odometry.reaches(stamp_ns))
            and (topics.truth is None or self._truth.reaches(stamp_ns))
            and (topics.labels is None or stamp_ns in self._labels)
            and (topics.increment is None or stamp_ns in self._increments)
        )

    def _frame(self, scan: Scan) -> Frame | None:
        stamp_ns = scan.stamp_ns
        odometry = self._driven(stamp_ns)
        if odometry is None:
            self._without_odometry += 1
            return None
        truth = self._truth.at(stamp_ns)
        labels = self._labels.pop(stamp_ns, None)
        if len(self._increments) > 1000 or len(self._labels) > 100:  # of scans that are not there
            self._increments.clear()
            self._labels.clear()
        self._given += 1
        return Frame(
            stamp_ns=stamp_ns,
            odometry=odometry,
            scan=scan,
            truth=None if truth is None else truth.pose,
            labels=labels,
        )

    def _driven(self, stamp_ns: int) -> Odometry | None:
        """The odometry at that time; None outside that of the bag."""
        if self._topics.odometry is None:
            before_ns, self._before_ns = self._before_ns, stamp_ns
            return standing(stamp_ns, before_ns)
        now = self._odometry.at(stamp_ns)
        if now is None:
            return None
        if self._topics.increment is None:
            spread = increment_covariance(self._before, now)
        else:
            spread = self._increments.pop(stamp_ns, None)
        self._before = now
        return Odometry(
            stamp_ns=stamp_ns,
            T_odom_robot=now.pose,
            increment_covariance=spread,
            twist=now.twist,
        )

    def report(self, path: Path) -> None:
        """Say what was left out."""
        if self._disordered:
            _log.warning("%s: %d scans whose time does not increase", path, self._disordered)
        if self._without_odometry:
            _log.warning("%s: %d scans without odometry", path, self._without_odometry)
        if not self._given:
            raise LogFormatError(path, "no scan lies within the time of the odometry")


def planar(pose: Any) -> Float:
    """(x m, y m, theta rad) of a geometry_msgs/Pose; ``InvalidValueError`` for what cannot be."""
    p, q = pose.position, pose.orientation
    if not max(abs(p.x), abs(p.y)) <= MOST_POSE_M or not math.isfinite(p.x + p.y):
        raise InvalidValueError(
            f"pose.position: expected a place within {MOST_POSE_M:g} m, got {p.x:g}, {p.y:g}"
        )
    if not math.isfinite(q.x + q.y + q.z + q.w):
        got = f"{q.x:g}, {q.y:g}, {q.z:g}, {q.w:g}"
        raise InvalidValueError(f"pose.orientation: expected finite numbers, got {got}")
    return np.array([p.x, p.y, yaw_of(q.x, q.y, q.z, q.w)])


def _pose(message: Any, stamp_ns: int) -> Stamped:
    pose = message.pose
    return Stamped(stamp_ns=stamp_ns, pose=planar(getattr(pose, "pose", pose)))


def _odometry(message: Any, stamp_ns: int, with_covariance: bool) -> Stamped:
    twist = message.twist.twist
    known = message.twist.covariance[0] != -1.0  # the convention of sensor_msgs/Imu
    rates = np.array([twist.linear.x, twist.linear.y, twist.angular.z])
    known = known and bool(np.isfinite(rates).all())
    if known and np.abs(rates).max() > MOST_TWIST:
        raise InvalidValueError(
            f"twist: expected speeds within {MOST_TWIST:g} m/s and rad/s, got {rates.tolist()}"
        )
    return Stamped(
        stamp_ns=stamp_ns,
        pose=planar(message.pose.pose),
        twist=rates if known else None,
        covariance=message.pose.covariance[PLANAR] if with_covariance else None,
    )


def _labels(message: Any) -> BeamLabels:
    """From the fields of our own recordings."""
    formats = {field.name: (field.datatype, field.offset) for field in message.fields}
    types = {7: "<f4", 5: "<i4", 2: "u1"}
    wanted = ("body", "kind", "displacement", "incidence", "mixed")
    missing = [name for name in wanted if name not in formats]
    if missing:
        raise InvalidValueError(f"labels without {', '.join(missing)}")
    layout = np.dtype(
        {
            "names": wanted,
            "formats": [types[formats[name][0]] for name in wanted],
            "offsets": [formats[name][1] for name in wanted],
            "itemsize": message.point_step,
        }
    )
    points = np.frombuffer(message.data.tobytes(), dtype=layout)
    return BeamLabels(
        body=points["body"],
        kind=points["kind"],
        displacement=points["displacement"],
        incidence=points["incidence"],
        mixed=points["mixed"].astype(np.bool_),
    )
