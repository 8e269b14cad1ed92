# SPDX-License-Identifier: Apache-2.0
"""Bags of ROS 2 (rosbag2 folder, .mcap, .db3) and ROS 1 (.bag) as frames, without ROS."""

import logging
import math
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slam.constant_velocity import standing
from slam.errors import InvalidValueError, LogFormatError
from slam.frames import (
    EPOCH,
    MOST_TWIST,
    NS_PER_S,
    BeamLabels,
    Float,
    Frame,
    Odometry,
    Scan,
    Stream,
    StreamMetadata,
)
from slam.logs.bag_head import Head, messages_of
from slam.logs.bag_laser import Laser, PoseTrack, Stamped, increment_covariance, stamp_of
from slam.logs.bag_survey import Survey, survey
from slam.logs.bag_topics import ECHOES, SCAN, Asked, Bag, Topics, choose
from slam.logs.repairs import NO_ODOMETRY, Repairs
from slam.logs.ros_numbers import planar
from slam.logs.text import about

PATIENCE_NS = 2 * NS_PER_S  # how long a scan waits for its odometry
MOST_AHEAD = 5000  # labels before their scans: a recording of ours packs them apart
PLANAR = np.array([[6 * i + j for j in (0, 1, 5)] for i in (0, 1, 5)])
_log = logging.getLogger(__name__)


def frames_of(
    path: Path, topics: Topics, laser: Laser, epoch_ns: int, known: Survey
) -> Iterator[Frame]:
    """The frames of the bag at ``path``, stamps less ``epoch_ns``.

    Raises ``LogFormatError`` for messages that cannot be, and where no scan has odometry.
    """
    names = [topics.scan, topics.odometry, topics.truth, topics.increment, topics.labels]
    with Bag(path, Repairs(path)) as bag:
        assembly = Assembly(topics, laser, epoch_ns, wait=True)
        messages = messages_of(bag, topics, names)
        for topic, log_ns, message, stamp_ns in known.in_order(messages, topics.scan):
            with about(path, bag.at):
                assembly.take(topic, log_ns, message, stamp_ns)
                ready = assembly.ready(log_ns) if assembly.waiting else []
            yield from ready
        with about(path, "at the end"):
            ready = assembly.ready(None)
        yield from ready
    assembly.report(path)


class Assembly:
    """Puts together what belongs to one stamp; ``wait``: odometry comes for sure, if late."""

    def __init__(self, topics: Topics, laser: Laser, epoch_ns: int, *, wait: bool = False) -> None:
        self._topics, self._laser, self._epoch_ns = topics, laser, epoch_ns
        self._wait = wait
        self.waiting: deque[tuple[Scan, int]] = deque()  # scans and when they were logged
        self._odometry, self._truth = PoseTrack(), PoseTrack()
        self._increments: dict[int, Float] = {}
        self._labels: dict[int, BeamLabels] = {}
        self._before: Stamped | None = None
        self._last_ns: int | None = None
        self._before_ns: int | None = None  # the scan before, of a bag without odometry
        self._disordered = self._without_odometry = self._given = 0

    def take(self, topic: str, log_ns: int, message: Any, stamp_ns: int | None = None) -> None:
        """One message of one of the topics; ``stamp_ns``: in place of its own."""
        stamp_ns = stamp_of(message, log_ns) if stamp_ns is None else stamp_ns
        stamp_ns, topics = stamp_ns - self._epoch_ns, self._topics
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
            if self._wait and now_ns is not None and not self._driven_to(stamp_ns):
                break
            self.waiting.popleft()
            frame = self._frame(scan)
            if frame is not None:
                out.append(frame)
        return out

    def _complete(self, stamp_ns: int) -> bool:
        topics = self._topics
        return (
            self._driven_to(stamp_ns)
            and (topics.truth is None or self._truth.reaches(stamp_ns))
            and (topics.labels is None or stamp_ns in self._labels)
            and (topics.increment is None or stamp_ns in self._increments)
        )

    def _driven_to(self, stamp_ns: int) -> bool:
        return self._topics.odometry is None or self._odometry.reaches(stamp_ns)

    def _frame(self, scan: Scan) -> Frame | None:
        stamp_ns = scan.stamp_ns
        odometry = self._driven(stamp_ns)
        if odometry is None:
            self._without_odometry += 1
            return None
        truth = self._truth.at(stamp_ns)
        labels = self._labels.pop(stamp_ns, None)
        for kept in (self._increments, self._labels):
            while kept and (next(iter(kept)) < stamp_ns or len(kept) > MOST_AHEAD):
                del kept[next(iter(kept))]  # of a scan that is not there
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


def read_bag(
    path: str | Path,
    *,
    scan: str | None = None,
    odometry: str | None = None,
    truth: str | None = None,
    labels: bool = False,
    strict: bool = False,
) -> Stream:
    """A bag with a LaserScan and an Odometry topic as frames, one scan at a time from the disk.

    Topics are guessed by type and name unless they are given. Odometry and truth (a PoseStamped or
    Odometry topic with "truth" in its name) are interpolated to the stamp of each scan where none
    has the very same stamp. ``labels`` reads ``/ground_truth/labels`` of our own recordings, too.

    The bag is read once before: what has to be put right (``slam.logs.bag_survey``) is told in one
    warning, counted in ``metadata.extra`` and refused by ``strict``. Scans whose headers differ are
    each read by their own.

    An accumulated covariance of the odometry becomes that of each increment by the rule of
    ``slam.logs.bag_laser.increment_covariance``, unless the bag has it as it was
    (``<odometry>_increment``). Beam times come from ``<scan>_turn`` where there is such a topic,
    else from ``time_increment``. The mounting is that of the transforms from the odometry's child
    frame to the scan's frame, or the robot's origin where the bag has none.

    Frames of our own recordings have the stamps of the simulation, from 0 s on;
    ``metadata.extra[EPOCH]`` is what the bag has more, ns.

    A bag without odometry (a scanner carried in the hand) gives frames of a robot at rest, whose
    covariance is that of one that may have moved; ``metadata.odometry`` says so, and ``Replay``
    gives each SLAM the odometry of a constant velocity instead. ``strict`` refuses such a bag.

    Raises ``LogFormatError`` that names the file for anything that is not such a bag.
    """
    path, asked = Path(path), Asked(scan=scan, odometry=odometry)
    repairs = Repairs(path, strict)
    with Bag(path, repairs) as bag:
        head = Head(bag, *choose(bag, asked, truth=truth, labels=labels))
        topics = head.decided()
        mount, mounted = head.placed(topics)
        known = survey(bag, topics, repairs)
        laser = _laser(bag, topics, known, mount)
        epoch_ns = _epoch_ns(bag, topics)
        kind = bag.topics[topics.scan][0]
        source = "rosbag1" if bag.is_ros1 else "rosbag2"
    extra: dict[str, Any] = {
        "file": path.name,
        "scan": _named(topics, topics.scan, topics.frame),
        "odometry": topics.odometry and _named(topics, topics.odometry, topics.child),
    }
    if laser.turned:
        extra["turned"] = laser.turned
    if kind == ECHOES:
        extra["echoes"] = "first echo of each beam"
    if topics.passed:
        extra["passed_over"] = list(topics.passed)
    if known.varies:
        extra["varies"] = known.varies
        _log.warning("%s: scans differ, each is read by its own header: %s", path, known.varies)
    count, why = len(known.ranks), ""
    if topics.odometry is None:
        why = head.without_odometry()
        repairs.note(NO_ODOMETRY, why, None, count)
    if known.stands:
        topics = replace(topics, odometry=None, increment=None)
    repairs.warn(why)
    extra |= {kind: n for kind, n in repairs.facts().items() if n}
    metadata = StreamMetadata(
        source=source,
        laser=laser.spec,
        truth=topics.truth or "",
        mounting=mounted,
        odometry=topics.odometry is not None,
        extra=extra | ({EPOCH: epoch_ns} if epoch_ns else {}),
    )
    return Stream(
        metadata=metadata,
        frames=lambda: frames_of(path, topics, laser, epoch_ns, known),
        length=count,
    )


def _named(topics: Topics, topic: str, frame: str) -> str:
    """The topic, with its frame where others share it."""
    return (
        f"{topic}:{frame}" if any(one.startswith(f"{topic}:") for one in topics.passed) else topic
    )


def frames_of_odometry(path: Path) -> tuple[str, str]:
    """In which the odometry of a bag is, and that moves, as ``read_bag`` reads it; "": unsaid."""
    with Bag(path) as bag:
        head = Head(bag, *choose(bag, Asked(), truth=None, labels=False))
        return head.frames(head.decided())


def _epoch_ns(bag: Bag, topics: Topics) -> int:
    """Time of the bag at second 0 of the simulation that it is of; 0 for every other bag."""
    if topics.began is None:
        return 0
    for _, _, message in bag.messages({topics.began}):
        with about(bag.path, bag.at):
            simulated = message.time_ref
            return stamp_of(message, 0) - int(simulated.sec) * NS_PER_S - int(simulated.nanosec)
    return 0


def _laser(bag: Bag, topics: Topics, known: Survey, mount: tuple[Float, bool]) -> Laser:
    """The scanner, of the first scans that count and the turns of the first."""
    scans: list[Any] = []
    turns: list[Any] = []
    messages = messages_of(bag, topics, (topics.scan, topics.turns))
    for topic, _, message, _ in known.in_order(messages, topics.scan):
        (scans if topic == topics.scan else turns).append(message)
        if len(scans) > (topics.turns is not None):
            break
    if not scans:
        raise LogFormatError(bag.path, f"no scan on {topics.scan}")
    with about(bag.path, f"topic {topics.scan}, message 1"):
        times = [stamp_of(scan, 0) for scan in scans]
        end = times[1] if len(times) > 1 else math.inf
        turns = [turn for turn in turns if times[0] <= stamp_of(turn, 0) < end]
        return Laser(scans[0], turns, mount, saturates=known.saturates)


__all__ = ["SCAN", "read_bag"]
