# SPDX-License-Identifier: Apache-2.0
"""The first seconds of a bag: which scanner and which odometry, where the scanner is."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from slam.errors import LogFormatError
from slam.frames import NS_PER_S, Float
from slam.logs.bag_laser import Stamped
from slam.logs.bag_tf import (
    Chain,
    Edge,
    begins_at,
    check_number,
    edge_of,
    ends_at,
    frame_name,
    mounting,
    odometry_way,
    of_another,
    robot_of,
    stands,
    way,
)
from slam.logs.bag_topics import INCREMENT, Bag, Topics, scanners, shared
from slam.logs.ros_numbers import quaternion_of
from slam.logs.text import about

PROBE_NS = 20 * NS_PER_S  # how far the transform to the laser is looked for
TRY_NS = NS_PER_S // 10  # between two looks at what is known
SURVEY_NS = NS_PER_S  # how far frames of another scanner on the same topic are


class Head:
    """What the messages say up to where all is known.

    count     of scans, by their frame
    children  by topic of odometry: the frames that move, and how often
    parents   by topic of odometry: the frame in which it is
    links     (parent, child) -> geometry_msgs/Transform, as first seen
    """

    def __init__(self, bag: Bag, topics: Topics, drives: list[str]) -> None:
        self._bag, self._topics, self._drives = bag, topics, drives
        self.count = Counter[str]()
        self.parents: dict[str, str] = {}
        self.children = defaultdict[str, Counter[str]](Counter)
        self.links: dict[Edge, Any] = {}
        self._tried_ns = -(1 << 62)
        self._tried: Any = None
        self._known = False
        self._read()

    def _read(self) -> None:
        start_ns = None
        wanted = {self._topics.scan, *self._drives, *self._topics.transforms}
        for topic, log_ns, message in self._bag.messages(wanted):
            start_ns = log_ns if start_ns is None else start_ns
            with about(self._bag.path, self._bag.at):
                self._take(topic, message)
                passed_ns = log_ns - start_ns
                if self.count and passed_ns > (SURVEY_NS if self._all_known(log_ns) else PROBE_NS):
                    return

    def _take(self, topic: str, message: Any) -> None:
        topics = self._topics
        if topic == topics.scan:
            frame = frame_name(message.header.frame_id)
            self.count[frame] += 1
        elif topic in topics.transforms:
            for link in message.transforms:
                self.links.setdefault(edge_of(link), link.transform)
            check_number(self.links)
        else:
            self.parents.setdefault(topic, frame_name(message.header.frame_id))
            self.children[topic][frame_name(message.child_frame_id)] += 1

    def _all_known(self, log_ns: int) -> bool:
        """Whether the way to the scanner is known, from odometry of a topic or of /tf."""
        if not self._known and not 0 <= log_ns - self._tried_ns < TRY_NS:
            self._tried_ns = log_ns
            usual = (max(c, key=lambda f: c[f], default="") for c in self._counts())
            now = len(self.links), sum(map(len, self._counts())), *usual
            if now == self._tried:  # it says what it said
                return not self._topics.transforms
            self._tried = now
            topics = self.decided()
            self._known = topics.odometry is not None and self.mount(topics) is not None
        return self._known or not self._topics.transforms

    def _counts(self) -> list[Counter[str]]:
        return [self.count, *self.children.values()]

    def decided(self) -> Topics:
        """The topics with frames and odometry: of the scan's namespace, joined to it by /tf."""
        topics = self._topics
        frames = self.count if topics.frame == "" else {topics.frame: self.count[topics.frame]}
        frame = max(frames, key=lambda f: frames[f], default="")
        ends = {end for edge in self.links for end in edge}
        found: list[tuple[tuple[int, ...], str, str, str]] = []
        for topic in self._drives:
            for child, count in self.children[topic].items():
                name = f"{topic}:{child}" if len(self.children[topic]) > 1 else topic
                joined = child == frame or (
                    {child, frame} <= ends and mounting(self.links, child, frame) is not None
                )
                rank = (-shared(topic, topics.scan), not joined, self._drives.index(topic), -count)
                if topics.child in ("", child) and (
                    topics.odometry or not of_another(child, frame)
                ):
                    found.append((rank, topic, child, name))
        way = [] if found else odometry_way(self.links, frame, topics.child)
        if not (found or way or any(self.children.values())) and self._drives:
            found = [((), self._drives[0], "", self._drives[0])]  # it begins later
        _, odometry, child, name = min(found, default=((), None, "", ""))
        if way:
            child = ends_at(way)
            odometry = f"{begins_at(way)} -> {child} of {' and '.join(topics.transforms)}"
        return replace(
            topics, frame=frame, odometry=odometry, child=child, way=tuple(way),
            increment=self._increment(odometry), passed=self._passed(frame, name),
        )  # fmt: skip

    def _increment(self, odometry: str | None) -> str | None:
        name = f"{odometry}_increment"
        return name if self._bag.topics.get(name, ("", 0))[0] == INCREMENT else None

    def _passed(self, frame: str, odometry: str) -> tuple[str, ...]:
        scan = self._topics.scan
        others = [name for name in scanners(self._bag) if name != scan]
        others += [f"{scan}:{other}" for other in self.count if other != frame]
        for topic in self._drives:
            several = len(self.children[topic]) > 1
            names = [f"{topic}:{child}" for child in self.children[topic]] if several else [topic]
            others += [name for name in names if name != odometry]
        return tuple(others)

    def frames(self, topics: Topics) -> tuple[str, str]:
        """In which the odometry is, and that moves; "" where nothing says."""
        if topics.way:
            return begins_at(topics.way), ends_at(topics.way)
        parent = self.parents.get(topics.odometry or "", "")
        return parent, robot_of(self.links, topics.child, topics.frame)

    def mount(self, topics: Topics) -> tuple[tuple[Float, bool], str] | None:
        """``T_robot_laser``, whether it hangs, and by what it is known; None where nothing says."""
        robot = self.frames(topics)[1]
        found = mounting(self.links, robot, topics.frame)
        if found is not None:
            return found, f"{robot} -> {topics.frame} of {' and '.join(topics.transforms)}"
        if robot == topics.frame:
            return (np.zeros(3), False), f"the scan's own frame, {robot}"
        return None

    def without_odometry(self) -> str:
        """Why there is none; what /tf has instead."""
        why = "no message of nav_msgs/msg/Odometry"
        if self._drives:
            return f"{why} of the scanner's own robot: {', '.join(self._drives)} are of others"
        frame, topics = next(iter(self.count), ""), self._topics.transforms
        ends = {f for edge in self.links for f in edge if stands(f) and way(self.links, f, frame)}
        if not topics or not ends:
            return f"{why}, and no frame of odometry on /tf"
        names = " or ".join(f"--odometry {topics[0]}:{end}" for end in sorted(ends)[:3])
        return f"{why}, and no frame of odometry on /tf; if it is another one: {names}"

    def placed(self, topics: Topics) -> tuple[tuple[Float, bool], str]:
        """``mount``, or the robot's origin and "" where nothing says.

        Raises ``LogFormatError`` where there is no scan, or no odometry, of the frame asked for.
        """
        path, asked = self._bag.path, self._topics
        if asked.odometry and topics.odometry is None:
            links = {frame for edge in self.links for frame in edge}
            frames = ", ".join(sorted(links.union(*self.children.values()))) or "none"
            where = f"{asked.odometry}:{asked.child}"
            raise LogFormatError(path, f"no odometry on {where}; frames are: {frames}")
        if not self.count[topics.frame]:
            frames = ", ".join(self.count)
            of = f" of frame {topics.frame}; there are: {frames}" if topics.frame else ""
            raise LogFormatError(path, f"no scan on {topics.scan}{of}")
        with about(path, f"topic {topics.scan}, message 1"):
            return self.mount(topics) or ((np.zeros(3), False), "")


def messages_of(
    bag: Bag, topics: Topics, names: Iterable[str | None]
) -> Iterator[tuple[str, int, Any]]:
    """Messages of those topics but those of another scanner or robot; of /tf, as odometry."""
    wanted = {name for name in names if name}
    chain = Chain(topics.way if topics.odometry in wanted else (), min)
    wanted |= set(topics.transforms) if chain.steps else set()
    frames = {topics.scan: topics.frame, topics.odometry: topics.child}
    last_ns = None
    for topic, log_ns, message in bag.messages(wanted):
        frame = frames.get(topic, "")
        if chain.steps and topic in topics.transforms:
            with about(bag.path, bag.at):
                now = chain.newest(topic, message, log_ns)
            if now is not None and now.stamp_ns != last_ns:
                last_ns = now.stamp_ns
                yield topics.odometry or "", log_ns, _as_odometry(now)
        elif not frame or frame == _frame_of(message, topic == topics.scan):
            yield topic, log_ns, message


def _frame_of(message: Any, scan: bool) -> str:
    """Of the scanner, or that which odometry says moves."""
    return frame_name(message.header.frame_id if scan else message.child_frame_id)


def _as_odometry(now: Stamped) -> Any:
    """A nav_msgs/Odometry that knows no speed."""
    x, y, theta = now.pose.tolist()
    z, w = quaternion_of(theta)
    seconds, nanoseconds = divmod(now.stamp_ns, NS_PER_S)
    made = SimpleNamespace
    zero, unknown = made(x=0.0, y=0.0, z=0.0), np.full(36, -1.0)
    turn, place = made(x=0.0, y=0.0, z=z, w=w), made(x=x, y=y, z=0.0)
    return made(
        header=made(stamp=made(sec=seconds, nanosec=nanoseconds)),
        pose=made(pose=made(position=place, orientation=turn), covariance=np.zeros(36)),
        twist=made(twist=made(linear=zero, angular=zero), covariance=unknown),
    )
