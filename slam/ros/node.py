# SPDX-License-Identifier: Apache-2.0
"""What an outside SLAM says, put together: its map -> odom, covariance and map.

Messages are bytes of strangers: bounded and checked.
"""

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from slam import se2
from slam.checked import covariance
from slam.errors import InvalidValueError, MobiliaError
from slam.estimate import Estimate, Raster
from slam.frames import NS_PER_S, Float, Odometry
from slam.frontend.odometry_prior import turned
from slam.logs import unpacking
from slam.logs.bag import PLANAR
from slam.logs.bag_laser import PoseTrack, Stamped, stamp_of
from slam.logs.bag_tf import planar_of
from slam.logs.ros_numbers import MOST_POSE_M, planar
from slam.ros.link import Link, Topic
from slam.ros.messages import MAP, ODOM, MapMessage, PoseMessage, TransformMessage
from slam.ros.template import STORE

MOST_CELLS = 1 << 26  # of a map: a square of 400 m at 5 cm
unpacking.bound_rosbags()


class StampedPose(NamedTuple):
    """A pose, and when it was so as its message says; covariance (3, 3), None: none is stated."""

    stamp_ns: int
    pose: Float
    covariance: Float | None = None


def decoded(kind: str, data: bytes) -> Any:
    """The message; ``InvalidValueError`` for bytes that are none."""
    try:
        return STORE.deserialize_cdr(data, kind)
    except MobiliaError:
        raise
    except Exception as error:  # parsers of foreign bytes fail in every way
        raise InvalidValueError(f"{len(data)} bytes that are no {kind}: {error!s:.80}") from error


def transform_of(message: Any, parent: str, child: str) -> StampedPose | None:
    """That transform of a tf2_msgs/TFMessage; None where it has none."""
    for link in message.transforms:
        names = (link.header.frame_id.lstrip("/"), link.child_frame_id.lstrip("/"))
        if names == (parent, child):
            return StampedPose(stamp_of(link, 0), planar_of(link.transform))
    return None


def pose_of(message: Any) -> StampedPose:
    """A geometry_msgs/PoseWithCovarianceStamped; all zeros as covariance state nothing.

    Raises ``InvalidValueError`` for a place or a covariance that cannot be.
    """
    spread = covariance("pose", "covariance", np.asarray(message.pose.covariance)[PLANAR])
    if spread.max() > MOST_POSE_M**2:
        raise InvalidValueError(f"pose.covariance must be at most {MOST_POSE_M**2:g} m^2")
    said = spread if spread.any() else None
    return StampedPose(stamp_of(message, 0), planar(message.pose.pose), said)


def raster_of(grid: Any, T_own_map: Float) -> Raster | None:
    """A nav_msgs/OccupancyGrid in the frame of the first pose; None for an empty one.

    T_own_map  of the grid's frame in ours. Raises ``InvalidValueError`` for what cannot be a map.
    """
    width, height = int(grid.info.width), int(grid.info.height)
    if width * height == 0:
        return None
    if width * height > MOST_CELLS or len(grid.data) != width * height:
        raise InvalidValueError(
            f"/map: expected width * height cells, at most {MOST_CELLS}, "
            f"got {width} * {height} and {len(grid.data)} of them"
        )
    cells = grid.data.astype(np.float32).reshape(height, width) / np.float32(100.0)
    cells[(cells < 0.0) | (cells > 1.0)] = np.nan
    origin = se2.compose(T_own_map, planar(grid.info.origin))
    return Raster(values=cells, resolution_m=float(grid.info.resolution), T_map_origin=origin)


CLOCK_NS = 60 * NS_PER_S  # a stamp so far from the scan's is of another clock
_KEPT_NS = 10 * NS_PER_S  # of odometry, that a late pose may refer to
TF = Topic(name="/tf", kind=TransformMessage.KIND, depth=200)
GRID = Topic(name="/map", kind=MapMessage.KIND, latched=True, depth=1)
POSES = tuple(Topic(name=name, kind=PoseMessage.KIND) for name in ("/pose", "/amcl_pose"))
_log = logging.getLogger(__name__)


class Statements:
    """What is stated of one frame after another, its times and the frames' by one clock.

    T_own_odom  of odometry's frame in that of our first pose, as it is stated; None until then
    T_own_map   of the stated map in that of our first pose
    """

    def __init__(self) -> None:
        self.T_own_odom: Float | None = None
        self.T_own_map: Float | None = None
        self._covariance, self._odometry = np.zeros((3, 3)), PoseTrack()
        self._first: Float | None = None
        self._answered_ns, self._states_transforms = -(1 << 62), False

    def sent(self, odometry: Odometry, now_ns: int) -> None:
        """A frame with this odometry is next; ``now_ns`` by the clock of the statements."""
        self._now, self._now_ns = odometry, now_ns
        if self._first is None:
            self._first = odometry.T_odom_robot
        self._odometry.add(Stamped(stamp_ns=now_ns, pose=odometry.T_odom_robot))
        self._odometry.at(now_ns - _KEPT_NS)

    def transform(self, found: StampedPose) -> None:
        """map -> odom: the newest stands; one stamped ahead answers this frame, and no other."""
        self._states_transforms = True
        self._take(found.stamp_ns, found.pose)

    def pose(self, found: StampedPose) -> None:
        """A pose states the covariance, and map -> odom where nothing else does."""
        then = None if self._states_transforms else self._odometry.at(found.stamp_ns)
        if then is not None:
            self._take(found.stamp_ns, se2.compose(found.pose, se2.inverse(then.pose)))
        if found.covariance is not None and self.T_own_map is not None:
            self._covariance = turned(found.covariance, float(self.T_own_map[2]))

    def _take(self, stamp_ns: int, T_map_odom: Float) -> None:
        stamp_ns = min(stamp_ns, self._now_ns)
        if stamp_ns < self._answered_ns:
            return
        if self.T_own_map is None:
            assert self._first is not None
            self.T_own_map = se2.inverse(se2.compose(T_map_odom, self._first))
        self._answered_ns = stamp_ns
        self.T_own_odom = se2.compose(self.T_own_map, T_map_odom)

    def estimate(self, diagnostics: Mapping[str, float] | None = None) -> Estimate:
        """Of the last frame in the frame of our first pose; odometry's until something is stated.

        Its covariance is zeros where none is stated.
        """
        assert self._first is not None
        T_own_odom = se2.inverse(self._first) if self.T_own_odom is None else self.T_own_odom
        return Estimate(
            stamp_ns=self._now.stamp_ns,
            T_map_robot=se2.compose(T_own_odom, self._now.T_odom_robot),
            covariance=self._covariance,
            converged=self.T_own_odom is not None,
            diagnostics=diagnostics or {},
        )


class Node(Statements):
    """The node on the other side of ``link``.

    odd  how often what was wrong: "malformed", "from_others", "clock_off_s"

    The first that states map -> odom is believed as long as this lives; another one that does is
    counted and left out.
    """

    def __init__(self, link: Link) -> None:
        super().__init__()
        self._link = link
        for topic in (TF, GRID, *POSES):
            link.subscribe(topic)
        self.odd = dict[str, float]()
        self._sender = ""
        self._grid: bytes | None = None

    def answered(self) -> bool:
        """Take what has come; whether the last frame is answered."""
        for taken in self._link.take(TF):
            with self._reading(TF):
                found = transform_of(decoded(TF.kind, taken.data), MAP, ODOM)
                if found is not None and self._timely(found) and self._believed(taken.sender):
                    self.transform(found)
        for topic in POSES:
            for taken in self._link.take(topic):
                with self._reading(topic):
                    found = pose_of(decoded(topic.kind, taken.data))
                    if self._timely(found):
                        self.pose(found)
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

    def map(self) -> Raster | None:
        """Its map; ``InvalidValueError`` for what cannot be one."""
        if self._grid is None or self.T_own_map is None:
            return None
        return raster_of(decoded(GRID.kind, self._grid), self.T_own_map)

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
