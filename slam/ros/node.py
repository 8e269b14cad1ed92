# SPDX-License-Identifier: Apache-2.0
"""What an outside SLAM says on the network, put together: its map -> odom, covariance and map."""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from slam import se2
from slam.errors import MobiliaError
from slam.estimate import Raster
from slam.frames import NS_PER_S, Float, Odometry
from slam.ros.heard import StampedPose, decoded, pose_of, raster_of, transform_of
from slam.ros.link import Link, Topic
from slam.ros.messages import MAP, ODOM, TransformMessage
from slam.ros.navigation_messages import MapMessage, StartMessage

CLOCK_NS = 60 * NS_PER_S  # a stamp so far from the scan's is of another clock
_KEPT = 200  # odometry poses that a late pose may refer to
TF = Topic(name="/tf", kind=TransformMessage.KIND, depth=200)
GRID = Topic(name="/map", kind=MapMessage.KIND, latched=True, depth=1)
POSES = tuple(Topic(name=name, kind=StartMessage.KIND) for name in ("/pose", "/amcl_pose"))
_log = logging.getLogger(__name__)


class Node:
    """The node on the other side of ``link``.

    T_own_odom  of odometry's frame in that of our first pose, as it says; None until it does
    covariance  (3, 3) as it states it, zeros where it does not
    odd         how often what was wrong: "malformed", "from_others", "clock_off_s"

    The first that states map -> odom is believed as long as this lives; another one that does is
    counted and left out.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        for topic in (TF, GRID, *POSES):
            link.subscribe(topic)
        self.T_own_odom: Float | None = None
        self.covariance, self.odd = np.zeros((3, 3)), dict[str, float]()
        self._answered_ns, self._states_transforms, self._sender = -(1 << 62), False, ""
        self._odometry: OrderedDict[int, Float] = OrderedDict()
        self._first: Float | None = None
        self._T_own_map: Float | None = None
        self._grid: bytes | None = None

    def sent(self, odometry: Odometry) -> None:
        """A frame with this odometry goes out."""
        if self._first is None:
            self._first = odometry.T_odom_robot
        self._odometry[odometry.stamp_ns] = odometry.T_odom_robot
        if len(self._odometry) > _KEPT:
            self._odometry.popitem(last=False)
        self._now_ns = odometry.stamp_ns

    def answered(self) -> bool:
        """Take what has come; whether the last frame is answered."""
        for taken in self._link.take(TF):
            with self._reading(TF):
                found = transform_of(decoded(TF.kind, taken.data), MAP, ODOM)
                if found is not None and self._timely(found) and self._believed(taken.sender):
                    self._states_transforms = True
                    self._take(found.stamp_ns, found.pose)
        for topic in POSES:
            for taken in self._link.take(topic):
                with self._reading(topic):
                    self._take_pose(pose_of(decoded(topic.kind, taken.data)))
        for taken in self._link.take(GRID):
            self._grid = taken.data
        return self._answered_ns >= self._now_ns

    @contextmanager
    def _reading(self, topic: Topic) -> Iterator[None]:
        """What cannot be read is counted and said once."""
        try:
            yield
        except MobiliaError as error:
            if "malformed" not in self.odd:
                _log.warning("ROS 2: %s: left out: %s", topic.name, error)
            self.odd["malformed"] = self.odd.get("malformed", 0) + 1

    def _timely(self, found: StampedPose) -> bool:
        """Whether its stamp can be of this run."""
        off_ns = found.stamp_ns - self._now_ns
        if abs(off_ns) <= CLOCK_NS:
            return True
        self.odd["clock_off_s"] = off_ns / NS_PER_S
        return False

    def _believed(self, sender: str) -> bool:
        if not self._sender:
            self._sender = sender
        if sender == self._sender:
            return True
        if "from_others" not in self.odd:
            _log.warning("ROS 2: a second node states %s -> %s: it is left out", MAP, ODOM)
        self.odd["from_others"] = self.odd.get("from_others", 0) + 1
        return False

    def _take(self, stamp_ns: int, T_map_odom: Float) -> None:
        """The newest statement stands; one stamped ahead answers this frame, and no other."""
        stamp_ns = min(stamp_ns, self._now_ns)
        if stamp_ns < self._answered_ns:
            return
        if self._T_own_map is None:
            assert self._first is not None
            self._T_own_map = se2.inverse(se2.compose(T_map_odom, self._first))
        self._answered_ns = stamp_ns
        self.T_own_odom = se2.compose(self._T_own_map, T_map_odom)

    def _take_pose(self, found: StampedPose) -> None:
        """A pose states the covariance, and map -> odom where nothing else does."""
        if not self._timely(found):
            return
        T_odom_robot = self._odometry.get(found.stamp_ns)
        if T_odom_robot is not None and not self._states_transforms:
            self._take(found.stamp_ns, se2.compose(found.pose, se2.inverse(T_odom_robot)))
        if found.covariance is not None and self._T_own_map is not None:
            c, s = np.cos(self._T_own_map[2]), np.sin(self._T_own_map[2])
            turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            self.covariance = turn @ found.covariance @ turn.T

    def estimate(self) -> Float:
        """The last pose in the frame of our first one; odometry's until something is stated."""
        assert self._first is not None
        T_odom_robot = self._odometry[self._now_ns]
        T_own_odom = se2.inverse(self._first) if self.T_own_odom is None else self.T_own_odom
        return se2.compose(T_own_odom, T_odom_robot)

    def map(self) -> Raster | None:
        """Its map; ``InvalidValueError`` for what cannot be one."""
        if self._grid is None or self._T_own_map is None:
            return None
        return raster_of(decoded(GRID.kind, self._grid), self._T_own_map)

    def why_silent(self) -> str:
        """What may be the reason for no answer, in words."""
        off_s = self.odd.get("clock_off_s")
        if off_s is not None:
            return (
                f"; its stamps are {abs(off_s):.0f} s {'ahead' if off_s > 0.0 else 'behind'}: "
                "run it with use_sim_time:=true"
            )
        bad = self.odd.get("malformed")
        return f"; {bad:.0f} messages that cannot be read" if bad else ""
