# SPDX-License-Identifier: Apache-2.0
"""What somebody's stack said while a bag was recorded, as a SLAM: to be scored after the fact."""

import logging
import math
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from slam.errors import InvalidValueError, LogFormatError
from slam.estimate import Estimate
from slam.frames import NS_PER_S, Frame, Odometry
from slam.logs.bag_laser import PoseTrack, Stamped
from slam.logs.bag_tf import (
    MOST_TRANSFORMS,
    Chain,
    Edge,
    Step,
    bases,
    edge_of,
    ends_at,
    way,
)
from slam.logs.bag_topics import INCREMENT, TRANSFORMS, Bag
from slam.logs.text import about
from slam.path import OnPath, PosePath
from slam.ros.messages import MAP, ODOM
from slam.ros.node import StampedPose, Statements, pose_of

_log = logging.getLogger(__name__)
ANOTHER_M = 0.05  # median; more: that is another odometry
_TF = ("/tf", "/tf_static")
APART_S = 60.0  # no stamp of the stack so near to any of the scans: its clock is another one


def read_statements(
    path: Path, *, pose: str | None = None, frames: tuple[str, str] = (MAP, ODOM), robot: str = ""
) -> tuple[list[StampedPose], bool]:
    """What a stack states in a bag, in the order of its stamps, each stamp once; whether poses.

    pose    topic of its poses in the map (PoseWithCovarianceStamped); None: transforms on /tf
    frames  names of the frames of map and odometry in those transforms
    robot   that of the robot, followed where no way leads from map to odometry: those are poses

    What cannot be is left out, and told once. Raises ``LogFormatError`` for a bag without any.
    """
    found: dict[int, StampedPose] = {}
    wrong: list[LogFormatError] = []
    with Bag(path) as bag:
        kinds = (INCREMENT,) if pose is not None else TRANSFORMS
        names = _TF if pose is None else (pose,)
        topics = [name for name, (kind, _) in bag.topics.items() if kind in kinds and name in names]
        steps = [] if pose is not None else _steps(bag, topics, frames, robot)
        chain = Chain(steps)
        for topic, log_ns, message in bag.messages(topics):
            try:
                with about(path, bag.at):
                    said = pose_of(message) if pose else _said(chain.newest(topic, message, log_ns))
            except LogFormatError as error:
                wrong.append(error)
                continue
            if said is not None:
                found[said.stamp_ns] = said
        listed = ", ".join(f"{name} ({kind})" for name, (kind, _) in sorted(bag.topics.items()))
    if wrong:
        _log.warning("left out of what was said: %d messages, the first: %s", len(wrong), wrong[0])
    if not found:
        what = f"{frames[0]} -> {frames[1]} on /tf" if pose is None else f"pose on {pose}"
        raise LogFormatError(path, f"no {what}; topics: {listed or 'none'}")
    poses = pose is not None or robot == frames[1] or ends_at(steps) != frames[1]
    return [found[stamp_ns] for stamp_ns in sorted(found)], poses


def _said(now: Stamped | None) -> StampedPose | None:
    return None if now is None else StampedPose(now.stamp_ns, now.pose)


def is_odometry(
    path: Path, frames: tuple[str, str], driven: Iterable[Odometry], shift_ns: int
) -> bool:
    """Whether transforms from odometry to the robot in a bag are what was ``driven``, or missing.

    A stack may have a frame of odometry of its own, whatever its name.

    shift_ns  what the stamps of the bag have more
    """
    with Bag(path) as bag:
        topics = [name for name in _TF if bag.topics.get(name, ("", 0))[0] in TRANSFORMS]
        steps = way(_links(bag, topics), *frames)
        if not steps:
            return True
        chain, track = Chain(steps), PoseTrack()
        for topic, log_ns, message in bag.messages(topics):
            with suppress(InvalidValueError):  # told where the statements are read
                if (now := chain.newest(topic, message, log_ns)) is not None:
                    track.add(now)
    apart = [
        math.dist(now.pose[:2], one.T_odom_robot[:2])
        for one in driven
        if (now := track.at(one.stamp_ns + shift_ns)) is not None
    ]
    return not apart or float(np.median(apart)) < ANOTHER_M


def _steps(bag: Bag, topics: list[str], frames: tuple[str, str], robot: str) -> list[Step]:
    """The way from the map to odometry, else to the robot; [] without one."""
    links = _links(bag, topics)
    goals = (frames[1], robot, *bases(links, robot))
    return next(filter(None, (way(links, frames[0], goal, fixed=True) for goal in goals)), [])


def _links(bag: Bag, topics: list[str]) -> dict[Edge, Any]:
    links: dict[Edge, Any] = {}
    for _, _, message in bag.messages(topics):
        links |= {edge_of(link): link.transform for link in message.transforms}
        if len(links) > MOST_TRANSFORMS:
            break
    return links


def aligned(
    path: Path, statements: list[StampedPose], first_ns: int, *, offset_s: float, epoch_ns: int
) -> list[StampedPose]:
    """The statements of the bag at ``path`` by the clock of the frames, the first at ``first_ns``.

    offset_s  to be added to their stamps;   epoch_ns  what the bag of the frames has more

    Raises ``LogFormatError`` for clocks that are apart.
    """
    offset_ns = round(offset_s * NS_PER_S) - epoch_ns
    moved = [said._replace(stamp_ns=said.stamp_ns + offset_ns) for said in statements]
    off_s = (moved[0].stamp_ns - first_ns) / NS_PER_S
    over_s = (first_ns - moved[-1].stamp_ns) / NS_PER_S
    if off_s > APART_S or over_s > APART_S:
        raise LogFormatError(
            path, f"its first stamp is {abs(off_s):.3f} s {'after' if off_s > 0 else 'before'} "
            f"the first scan's: two clocks? Then --clock-offset {offset_s - off_s:.3f}",
        )  # fmt: skip
    return moved


class RecordedSlam(OnPath):
    """A stack's statements as estimates of the frames that it saw, as if it said them now.

    statements  by the clock of the frames
    poses       whether they are poses in the map, else map -> odom

    Before the first, odometry stands and nothing converged.
    """

    def __init__(self, statements: list[StampedPose], *, poses: bool = False) -> None:
        self._all, self._poses = statements, poses
        self.reset()

    def reset(self) -> None:
        """From the first frame on again."""
        self._path, self._said, self._next = PosePath(), Statements(), 0

    def update(self, frame: Frame) -> Estimate:
        """The newest statement that is not later than this frame."""
        now_ns = frame.stamp_ns
        self._path.check_order(now_ns)
        self._said.sent(frame.odometry, now_ns)
        take = self._said.pose if self._poses else self._said.transform
        while self._next < len(self._all) and self._all[self._next].stamp_ns <= now_ns:
            take(self._all[self._next])
            self._next += 1
        estimate = self._said.estimate()
        self._path.add(now_ns, estimate.T_map_robot)
        return estimate

    def processor_s(self) -> float:
        """Not a number: a bag does not say what the stack needed."""
        return math.nan
