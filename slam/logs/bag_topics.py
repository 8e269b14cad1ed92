# SPDX-License-Identifier: Apache-2.0
"""Bags opened by the rosbags library, with errors of our own, and which topics are read."""

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Reader as ReaderOfRos1
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slam import inputs
from slam.bounded import check_file
from slam.errors import LogFormatError, MissingPathError, MobiliaError
from slam.logs import bag_files, unpacking
from slam.logs.bag_files import CURES, METADATA, CutShortError, suffix_of
from slam.logs.foreign import what_instead
from slam.logs.repairs import LOST, NO_END, Repairs

SCAN = "sensor_msgs/msg/LaserScan"
ECHOES = "sensor_msgs/msg/MultiEchoLaserScan"
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
    return (
        (path / METADATA).exists()
        or suffix_of(path) in _STORAGE
        or bag_files.is_folder_of_one(path)
    )


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
        if what := what_instead(path):
            raise LogFormatError(path, what) from error
        text = " ".join(str(error).split())[:200] or type(error).__name__
        cure = f" ({CURES[suffix_of(path)]} may mend it)" if suffix_of(path) in CURES else ""
        raise LogFormatError(path, f"{where}corrupt or truncated bag: {text}{cure}") from error


class Bag:
    """An open bag; a context manager. ``topics``: name -> (message type, count).

    Messages come in the order in which they were recorded. They are decoded by the standard
    definitions of their types, whatever the bag itself says of them: those read here are the same
    in every ROS 2, and compiling decoders for each bag again would take longer than reading a short
    one. So does metadata.yaml say nothing of how they are read, neither its types nor its QoS.

    repairs  takes what is read of a recording without an end; without it, such a bag is refused
    """

    def __init__(self, path: Path, repairs: Repairs | None = None) -> None:
        self.path, self._repairs = path, repairs
        self.is_ros1 = suffix_of(path) == ".bag" and not path.is_dir()
        if not path.exists():
            raise MissingPathError(path, "no such file")
        for file in path.iterdir() if path.is_dir() else [path]:
            if file.exists() and not file.is_dir():
                check_file(file)
                inputs.note(file)
        self.at = ""  # which message was read last, in the words of an error
        self._cut: set[Path] = set()
        self._decode = ROS1.deserialize_ros1 if self.is_ros1 else ROS2.deserialize_cdr

    def __enter__(self) -> "Bag":
        with failing_as_ours(self.path), ExitStack() as stack:
            files, counts, missing = bag_files.files_of(self.path)
            if not files:
                raise LogFormatError(self.path, "a bag without a recording (.mcap, .db3) in it")
            without = self.path.is_dir() and not (self.path / METADATA).exists()
            if without and files[0].suffix == ".db3":  # an .mcap has an end of its own
                self._note(NO_END, f"no {METADATA}: its recorder was killed")
            self._files = [self._opened(file, stack) for file in files]
            found: Counter[str] = Counter()
            kinds: dict[str, str] = {}
            for file in self._files:
                for name, (kind, count) in self._index(file).items():
                    found[name] += count
                    kinds[name] = kind
            self.topics = {name: (kinds[name], found[name]) for name in kinds}
            lost = sum(max(count - found[name], 0) for name, count in counts.items())
            if lost or missing:
                few = f" {', '.join(missing[:3])} is not there," if missing else ""
                why = f"{METADATA} counts messages that are in no file:{few} {lost} messages"
                self._note(LOST, why, max(lost, 1))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _note(self, kind: str, why: str, count: int = 1) -> None:
        if self._repairs is None:
            raise LogFormatError(self.path, why)
        self._repairs.note(kind, why, None, count)

    def _opened(self, file: Path, stack: ExitStack) -> Path:
        """The file, or a copy of it that can be read."""
        copy, wrong = bag_files.settled(file, stack)
        if wrong:
            self._note(LOST, wrong)
        bag_files.check_tables(copy)
        return copy

    def _index(self, file: Path) -> dict[str, tuple[str, int]]:
        """The topics of a file by its index, or of one without an end by what is in it."""
        try:
            library: Any = ReaderOfRos1(file) if self.is_ros1 else Reader(file)
            with library as reader:
                return {
                    name: (info.msgtype or "", info.msgcount)
                    for name, info in reader.topics.items()
                }
        except Exception as error:  # parsers of foreign bytes fail in every way
            if self._repairs is None or not bag_files.can_be_cut(file):
                raise
            topics: dict[str, tuple[str, int]] = {}
            with suppress(CutShortError):
                for name, kind, _, _ in bag_files.records(file):
                    topics[name] = kind, topics.get(name, ("", 0))[1] + 1
            if not topics:
                raise
            why = " ".join(str(error).split())[:100]
            why += f": its recorder was killed, and {CURES[suffix_of(file)]} may mend it"
            self._note(NO_END, why)
            self._cut.add(file)
            return topics

    def raw(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, str, int, bytes]]:
        """(topic, type, log time ns, bytes) as they were recorded; None: every topic."""
        for file in self._files:
            with failing_as_ours(self.path):
                try:
                    for topic, kind, log_ns, data in bag_files.records(file, topics):
                        yield topic, kind, log_ns, unpacking.of_message(data)
                except CutShortError:
                    if file not in self._cut:
                        raise

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        """(topic, log time ns, message) of these topics."""
        count: Counter[str] = Counter()
        for topic, kind, log_ns, data in self.raw(topics):
            count[topic] += 1
            self.at = f"topic {topic}, message {count[topic]}"
            with failing_as_ours(self.path, f"{self.at}: "):
                decoded = self._decode(data, kind)
                if kind == ECHOES:
                    decoded = first_echoes(decoded)
            yield topic, log_ns, decoded


def first_echoes(message: Any) -> Any:
    """A LaserScan of the first echo of each beam; a beam without any has no return."""

    def first(beams: Any, nothing: float) -> NDArray[np.float32]:
        echoes = (beam.echoes for beam in beams)
        return np.array([e[0] if len(e) else nothing for e in echoes], dtype=np.float32)

    fields = {
        "ranges": first(message.ranges, np.inf), "intensities": first(message.intensities, 0.0)
    }  # fmt: skip
    return SimpleNamespace(**{**vars(message), **fields})


@dataclass(frozen=True)
class Asked:
    """What is to be read, where somebody says it, as TOPIC or TOPIC:FRAME.

    scan      FRAME: of the scanner, where several share the topic
    odometry  FRAME: that moves; of /tf: that in which the odometry is
    """

    scan: str | None = None
    odometry: str | None = None


@dataclass(frozen=True, kw_only=True)
class Topics:
    """What is read; None where a bag does not have it.

    frame   of the scans, "" for any
    child   frame of the odometry that moves, "" for any
    way     steps through /tf from the frame of odometry to the robot's, where no topic has it:
            ``slam.logs.bag_head.messages_of`` makes one of them
    passed  what else there was of scans and odometry, as ``Asked`` names it

    Before the frames are known (``slam.logs.bag_head``), ``odometry`` and the frames are those that
    were asked for.
    """

    scan: str
    odometry: str | None
    truth: str | None
    turns: str | None
    increment: str | None
    labels: str | None
    transforms: tuple[str, ...]
    began: str | None = None
    frame: str = ""
    child: str = ""
    way: tuple[Any, ...] = ()
    passed: tuple[str, ...] = ()


def choose(bag: Bag, asked: Asked, *, truth: str | None, labels: bool) -> tuple[Topics, list[str]]:
    """Topics by the names asked for, else by type and the likeliest name; all of odometry.

    A bag without any message of odometry has none; a scanner carried in the hand leaves such bags.
    Raises ``LogFormatError`` that lists the bag's topics when there is no such topic, or when the
    one asked for is of another type.
    """
    scan, frame = _parts(asked.scan)
    odometry, child = _parts(asked.odometry)
    wanted = _pick(bag, scan, (SCAN, ECHOES), "scan", beside=odometry or "")[0]
    drives = []
    on_tf = odometry is not None and _kind(bag, odometry) in TRANSFORMS
    if not on_tf and (odometry or any(k == ODOMETRY and n for k, n in bag.topics.values())):
        drives = _pick(bag, odometry, (ODOMETRY,), "odom", beside=wanted)

    def there(name: str, kind: str) -> str | None:
        return name if _kind(bag, name) == kind else None

    truths = [
        name
        for name, (kind, _) in sorted(bag.topics.items())
        if kind in (POSE, ODOMETRY) and "truth" in name and name not in drives[:1]
    ]
    if truth is not None:
        truths = _pick(bag, truth, (POSE, ODOMETRY), "truth")[:1]
    return Topics(
        scan=wanted,
        odometry=odometry,
        truth=truths[0] if truths else None,
        turns=there(f"{wanted}_turn", SCAN),
        increment=None,
        labels=there(f"{LABELS}{wanted}", CLOUD) or there(LABELS, CLOUD) if labels else None,
        transforms=_transforms(bag, wanted),
        began=there(BEGAN, TIME),
        frame=frame,
        child=child,
    ), [name for name in drives if name not in truths]


def _parts(asked: str | None) -> tuple[str | None, str]:
    """Topic and frame of TOPIC:FRAME."""
    if asked is None:
        return None, ""
    topic, _, frame = asked.partition(":")
    return topic, frame


def shared(name: str, other: str) -> int:
    """How many namespaces two topics have in common."""
    mine, theirs = (topic.strip("/").split("/")[:-1] for topic in (name, other))
    alike = [a == b for a, b in zip(mine, theirs, strict=False)]
    return [*alike, False].index(False)


def _transforms(bag: Bag, scan: str) -> tuple[str, ...]:
    """Topics of transforms but those of other robots: /b/tf, where /a/scan has an /a/tf."""
    names = sorted(name for name, (kind, _) in bag.topics.items() if kind in TRANSFORMS)
    most = max((shared(name, scan) for name in names), default=0)
    return tuple(n for n in names if shared(n, scan) == most or n.count("/") == 1)


def _kind(bag: Bag, topic: str) -> str:
    return bag.topics.get(topic, ("", 0))[0]


def _pick(
    bag: Bag, asked: str | None, kinds: tuple[str, ...], hint: str, beside: str = ""
) -> list[str]:
    """The topic asked for, or all of these kinds, the likeliest first: ``beside`` which one."""
    listed = ", ".join(f"{name} ({kind})" for name, (kind, _) in sorted(bag.topics.items()))
    if asked is not None:
        if asked not in bag.topics:
            raise LogFormatError(bag.path, f"no topic {asked}; there are: {listed or 'none'}")
        if _kind(bag, asked) not in kinds:
            raise LogFormatError(
                bag.path, f"topic {asked} is {_kind(bag, asked)}, expected {' or '.join(kinds)}"
            )
        return [asked]
    found = [
        (
            -shared(name, beside),
            kinds.index(kind),
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
    return [one[-1] for one in sorted(found)]


def scanners(bag: Bag) -> list[str]:
    """All topics of whole scans."""
    return [
        name for name, (kind, count) in sorted(bag.topics.items())
        if kind in (SCAN, ECHOES) and count and not name.endswith("_turn")
    ]  # fmt: skip
