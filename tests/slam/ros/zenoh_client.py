# SPDX-License-Identifier: Apache-2.0
"""A node over Zenoh by zenoh-ros2-sdk, which is no code of ours: dead reckoning.

    python tests/slam/ros/zenoh_client.py PORT

It takes the texts of message types from rosbags: the library would fetch them from the network.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber

STORE = get_typestore(Stores.ROS2_HUMBLE)


def main(port: int) -> None:
    """Answer each scan with map -> odom = identity."""

    def of(kind: str) -> dict[str, Any]:
        return {
            "msg_type": kind, "msg_definition": STORE.generate_msgdef(kind)[0],
            "type_hash": STORE.hash_rihs01(kind), "router_port": port,
        }  # fmt: skip

    tf = ROS2Publisher(topic="/tf", **of("tf2_msgs/msg/TFMessage"))
    types = tf.session_mgr.store.types

    def answer(scan: Any) -> None:
        kinds = {name.rpartition("/")[2]: made for name, made in types.items()}
        at = kinds["Header"](stamp=scan.header.stamp, frame_id="map")
        turn = kinds["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
        here = kinds["Transform"](kinds["Vector3"](x=0.0, y=0.0, z=0.0), turn)
        link = kinds["TransformStamped"](header=at, child_frame_id="odom", transform=here)
        tf.publish(transforms=[link])

    ROS2Subscriber(topic="/scan", callback=answer, **of("sensor_msgs/msg/LaserScan"))
    while True:
        time.sleep(1.0)


if __name__ == "__main__":
    main(int(sys.argv[1]))
