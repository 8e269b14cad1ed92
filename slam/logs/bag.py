# SPDX-License-Identifier: Apache-2.0
"""Bags of ROS 2 (rosbag2 folder, .mcap, .db3) and ROS 1 (.bag) as frames, without ROS."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from slam.errors import LogFormatError
from slam.frames import EPOCH, NS_PER_S, Stream, StreamMetadata
from slam.logs.bag_frames import frames_of, stamp_of
from slam.logs.bag_laser import Laser, mounting
from slam.logs.bag_topics import SCAN, Bag, Topics, choose
from slam.logs.repairs import NO_ODOMETRY, Repairs
from slam.logs.text import about

PROBE_NS = 20 * NS_PER_S  # how far the transform to the laser is looked for
_BASE = "base_link"  # of REP 105


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
    has the very same stamp; scans outside the time of the odometry are dropped, and so are scans
    whose stamps do not increase (both are counted in the log). ``labels`` reads
    ``/ground_truth/labels`` of our own recordings, too.

    An accumulated covariance of the odometry becomes that of each increment by the rule of
    ``slam.logs.bag_odometry.increment_covariance``, unless the bag has it as it was
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
    path = Path(path)
    with Bag(path) as bag:
        topics = choose(bag, scan=scan, odometry=odometry, truth=truth, labels=labels)
        laser, mounted = _probe(bag, topics)
        epoch_ns = _epoch_ns(bag, topics)
        count = bag.topics[topics.scan][1]
        source = "rosbag1" if bag.is_ros1 else "rosbag2"
    extra: dict[str, Any] = {"file": path.name, "scan": topics.scan, "odometry": topics.odometry}
    if laser.turned:
        extra["turned"] = laser.turned
    repairs = Repairs(path, strict)
    if topics.odometry is None:
        repairs.note(NO_ODOMETRY, "no message of nav_msgs/msg/Odometry", None, count)
        repairs.warn()
    metadata = StreamMetadata(
        source=source,
        laser=laser.spec,
        truth=topics.truth or "",
        mounting=mounted,
        odometry=topics.odometry is not None,
        extra=extra | ({EPOCH: epoch_ns} if epoch_ns else {}),
    )
    return Stream(
        metadata=metadata, frames=lambda: frames_of(path, topics, laser, epoch_ns), length=count
    )


def _epoch_ns(bag: Bag, topics: Topics) -> int:
    """Time of the bag at second 0 of the simulation that it is of; 0 for every other bag."""
    if topics.began is None:
        return 0
    for _, _, message in bag.messages({topics.began}):
        with about(bag.path, bag.at):
            simulated = message.time_ref
            return stamp_of(message, 0) - int(simulated.sec) * NS_PER_S - int(simulated.nanosec)
    return 0


def _probe(bag: Bag, topics: Topics) -> tuple[Laser, str]:  # noqa: C901 (one branch a kind of file)
    """The scanner, from the first messages of the bag; where its mounting comes from."""
    named = (topics.scan, topics.odometry, topics.turns, *topics.transforms)
    wanted = {name for name in named if name is not None}
    transforms: dict[tuple[str, str], Any] = {}
    scans: list[Any] = []
    turns: list[Any] = []
    # where nobody says what moves: the usual name, or else the laser itself
    robot = _BASE if topics.odometry is None else None
    mount, start_ns = None, None
    for topic, log_ns, message in bag.messages(wanted):
        start_ns = log_ns if start_ns is None else start_ns
        with about(bag.path, bag.at):
            if topic == topics.scan:
                scans = [*scans, message][:2]
            elif topic == topics.turns:
                turns.append(message)
            elif topic == topics.odometry:
                robot = _frame_name(message.child_frame_id)
            elif topic in topics.transforms:
                for t in message.transforms:
                    edge = (_frame_name(t.header.frame_id), _frame_name(t.child_frame_id))
                    transforms[edge] = t.transform
            if scans and robot is not None:
                laser = _frame_name(scans[0].header.frame_id)
                mount = mounting(transforms, robot, laser)
                known = mount is not None or laser == robot or log_ns - start_ns > PROBE_NS
                if known and (len(scans) > 1 or topics.turns is None):
                    break
    if not scans:
        raise LogFormatError(bag.path, f"no scan on {topics.scan}")
    frame = _frame_name(scans[0].header.frame_id)
    said = f"{robot} -> {frame} of {' and '.join(topics.transforms)}" if mount is not None else ""
    if mount is None and frame == robot:
        said = f"the scan's own frame, {frame}"
    with about(bag.path, f"topic {topics.scan}, message 1"):
        times = [stamp_of(scan, 0) for scan in scans]
        end = times[1] if len(times) > 1 else math.inf
        turns = [turn for turn in turns if times[0] <= stamp_of(turn, 0) < end]
        return Laser(scans[0], turns, (np.zeros(3), False) if mount is None else mount), said


def _frame_name(name: str) -> str:
    return name.lstrip("/")


__all__ = ["SCAN", "read_bag"]
