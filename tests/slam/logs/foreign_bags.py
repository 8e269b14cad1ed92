# SPDX-License-Identifier: Apache-2.0
"""Bags as other robots record them: sqlite3, MCAP or ROS 1, topics at their own rates."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as WriterOfRos1
from rosbags.rosbag2 import StoragePlugin, Writer

from slam.logs.bag_topics import ROS1, ROS2

START_NS = 1_700_000_000_000_000_000
Message = tuple[str, str, int, Any]  # topic, type, ns, message


class Maker:
    """Makes messages of ROS 1 or 2."""

    def __init__(self, ros1: bool = False) -> None:
        self.store, self.ros1 = (ROS1, True) if ros1 else (ROS2, False)

    def new(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def header(self, ns: int, frame: str) -> Any:
        stamp = self.new("builtin_interfaces/msg/Time", sec=ns // 10**9, nanosec=ns % 10**9)
        more = {"seq": 0} if self.ros1 else {}
        return self.new("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **more)

    def scan(self, ns: int, ranges: Sequence[float], **changes: Any) -> Message:
        fields: dict[str, Any] = {
            "header": self.header(ns, "laser"),
            "angle_min": -1.0,
            "angle_max": 1.0,
            "angle_increment": 2.0 / max(len(ranges) - 1, 1),
            "time_increment": 0.0,
            "scan_time": 0.1,
            "range_min": 0.1,
            "range_max": 30.0,
            "ranges": np.asarray(ranges, dtype=np.float32),
            "intensities": np.zeros(0, dtype=np.float32),
        }
        kind = "sensor_msgs/msg/LaserScan"
        topic = changes.pop("topic", "/scan")
        return topic, kind, ns, self.new(kind, **{**fields, **changes})

    def pose(self, x: float, y: float, theta: float) -> Any:
        return self.new(
            "geometry_msgs/msg/Pose",
            position=self.new("geometry_msgs/msg/Point", x=x, y=y, z=0.0),
            orientation=self.new(
                "geometry_msgs/msg/Quaternion",
                x=0.0, y=0.0, z=math.sin(theta / 2.0), w=math.cos(theta / 2.0),
            ),
        )  # fmt: skip

    def odometry(
        self,
        ns: int,
        pose: Sequence[float],
        covariance: np.ndarray | None = None,
        topic: str = "/odom",
        child: str = "base_link",
    ) -> Message:
        full = np.zeros((6, 6))
        if covariance is not None:
            full[np.ix_((0, 1, 5), (0, 1, 5))] = covariance
        zero = self.new("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        kind = "nav_msgs/msg/Odometry"
        message = self.new(
            kind,
            header=self.header(ns, "odom"),
            child_frame_id=child,
            pose=self.new(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=self.pose(*pose),
                covariance=full.ravel(),
            ),
            twist=self.new(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=self.new("geometry_msgs/msg/Twist", linear=zero, angular=zero),
                covariance=np.zeros(36),
            ),
        )
        return topic, kind, ns, message

    def transform(
        self, ns: int, parent: str, child: str, xyz: Sequence[float], xyzw: Sequence[float]
    ) -> Message:
        x, y, z = xyz
        qx, qy, qz, qw = xyzw
        stamped = self.new(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(ns, parent),
            child_frame_id=child,
            transform=self.new(
                "geometry_msgs/msg/Transform",
                translation=self.new("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
                rotation=self.new("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
            ),
        )
        kind = "tf2_msgs/msg/TFMessage"
        return "/tf_static", kind, ns, self.new(kind, transforms=[stamped])

    def moved(
        self, ns: int, parent: str, child: str, pose: Sequence[float], topic: str = "/tf"
    ) -> Message:
        """A planar transform on /tf."""
        x, y, theta = pose
        turn = (0.0, 0.0, math.sin(theta / 2.0), math.cos(theta / 2.0))
        return topic, *self.transform(ns, parent, child, (x, y, 0.0), turn)[1:]

    def echoes(self, ns: int, beams: Sequence[Sequence[float]]) -> Message:
        """A MultiEchoLaserScan."""
        fields = vars(self.scan(ns, [1.0] * len(beams))[3])
        kind = "sensor_msgs/msg/MultiEchoLaserScan"
        told = [self.new("sensor_msgs/msg/LaserEcho", echoes=np.float32(b)) for b in beams]
        fields = {k: v for k, v in fields.items() if not k.startswith("__")}
        return "/echoes", kind, ns, self.new(kind, **{**fields, "ranges": told, "intensities": []})


def write_ros2(path: Path, messages: Sequence[Message], storage: str = "sqlite3") -> Path:
    """A rosbag2 folder."""
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(path, version=9, storage_plugin=plugin) as bag:
        connections: dict[str, Any] = {}
        for topic, kind, ns, message in messages:
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, kind, typestore=ROS2)
            bag.write(connections[topic], ns, ROS2.serialize_cdr(message, kind))
    return path


def write_ros1(path: Path, messages: Sequence[Message]) -> Path:
    """A .bag."""
    with WriterOfRos1(path) as bag:
        connections: dict[str, Any] = {}
        for topic, kind, ns, message in messages:
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, kind, typestore=ROS1)
            bag.write(connections[topic], ns, bytes(ROS1.serialize_ros1(message, kind)))
    return path
