# SPDX-License-Identifier: Apache-2.0
"""A node over Zenoh by zenoh-ros2-sdk, which is no code of ours: what ``node.cpp`` does over DDS.

    python tests/slam/ros/zenoh_client.py [FILE N [stamped]]

It takes the texts of message types from rosbags: the library would fetch them from the network.
"""

import os
import re
import struct
import sys
import time
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber

STORE = get_typestore(Stores.ROS2_HUMBLE)
((HOST, PORT),) = re.findall(r"tcp/([\d.]+):(\d+)", os.environ["ZENOH_CONFIG_OVERRIDE"])
FIELDS = (
    "angle_min",
    "angle_max",
    "angle_increment",
    "time_increment",
    "scan_time",
    "range_min",
    "range_max",
)


def of(kind: str) -> dict[str, Any]:
    """Options of a topic of that type."""
    return {
        "msg_type": kind, "msg_definition": STORE.generate_msgdef(kind)[0],
        "type_hash": STORE.hash_rihs01(kind), "router_ip": HOST, "router_port": int(PORT),
    }  # fmt: skip


def main(file: str = os.devnull, wanted: str = "0", stamped: str = "") -> None:
    """Write scans and drive, or answer each scan with map -> odom = identity."""
    publisher = ROS2Publisher(topic="/tf", **of("tf2_msgs/msg/TFMessage"))
    if int(wanted):
        kind = "geometry_msgs/msg/TwistStamped" if stamped else "geometry_msgs/msg/Twist"
        publisher = ROS2Publisher(topic="/cmd_vel", **of(kind))
    types, taken = publisher.session_mgr.store.types, []

    def made(name: str, **fields: Any) -> Any:
        (kind,) = (kind for kind in types if kind.rpartition("/")[2] == name)
        return types[kind](**fields)

    def answer(scan: Any) -> None:
        taken.append(_row(scan))
        zero = made("Vector3", x=0.0, y=0.0, z=0.0)
        twist = {"linear": made("Vector3", x=0.3, y=0.0, z=0.0), "angular": zero}
        if stamped:
            publisher.publish(header=scan.header, twist=made("Twist", **twist))
        elif int(wanted):
            publisher.publish(**twist)
        else:
            turn = made("Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
            here = made("Transform", translation=zero, rotation=turn)
            at = made("Header", stamp=scan.header.stamp, frame_id="map")
            link = made("TransformStamped", header=at, child_frame_id="odom", transform=here)
            publisher.publish(transforms=[link])

    ROS2Subscriber(topic="/scan", callback=answer, **of("sensor_msgs/msg/LaserScan"))
    print("ready", flush=True)
    while not int(wanted) or len(taken) < int(wanted):
        time.sleep(0.05)
    Path(file).write_bytes(b"".join(taken))
    time.sleep(0.2)
    os._exit(0)  # the library's threads would go on


def _row(scan: Any) -> bytes:
    stamp, ranges, more = scan.header.stamp, scan.ranges, scan.intensities
    head = struct.pack("<qiIII", time.time_ns(), stamp.sec, stamp.nanosec, len(ranges), len(more))
    numbers = struct.pack("<7f", *(getattr(scan, name) for name in FIELDS))
    ending = scan.header.frame_id.encode() + b"\n"
    return head + numbers + ranges.tobytes() + more.tobytes() + ending


if __name__ == "__main__":
    main(*sys.argv[1:])
