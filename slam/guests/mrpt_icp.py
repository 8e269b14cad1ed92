# SPDX-License-Identifier: Apache-2.0
"""MRPT's icp-slam (version 2.5): ICP of each scan against one map of points.

The config is that of MRPT's own demo, but for what the training seeds asked for (20 s of office,
arena and station, still and at motion 0.5): every scan is matched, by every point, with pairs up to
0.15 m apart, and goes into the map each 0.5 m or 20 degrees.
"""

from slam.guests.mrpt import MotionModel, MrptSlam
from slam.system import register


@register("icp-slam")
class IcpSlam(MrptSlam):
    """MRPT's icp-slam, a guest over files: ICP to a map of points, run when the last scan is in."""

    command = "icp-slam"
    config = "mrpt_icp.ini"
    columns = (4, 2)
    pose_columns = (1, 2, 3)  # step, x, y, yaw
    ms_column = 0  # ms, size of the map
    # not used: it takes odometry's step as the start of its ICP, however sure
    motion = MotionModel(
        m_per_m=0.05, m_per_rad=0.05, rad_per_m=0.05, rad_per_rad=0.05, least_m=0.005,
        least_rad=0.005,
    )  # fmt: skip
