# SPDX-License-Identifier: Apache-2.0
"""What the SLAM and navigation stacks of ROS want beside scan and odometry, as messages.

The clock that they run on, the map that AMCL localises in, where the robot starts, and when the
recording began. All but the clock are sent once.
"""

from __future__ import annotations

import numpy as np

from slam.estimate import Raster
from slam.frames import NS_PER_S, Float
from slam.ros.messages import MAP, fill_pose
from slam.ros.template import Template, header, marked_time, message

UNKNOWN_CELL = -1  # nav_msgs/OccupancyGrid
# What RViz sends for "2D Pose Estimate": (0.5 m)^2 and (15 degrees)^2.
_START_VARIANCES = {0: 0.25, 7: 0.25, 35: 0.06853891909122467}


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


class StartMessage:
    """geometry_msgs/PoseWithCovarianceStamped: where the robot truly starts, on the map."""

    KIND = "geometry_msgs/msg/PoseWithCovarianceStamped"

    def __call__(self, stamp_ns: int, T_map_robot: Float) -> bytearray:
        """As RViz sends it for a click on the map."""
        pose = np.zeros(7 + 36)
        fill_pose(pose[:7], T_map_robot)
        for place, variance in _START_VARIANCES.items():
            pose[7 + place] = variance
        prototype = message(self.KIND, header=header(MAP), pose=pose)
        return Template(self.KIND, prototype).stamp(stamp_ns)
