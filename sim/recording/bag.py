# SPDX-License-Identifier: Apache-2.0
"""Frames into a rosbag2 with MCAP storage, written by the rosbags library, without ROS."""

from __future__ import annotations

import hashlib
import math
import struct
import sys
from collections import defaultdict
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from scenes import SCAN_HEIGHT
from scenes.scene import Mover
from sim.moments import Moment
from sim.recording import messages as ros
from sim.recording import navigation_messages as nav
from sim.recording.label_cloud import LabelsMessage
from sim.recording.objects import ObjectsMessage
from sim.recording.template import EPOCH_NS, STORE
from sim.recording.topics import BEGAN, OURS, MoreTopics
from slam import se2
from slam._jit import njit
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import NS_PER_S, Float, Frame, LaserSpec, Odometry

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

VERSION: Literal[8] = 8  # of metadata.yaml: the newest that older ROS 2 can read
LEVEL = 1  # of zstd: 7 % larger than level 3, and 40 us a frame faster
_OPTIONS: dict[int, int] = {
    zstd.CompressionParameter.compression_level: LEVEL,
    zstd.CompressionParameter.checksum_flag: 1,  # a flipped bit is an error, never another range
}
_FOREVER = QosTime(9223372036, 854775807)
_LATCHED = Qos(
    QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL,
    _FOREVER, _FOREVER, QosLiveliness.AUTOMATIC, _FOREVER, False,
)  # fmt: skip


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
        self.odometry, self.increment = ros.OdometryMessage(), ros.IncrementMessage()
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


class _Truth:
    """/ground_truth/pose and /ground_truth/tf of one frame after another."""

    def __init__(self) -> None:
        self._pose = ros.TruthMessage()
        self._links = ros.TransformMessage(
            (ros.WORLD, ros.MAP, 0.0), (ros.MAP, ros.ODOM, 0.0),
            (ros.WORLD, ros.TRUE_FOOTPRINT, 0.0),
        )  # fmt: skip

    def next(self, T_world_robot: Float, odometry: Odometry) -> tuple[bytearray, bytearray]:
        """map -> odom is what a SLAM without error would say."""
        stamp_ns = odometry.stamp_ns
        T_map_odom = se2.compose(T_world_robot, se2.inverse(odometry.T_odom_robot))
        links = self._links(stamp_ns, se2.IDENTITY, T_map_odom, T_world_robot)
        return self._pose(stamp_ns, T_world_robot), links


class _Chunks:
    """Two open chunks of an MCAP: what a SLAM's score needs, and the bulk, which is most bytes.

    Who reads only the former never unpacks the latter. The library keeps one open chunk; the two
    take turns in that place.
    """

    def __init__(self, storage: Any) -> None:
        storage.compressor = lambda chunk: zstd.compress(chunk, options=_OPTIONS)
        self._storage = storage
        bio = BytesIO()
        bio.write(storage.chunk.bio.getvalue())  # types and topics come before any message
        self._other = type(storage.chunk)(2**63 - 1, 0, bio, defaultdict(list))
        self._bulk = False

    def turn_to(self, bulk: bool) -> None:
        """From now on, messages go to that chunk."""
        if bulk != self._bulk:
            self._bulk = bulk
            self._storage.chunk, self._other = self._other, self._storage.chunk

    def flush(self) -> None:
        """Close both."""
        for bulk in (True, False):
            self.turn_to(bulk)
            if self._storage.chunk.msgs:
                self._storage.close_chunk()


_LEAN = frozenset((BEGAN, "/scan", "/odom", "/odom_increment", "/ground_truth/pose"))
_LATCHED_TOPICS = frozenset((BEGAN, "/tf_static", "/map"))
FORMAT = 2  # of a bag: goes up when the same frames come to be other messages
FORMATS = {
    1: "stamps from 0 s on, base_link below odom, and no clock, map or transforms of the truth",
}


class MessageHash:
    """SHA-256 of the uncompressed messages of a bag: stamps and bytes, topic by topic.

    It does not depend on how messages are packed, nor on the order of topics at one stamp.
    """

    def __init__(self) -> None:
        self._topics: dict[str, Any] = {}

    def take(self, topic: str, stamp_ns: int, data: bytes | bytearray) -> None:
        """The next message of its topic."""
        if topic not in self._topics:
            self._topics[topic] = hashlib.sha256(topic.encode())
        digest = self._topics[topic]
        digest.update(struct.pack("<qq", stamp_ns, len(data)))
        digest.update(data)

    def hexdigest(self) -> str:
        """Of everything so far."""
        parts = [digest.hexdigest() for _, digest in sorted(self._topics.items())]
        return hashlib.sha256("".join(parts).encode()).hexdigest()


class BagWriter:
    """Writes the folder ``path``: metadata.yaml and one .mcap; a context manager.

    movers    of the scene, for /ground_truth/objects
    height_m  of the scanner, for /tf_static
    static_map  what never moves, for /map
    labels, intensities  whether frames have them

    The folder is whole only after the block ends without an exception.
    """

    def __init__(  # noqa: PLR0913 (what a bag may hold)
        self,
        path: Path,
        spec: LaserSpec,
        *,
        movers: Sequence[Mover] = (),
        height_m: float = SCAN_HEIGHT,
        static_map: Raster | None = None,
        labels: bool = True,
        intensities: bool = False,
    ) -> None:
        self.spec, turns = spec, ros.turns_of(spec)
        turn_s = ros.turn_time_s(spec, turns)
        self._scan = ros.ScanMessage(
            spec, scan_time=turns * turn_s, first=0, stride=1, intensities=intensities
        )
        self._turns = [
            ros.ScanMessage(
                spec, scan_time=turn_s, first=k, stride=turns, intensities=intensities
            )
            for k in range(turns)
        ]  # fmt: skip
        self._mount = ros.TransformMessage(
            (ros.FOOTPRINT, ros.ROBOT, 0.0), (ros.ROBOT, ros.LASER, height_m)
        )
        self._wheels, self._truth, self._clock = _Wheels(), _Truth(), nav.ClockMessage()
        self._map = None if static_map is None else nav.MapMessage(static_map)
        self._labels = LabelsMessage(spec) if labels else None
        self._objects = ObjectsMessage(movers) if movers else None
        self._more = MoreTopics()
        self._writer = Writer(path, version=VERSION, storage_plugin=StoragePlugin.MCAP)
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._connections: dict[str, Any] = {}
        self._hash = MessageHash()
        self._started = False

    def __enter__(self) -> BagWriter:
        self._writer.open()
        made: dict[str, object] = {
            "/ground_truth/objects": self._objects,
            "/ground_truth/labels": self._labels,
            "/map": self._map,
        }
        for topic, kind in {**OURS, **self._more.kinds}.items():
            if made.get(topic, True):
                latched = [_LATCHED] if topic in _LATCHED_TOPICS else []
                self._connections[topic] = self._writer.add_connection(
                    topic, kind, typestore=STORE, offered_qos_profiles=latched
                )
        self._chunks = _Chunks(self._writer.storage)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: Any
    ) -> None:
        if error is None:
            self._chunks.flush()
        self._writer.__exit__(kind, error, trace)

    def write(self, moment: Moment) -> None:
        """Append a frame; ``InvalidValueError`` for one without a scan or of another scanner."""
        frame = moment.frame
        scan, stamp_ns = frame.scan, frame.stamp_ns
        if scan is None or (scan.spec is not self.spec and scan.spec != self.spec):
            raise InvalidValueError("a bag holds scans of one scanner: this frame has another one")
        if not self._started:
            self._started = True
            self._begin(frame)
        self._put("/clock", stamp_ns, self._clock(stamp_ns))
        odometry, tf, increment = self._wheels.next(frame.odometry)
        self._put("/tf", stamp_ns, tf)
        self._put("/odom", stamp_ns, odometry)
        if increment is not None:
            self._put("/odom_increment", stamp_ns, increment)
        if frame.truth is not None:
            truth, links = self._truth.next(frame.truth, frame.odometry)
            self._put("/ground_truth/pose", stamp_ns, truth)
            self._put("/ground_truth/tf", stamp_ns, links)
        if self._objects is not None:
            markers = self._objects(stamp_ns, moment.poses, moment.moving)
            self._put("/ground_truth/objects", stamp_ns, markers)
        if self._labels is not None and frame.labels is not None:
            self._put("/ground_truth/labels", stamp_ns, self._labels(scan, frame.labels))
        self._put("/scan", *self._scan(scan))
        for turn in self._turns:
            self._put("/scan_turn", *turn(scan))
        for topic, data in self._more(moment):
            self._put(topic, stamp_ns, data)

    def _begin(self, frame: Frame) -> None:
        """What is sent once, before the first frame."""
        stamp_ns = frame.stamp_ns
        self._put(BEGAN, stamp_ns, nav.BeganMessage()(stamp_ns))
        links = self._mount(stamp_ns, se2.IDENTITY, self.spec.T_robot_laser)
        self._put("/tf_static", stamp_ns, links)
        if self._map is not None:
            self._put("/map", stamp_ns, self._map(stamp_ns))
        if frame.truth is not None:
            self._put("/initialpose", stamp_ns, nav.StartMessage()(stamp_ns, frame.truth))

    def _put(self, topic: str, stamp_ns: int, data: bytearray) -> None:
        time_ns = stamp_ns + EPOCH_NS
        self._chunks.turn_to(topic not in _LEAN)
        self._writer.write(self._connections[topic], time_ns, data)  # type: ignore[arg-type]
        self._hash.take(topic, time_ns, data)

    @property
    def messages_sha256(self) -> str:
        """Of all messages so far (``MessageHash``)."""
        return self._hash.hexdigest()
