# SPDX-License-Identifier: Apache-2.0
"""Frames into a rosbag2 with MCAP storage, written by the rosbags library, without ROS."""

import hashlib
import struct
import sys
import zlib
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

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
from sim.recording.topics import OURS, LabelsMessage, MoreTopics, ObjectsMessage, labels_topic
from slam.estimate import Raster
from slam.frames import LaserSpec
from slam.ros.frames import BEGAN, FrameMessages, Message, place_of, scan_topics
from slam.ros.messages import LASER
from slam.ros.template import EPOCH_NS, STORE

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
_CHUNK, _DATA_END, _FOOTER = b"\x06", b"\x0f", b"\x02"  # kinds of records, mcap.dev/spec
_FOREVER = QosTime(9223372036, 854775807)
_LATCHED = Qos(
    QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL,
    _FOREVER, _FOREVER, QosLiveliness.AUTOMATIC, _FOREVER, False,
)  # fmt: skip


class _File:
    """The file of an MCAP, with the CRC-32 of chunks, data and summary that the library leaves 0.

    chunk_crc  of the next chunk, unpacked

    The library writes a record in three pieces: its kind, its length and what it holds.
    """

    def __init__(self, storage: Any) -> None:
        storage.bio.flush()
        self._file, self._pieces = storage.bio, list[bytearray]()
        self._crc = zlib.crc32(storage.path.read_bytes())  # of data, then of the summary
        self.chunk_crc = 0
        self.tell, self.close = storage.bio.tell, storage.bio.close
        storage.bio = self

    def write(self, piece: bytes | memoryview) -> None:
        """Of a record, which is written when it is whole; or the last bytes of the file."""
        self._pieces.append(bytearray(piece))
        kind, content = self._pieces[0], self._pieces[-1]
        if len(kind) == 1 and len(self._pieces) < 3:
            return
        if kind == _CHUNK:
            content[24:28] = self.chunk_crc.to_bytes(4, "little")
        elif kind == _DATA_END:
            content[:] = self._crc.to_bytes(4, "little")
        elif kind == _FOOTER:
            before = b"".join([*self._pieces[:2], content[:16]])
            content[16:] = zlib.crc32(before, self._crc).to_bytes(4, "little")
        record = b"".join(self._pieces)
        self._pieces.clear()
        self._crc = 0 if kind == _DATA_END else zlib.crc32(record, self._crc)
        self._file.write(record)


class _Chunks:
    """Two open chunks of an MCAP: what a SLAM's score needs, and the bulk, which is most bytes.

    Who reads only the former never unpacks the latter. The library keeps one open chunk; the two
    take turns in that place.
    """

    def __init__(self, storage: Any) -> None:
        self._storage, self._file = storage, _File(storage)
        storage.compressor = self._compressed
        bio = BytesIO()
        bio.write(storage.chunk.bio.getvalue())  # types and topics come before any message
        self._other = type(storage.chunk)(2**63 - 1, 0, bio, defaultdict(list))
        self._bulk = False

    def _compressed(self, chunk: bytes) -> bytes:
        self._file.chunk_crc = zlib.crc32(chunk)
        return zstd.compress(chunk, options=_OPTIONS)

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

    specs     of the robot's scanners
    movers    of the scene, for /ground_truth/objects
    height_m  of the scanner, for /tf_static
    static_map  what never moves, for /map
    labels, intensities  whether frames have them

    The folder is whole only after the block ends without an exception.
    """

    def __init__(
        self,
        path: Path,
        *specs: LaserSpec,
        movers: Sequence[Mover] = (),
        height_m: float = SCAN_HEIGHT,
        static_map: Raster | None = None,
        labels: bool = True,
        intensities: bool = False,
    ) -> None:
        self._frames = FrameMessages(
            specs[0], others=specs[1:], height_m=height_m, static_map=static_map,
            intensities=intensities,
        )  # fmt: skip
        self._has_map = static_map is not None
        self._labels = [
            (labels_topic(k), LabelsMessage(spec, LASER + place_of(k)))
            for k, spec in enumerate(specs if labels else ())
        ]
        self._topics, self._lean = [*OURS.values()], set(_LEAN)
        for k in range(1, len(specs)):
            labelled = replace(OURS[labels_topic(0)], name=labels_topic(k))
            self._lean.add(scan_topics(k)[0].name)
            self._topics += [*scan_topics(k), *([labelled] if labels else [])]
        self._objects = ObjectsMessage(movers) if movers else None
        self._more = MoreTopics()
        self._writer = Writer(path, version=VERSION, storage_plugin=StoragePlugin.MCAP)
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._connections: dict[str, Any] = {}
        self._hash = MessageHash()
        self._started = False

    def __enter__(self) -> "BagWriter":
        self._writer.open()
        made: dict[str, object] = {
            "/ground_truth/objects": self._objects,
            labels_topic(0): self._labels,
            "/map": self._has_map,
        }
        for topic in (*self._topics, *self._more.topics):
            if made.get(topic.name, True):
                latched = [_LATCHED] if topic.latched else []
                self._connections[topic.name] = self._writer.add_connection(
                    topic.name, topic.kind, typestore=STORE, offered_qos_profiles=latched
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
        frame, stamp_ns = moment.frame, moment.frame.stamp_ns
        scans = self._frames.scans(*moment.frames)
        first = next(scans)
        if not self._started:
            self._started = True
            self._put_all(self._frames.begin(frame))
        self._put_all(self._frames.state(frame))
        if self._objects is not None:
            markers = self._objects(stamp_ns, moment.poses, moment.moving)
            self._put("/ground_truth/objects", stamp_ns, markers)
        for (topic, message), each in zip(self._labels, moment.frames, strict=False):
            if each.labels is not None and each.scan is not None:
                self._put(topic, stamp_ns, message(each.scan, each.labels))
        self._put_all((first, *scans))
        for topic, data in self._more(moment):
            self._put(topic, stamp_ns, data)

    def _put_all(self, messages: Iterable[Message]) -> None:
        for topic, stamp_ns, data in messages:
            self._put(topic, stamp_ns, data)

    def _put(self, topic: str, stamp_ns: int, data: bytearray) -> None:
        time_ns = stamp_ns + EPOCH_NS
        self._chunks.turn_to(topic not in self._lean)
        self._writer.write(self._connections[topic], time_ns, data)  # type: ignore[arg-type]
        self._hash.take(topic, time_ns, data)

    @property
    def messages_sha256(self) -> str:
        """Of all messages so far (``MessageHash``)."""
        return self._hash.hexdigest()
