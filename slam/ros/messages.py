# SPDX-License-Identifier: Apache-2.0
"""What a frame says, as ROS 2 messages, and what SLAM and navigation stacks want besides.

Stamps are those of the earliest beam (``template.said_ns``). Frames are "map", "odom", "base_link"
(REP 105), "base_footprint" (REP 120; here the same place), "laser" and "world", in which the truth
is; "map" lies on it. LaserScan follows REP 117 (inf no return,
NaN an error code) and, in its time fields, the driver of the LMS-200 family
(ros-drivers/sicktoolbox_wrapper): ``scan_time`` is one turn of the mirror for a message of one
turn, all its turns for a whole scan; ``time_increment`` is scan_time / (2 pi) * angle_increment.
That is exact for a turn. For a whole interlaced scan it misleads, as that driver warns: half-degree
neighbours are a mirror turn apart. Hence ``/scan_turn``.
"""

from typing import NamedTuple

import numpy as np

from slam.estimate import Raster
from slam.frames import NS_PER_S, Float, LaserSpec, Odometry, Scan
from slam.laser_scan import is_clockwise, time_increment
from slam.logs.ros_numbers import quaternion_of
from slam.ros.template import Marks, Template, header, marked_time, message

UNKNOWN_CELL = -1  # nav_msgs/OccupancyGrid
# What RViz sends for "2D Pose Estimate": (0.5 m)^2 and (15 degrees)^2.
START_COVARIANCE = np.diag([0.25, 0.25, 0.06853891909122467])


class ClockMessage:
    """rosgraph_msgs/Clock."""

    KIND = "rosgraph_msgs/msg/Clock"

    def __init__(self) -> None:
        self._template = Template(self.KIND, message(self.KIND, clock=marked_time()))

    def __call__(self, stamp_ns: int) -> bytearray:
        """That time."""
        return self._template.stamp(stamp_ns)


class BeganMessage:
    """sensor_msgs/TimeReference: what time the bag says for second 0 of the simulation."""

    KIND = "sensor_msgs/msg/TimeReference"
    SOURCE = "simulation"

    def __call__(self, stamp_ns: int) -> bytearray:
        """``header.stamp`` is the bag's time, ``time_ref`` that of the simulation."""
        seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
        time = {"sec": seconds, "nanosec": nanoseconds}
        prototype = message(self.KIND, header=header(""), time_ref=time, source=self.SOURCE)
        return Template(self.KIND, prototype).stamp(stamp_ns)


class MapMessage:
    """nav_msgs/OccupancyGrid: 0 free to 100 occupied, -1 unknown, in the frame "map"."""

    KIND = "nav_msgs/msg/OccupancyGrid"

    def __init__(self, raster: Raster) -> None:
        height, width = raster.values.shape
        known = np.nan_to_num(raster.values, nan=0.01 * UNKNOWN_CELL)
        origin = np.zeros(7)
        fill_pose(origin, raster.T_map_origin)
        self._prototype = message(
            self.KIND,
            header=header(MAP),
            info={
                "map_load_time": marked_time(),
                "resolution": raster.resolution_m,
                "width": width,
                "height": height,
                "origin": origin,
            },
            data=np.rint(100.0 * known).astype(np.int8).ravel(),
        )

    def __call__(self, stamp_ns: int) -> bytearray:
        """The map, loaded at that time."""
        return Template(self.KIND, self._prototype).stamp(stamp_ns)


WORLD, MAP, ODOM = "world", "map", "odom"
FOOTPRINT, ROBOT, LASER = "base_footprint", "base_link", "laser"
TRUE_FOOTPRINT = "base_footprint_truth"  # where the robot is, whoever says what of "map" and "odom"
UNKNOWN = -1.0  # first entry of a covariance: there is no such measurement (sensor_msgs/Imu)


class Part(NamedTuple):
    """Every ``stride``-th beam of a scan from ``first`` on; ``scan_time`` s, of its message."""

    scan_time: float
    first: int
    stride: int


class ScanMessage:
    """sensor_msgs/LaserScan of a part of a scan, in order of time.

    Of a scanner whose mirror turns clockwise, beams and ``angle_increment`` run that way.
    """

    KIND = "sensor_msgs/msg/LaserScan"

    def __init__(
        self, spec: LaserSpec, part: Part, *, frame: str = LASER, intensities: bool = False
    ) -> None:
        scan_time, first, stride = part
        marks, beams = Marks(), slice(first, None, stride)
        increment, angles, offsets = (
            stride * spec.angle_increment,
            spec.angles,
            spec.beam_time_offsets,
        )
        if is_clockwise(spec):
            beams, increment = slice(spec.n_beams - 1 - first, None, -stride), -increment
        n, start = len(offsets[beams]), float(angles[beams][0])
        ranges, remissions = marks(n, np.float32), marks(n if intensities else 0, np.float32)
        prototype = message(
            self.KIND,
            header=header(frame),
            angle_min=start,
            angle_max=start + (n - 1) * increment,
            angle_increment=increment,
            time_increment=time_increment(scan_time, increment),
            scan_time=scan_time,
            range_min=spec.range_min,
            range_max=spec.range_max,
            ranges=ranges,
            intensities=remissions,
        )
        self._beams, self._template = beams, Template(self.KIND, prototype)
        self._ranges = self._template.view(ranges)
        self._intensities = self._template.view(remissions) if intensities else None
        self._offset_ns = round(float(offsets[beams][0]) * NS_PER_S)

    def __call__(self, scan: Scan) -> tuple[int, bytearray]:
        """(stamp ns, message)."""
        self._ranges[:] = scan.ranges[self._beams]
        if self._intensities is not None and scan.intensities is not None:
            self._intensities[:] = scan.intensities[self._beams]
        stamp_ns = scan.stamp_ns + self._offset_ns
        return stamp_ns, self._template.stamp(stamp_ns)


def fill_pose(view: Float, pose: Float, z: float = 0.0) -> None:
    """Write a planar pose (x m, y m, theta rad), ``z`` m up, as the seven numbers of a Pose."""
    x, y, theta = pose.tolist()
    view[:] = (x, y, z, 0.0, 0.0, *quaternion_of(theta))


_PLANAR = np.array([6 * i + j for i in (0, 1, 5) for j in (0, 1, 5)])  # x, y, yaw of a (6, 6)


class OdometryMessage:
    """nav_msgs/Odometry; its covariance is of the pose, accumulated since the first frame.

    ``twist.covariance`` is that of the motion since the frame before over the squared time; its
    first entry is -1 where the twist is unknown, as in sensor_msgs/Imu.
    """

    KIND = "nav_msgs/msg/Odometry"

    def __init__(self) -> None:
        marks = Marks()
        pose, twist = marks(7 + 36), marks(6 + 36)
        self._template = Template(
            self.KIND,
            message(
                self.KIND, header=header(ODOM), child_frame_id=FOOTPRINT, pose=pose, twist=twist
            ),
        )
        view, rates = self._template.view(pose), self._template.view(twist)
        view[:], rates[:] = 0.0, 0.0
        self._pose, self._spread = view[:7], view[7:]
        self._twist, self._twist_spread = rates[:6], rates[6:]

    def __call__(self, odometry: Odometry, accumulated: Float | None, dt: float) -> bytearray:
        """``accumulated`` (3, 3) in the odom frame; ``dt`` s since the frame before, 0 at first."""
        fill_pose(self._pose, odometry.T_odom_robot)
        if odometry.twist is not None:
            vx, vy, omega = odometry.twist.tolist()
            self._twist[0], self._twist[1], self._twist[5] = vx, vy, omega
        if accumulated is not None:
            self._spread[_PLANAR] = accumulated.ravel()
        if odometry.twist is None:
            self._twist_spread[0] = UNKNOWN
        elif odometry.increment_covariance is not None and dt > 0.0:
            self._twist_spread[_PLANAR] = odometry.increment_covariance.ravel() / (dt * dt)
        return self._template.stamp(odometry.stamp_ns)


class PoseMessage:
    """geometry_msgs/PoseWithCovarianceStamped: a pose in ``frame``.

    In the robot's it is the motion since the frame before.
    """

    KIND = "geometry_msgs/msg/PoseWithCovarianceStamped"

    def __init__(self, frame: str = FOOTPRINT) -> None:
        marks = Marks()(7 + 36)
        prototype = message(self.KIND, header=header(frame), pose=marks)
        self._template = Template(self.KIND, prototype)
        view = self._template.view(marks)
        view[:] = 0.0
        self._pose, self._spread = view[:7], view[7:]

    def __call__(self, stamp_ns: int, pose: Float, covariance: Float) -> bytearray:
        """The covariance (3, 3) is in that frame, too."""
        fill_pose(self._pose, pose)
        self._spread[_PLANAR] = covariance.ravel()
        return self._template.stamp(stamp_ns)


class TransformMessage:
    """tf2_msgs/TFMessage of planar transforms.

    links  (parent, child, m up) of each
    """

    KIND = "tf2_msgs/msg/TFMessage"

    def __init__(self, *links: tuple[str, str, float]) -> None:
        numbers = Marks()(7 * len(links)).reshape(-1, 7)
        stamped = [
            message(
                "geometry_msgs/msg/TransformStamped",
                header=header(parent),
                child_frame_id=child,
                transform=row,
            )
            for row, (parent, child, _) in zip(numbers, links, strict=True)
        ]
        self._template = Template(self.KIND, message(self.KIND, transforms=stamped))
        self._numbers = [self._template.view(row) for row in numbers]
        self._heights = [height for _, _, height in links]

    def __call__(self, stamp_ns: int, *T_parent_child: Float) -> bytearray:
        """The transforms at that time, in the order of the links."""
        for view, pose, height in zip(self._numbers, T_parent_child, self._heights, strict=True):
            fill_pose(view, pose, height)
        return self._template.stamp(stamp_ns)


class TruthMessage:
    """geometry_msgs/PoseStamped of the robot in the world."""

    KIND = "geometry_msgs/msg/PoseStamped"

    def __init__(self) -> None:
        numbers = Marks()(7)
        prototype = message(self.KIND, header=header(WORLD), pose=numbers)
        self._template = Template(self.KIND, prototype)
        self._pose = self._template.view(numbers)

    def __call__(self, stamp_ns: int, T_world_robot: Float) -> bytearray:
        """The true pose at that time."""
        fill_pose(self._pose, T_world_robot)
        return self._template.stamp(stamp_ns)
