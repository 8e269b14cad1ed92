# SPDX-License-Identifier: Apache-2.0
"""Bags opened by the rosbags library, with errors of our own, and which topics are read."""

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader as ReaderOfRos1
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slam import inputs
from slam.bounded import check_file
from slam.errors import LogFormatError, MissingPathError, MobiliaError
from slam.logs import unpacking

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
INCREMENT = "geometry_msgs/msg/PoseWithCovarianceStamped"
POSE = "geometry_msgs/msg/PoseStamped"
CLOUD = "sensor_msgs/msg/PointCloud2"
TIME = "sensor_msgs/msg/TimeReference"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
unpacking.bound_rosbags()
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
for _name in TRANSFORMS:  # the library's ROS 1 has none of the two
    ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _name))
BEGAN, LABELS = "/ground_truth/time", "/ground_truth/labels"  # of our own recordings
_STORAGE = (".mcap", ".db3", ".bag")


def is_bag(path: Path) -> bool:
    """Whether ``path`` looks like a rosbag2 folder, an .mcap, a .db3 or a ROS 1 .bag."""
    return (path / "metadata.yaml").exists() or path.suffix in _STORAGE


@contextmanager
def failing_as_ours(path: Path, where: str = "") -> Iterator[None]:
    """Whatever the library raises on damaged bytes becomes a ``LogFormatError``."""
    try:
        yield
    except MobiliaError:
        raise
    except FileNotFoundError as error:
        raise MissingPathError(path, "no such file") from error
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error
    except Exception as error:  # parsers of foreign bytes fail in every way
        text = " ".join(str(error).split())[:200] or type(error).__name__
        raise LogFormatError(path, f"{where}corrupt or truncated bag: {text}") from error


class Bag:
    """An open bag; a context manager. ``topics``: name -> (message type, count).

    Messages are decoded by the standard definitions of their types, whatever the bag itself says of
    them: those read here are the same in every ROS 2, and compiling decoders for each bag again
    would take longer than reading a short one.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.is_ros1 = path.suffix == ".bag" and not path.is_dir()
        if not path.exists():
            raise MissingPathError(path, "no such file")
        for file in path.iterdir() if path.is_dir() else [path]:
            if file.exists() and not file.is_dir():
                check_file(file)
                inputs.note(file)
        with failing_as_ours(path):
            self._reader: Any = ReaderOfRos1(path) if self.is_ros1 else Reader(_storage(path))
        self.at = ""  # which message was read last, in the words of an error
        self._decode = ROS1.deserialize_ros1 if self.is_ros1 else ROS2.deserialize_cdr

    def __enter__(self) -> "Bag":
        with failing_as_ours(self.path):
            self._reader.open()
            self.topics: dict[str, tuple[str, int]] = {
                name: (info.msgtype or "", info.msgcount)
                for name, info in self._reader.topics.items()
            }
        return self

    def __exit__(self, *_: object) -> None:
        with failing_as_ours(self.path):
            self._reader.close()

    def raw(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, str, int, bytes]]:
        """(topic, type, log time ns, bytes) in the order of the log time; None: every topic."""
        for connection, log_ns, data in self._messages(topics):
            yield connection.topic, connection.msgtype, log_ns, data

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        """(topic, log time ns, message) of these topics."""
        count: Counter[str] = Counter()
        for connection, log_ns, data in self._messages(topics):
            count[connection.topic] += 1
            self.at = f"topic {connection.topic}, message {count[connection.topic]}"
            with failing_as_ours(self.path, f"{self.at}: "):
                decoded = self._decode(data, connection.msgtype)
            yield connection.topic, log_ns, decoded

    def _messages(self, topics: Collection[str] | None) -> Iterator[tuple[Any, int, bytes]]:
        wanted = [c for c in self._reader.connections if topics is None or c.topic in topics]
        if wanted:
            with failing_as_ours(self.path):
                yield from self._reader.messages(connections=wanted)


def _storage(path: Path) -> Path:
    """The only .mcap of a folder instead of the folder: it says all, and sooner than the YAML."""
    files = list(path.glob("*.mcap")) if path.is_dir() else []
    return files[0] if len(files) == 1 else path


@dataclass(frozen=True, kw_only=True)
class Topics:
    """What is read; None where a bag does not have it."""

    scan: str
    odometry: str | None
    truth: str | None
    turns: str | None
    increment: str | None
    labels: str | None
    transforms: tuple[str, ...]
    began: str | None = None


def choose(
    bag: Bag, *, scan: str | None, odometry: str | None, truth: str | None, labels: bool
) -> Topics:
    """Topics by the names asked for, else by type and the likeliest name.

    A bag without any message of odometry has none; a scanner carried in the hand leaves such bags.
    Raises ``LogFormatError`` that lists the bag's topics when there is no such topic, or when the
    one asked for is of another type.
    """
    wanted_scan = _pick(bag, scan, (SCAN,), "scan")
    wanted_odometry = None
    if odometry is not None or any(k == ODOMETRY and count for k, count in bag.topics.values()):
        wanted_odometry = _pick(bag, odometry, (ODOMETRY,), "odom")

    def there(name: str, kind: str) -> str | None:
        return name if _kind(bag, name) == kind else None

    truths = [
        name
        for name, (kind, _) in sorted(bag.topics.items())
        if kind in (POSE, ODOMETRY) and "truth" in name and name != wanted_odometry
    ]
    if truth is not None:
        truths = [_pick(bag, truth, (POSE, ODOMETRY), "truth")]
    return Topics(
        scan=wanted_scan,
        odometry=wanted_odometry,
        truth=truths[0] if truths else None,
        turns=there(f"{wanted_scan}_turn", SCAN),
        increment=there(f"{wanted_odometry}_increment", INCREMENT),
        labels=there(LABELS, CLOUD) if labels else None,
        transforms=tuple(n for n, (kind, _) in sorted(bag.topics.items()) if kind in TRANSFORMS),
        began=there(BEGAN, TIME),
    )


def _kind(bag: Bag, topic: str) -> str:
    return bag.topics.get(topic, ("", 0))[0]


def _pick(bag: Bag, asked: str | None, kinds: tuple[str, ...], hint: str) -> str:
    listed = ", ".join(f"{name} ({kind})" for name, (kind, _) in sorted(bag.topics.items()))
    if asked is not None:
        if asked not in bag.topics:
            raise LogFormatError(bag.path, f"no topic {asked}; there are: {listed or 'none'}")
        if _kind(bag, asked) not in kinds:
            raise LogFormatError(
                bag.path, f"topic {asked} is {_kind(bag, asked)}, expected {' or '.join(kinds)}"
            )
        return asked
    found = [
        (
            name != f"/{hint}",
            "truth" in name,
            hint not in name,
            name.endswith("_turn"),
            -count,
            name,
        )
        for name, (kind, count) in bag.topics.items()
        if kind in kinds and count > 0
    ]
    if not found:
        raise LogFormatError(bag.path, f"no message of type {kinds[0]}; topics: {listed or 'none'}")
    return min(found)[-1]
