# SPDX-License-Identifier: Apache-2.0
"""What somebody's stack said while a bag was recorded, as a SLAM: to be scored after the fact."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import InvalidValueError, LogFormatError
from slam.estimate import Estimate
from slam.frames import NS_PER_S, Float, Frame
from slam.logs.bag_laser import PoseTrack, Stamped
from slam.logs.bag_topics import INCREMENT, TRANSFORMS, Bag
from slam.logs.text import about
from slam.path import PosePath
from slam.ros.heard import StampedPose, pose_of, transform_of
from slam.ros.messages import MAP, ODOM
from slam.trajectory import Trajectory

APART_S = 60.0  # no stamp of the stack so near to any of the scans: its clock is another one


def read_statements(
    path: Path, *, pose: str | None = None, frames: tuple[str, str] = (MAP, ODOM)
) -> list[StampedPose]:
    """What a stack states in a bag, in the order of its stamps, each stamp once.

    pose    topic of its poses in the map (PoseWithCovarianceStamped); None: transforms on /tf
    frames  names of the frames of map and odometry in those transforms

    Raises ``LogFormatError`` for a bag without any.
    """
    found: dict[int, StampedPose] = {}
    with Bag(path) as bag:
        kinds = (INCREMENT,) if pose is not None else TRANSFORMS
        topics = [
            name for name, (kind, _) in bag.topics.items()
            if kind in kinds and name == (pose if pose is not None else "/tf")
        ]  # fmt: skip
        for _, _, message in bag.messages(topics):
            with about(path, bag.at):
                said = transform_of(message, *frames) if pose is None else pose_of(message)
            if said is not None:
                found[said.stamp_ns] = said
        listed = ", ".join(f"{name} ({kind})" for name, (kind, _) in sorted(bag.topics.items()))
    if not found:
        what = f"{frames[0]} -> {frames[1]} on /tf" if pose is None else f"pose on {pose}"
        raise LogFormatError(path, f"no {what}; topics: {listed or 'none'}")
    return [found[stamp_ns] for stamp_ns in sorted(found)]


class RecordedSlam:
    """A stack's statements as estimates of the frames that it saw.

    statements  of ``read_statements``
    poses       whether they are poses in the map, else map -> odom
    clock_offset_s  to be added to their stamps

    A transform is looked up as tf2 does, between its neighbours in time. A pose stands until the
    next, carried on by odometry. Before the first, odometry stands and nothing converged.
    """

    def __init__(
        self, statements: list[StampedPose], *, poses: bool = False, clock_offset_s: float = 0.0
    ) -> None:
        offset_ns = round(clock_offset_s * NS_PER_S)
        self._all = [said._replace(stamp_ns=said.stamp_ns + offset_ns) for said in statements]
        self._poses = poses
        self.reset()

    def reset(self) -> None:
        """From the first frame on again."""
        self._path, self._links, self._next = PosePath(), PoseTrack(), 0
        self._last: tuple[int, Float] | None = None
        self._T_map_odom: Float | None = None
        self._T_own_map: Float | None = None
        self._first: Float | None = None
        self._covariance = np.zeros((3, 3))
        if not self._poses:
            for said in self._all:
                self._links.add(Stamped(stamp_ns=said.stamp_ns, pose=said.pose))

    def update(self, frame: Frame) -> Estimate:
        """The statement for this frame.

        Raises ``InvalidValueError`` at the first frame where the clocks are apart.
        """
        stamp_ns, T_odom_robot = frame.stamp_ns, frame.odometry.T_odom_robot
        self._path.check_order(stamp_ns)
        if self._first is None:
            self._first = T_odom_robot
            self._check_clock(stamp_ns)
        if self._poses:
            self._carry(stamp_ns, T_odom_robot)
        else:
            self._look_up(stamp_ns)
        self._last = (stamp_ns, T_odom_robot)
        T_map_odom, first = self._T_map_odom, self._first
        if T_map_odom is None:
            T_own_robot = se2.between(first, T_odom_robot)
        else:
            if self._T_own_map is None:
                self._T_own_map = se2.inverse(se2.compose(T_map_odom, first))
            T_own_robot = se2.compose(self._T_own_map, se2.compose(T_map_odom, T_odom_robot))
        self._path.add(stamp_ns, T_own_robot)
        return Estimate(
            stamp_ns=stamp_ns,
            T_map_robot=T_own_robot,
            covariance=self._covariance,
            converged=T_map_odom is not None,
        )

    def _look_up(self, stamp_ns: int) -> None:
        found = self._links.at(stamp_ns)
        if found is not None:
            self._T_map_odom = found.pose
        elif stamp_ns > self._all[-1].stamp_ns:
            self._T_map_odom = self._all[-1].pose

    def _carry(self, stamp_ns: int, T_odom_robot: Float) -> None:
        before_ns, before = self._last or (stamp_ns, T_odom_robot)
        while self._next < len(self._all) and self._all[self._next].stamp_ns <= stamp_ns:
            said = self._all[self._next]
            self._next += 1
            part = 1.0
            if before_ns < stamp_ns:
                part = max(0.0, (said.stamp_ns - before_ns) / (stamp_ns - before_ns))
            T_odom_then = se2.interpolate(before, T_odom_robot, part)
            self._T_map_odom = se2.compose(said.pose, se2.inverse(T_odom_then))
            self._covariance = np.zeros((3, 3)) if said.covariance is None else said.covariance

    def _check_clock(self, first_ns: int) -> None:
        off_s = (self._all[0].stamp_ns - first_ns) / NS_PER_S
        over_s = (first_ns - self._all[-1].stamp_ns) / NS_PER_S
        if off_s > APART_S or over_s > APART_S:
            raise InvalidValueError(
                f"the stack's first stamp is {off_s:.3f} s after the first scan's: two clocks? "
                f"Then --clock-offset {-off_s:.3f}"
            )

    def map(self) -> None:
        """None: it is not read from the bag."""

    def trajectory(self) -> Trajectory:
        """The online poses."""
        return self._path.trajectory()
