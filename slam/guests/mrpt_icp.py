# SPDX-License-Identifier: Apache-2.0
"""MRPT's icp-slam (version 2.5): ICP of each scan against one map of points.

The config is that of MRPT's own demo, but for what the training seeds asked for (20 s of office,
arena and station, still and at motion 0.5): every scan is matched, by every point, with pairs up to
0.15 m apart, and goes into the map each 0.5 m or 20 degrees.
"""

from __future__ import annotations

from slam.guests.mrpt import MotionModel, MrptSlam
from slam.system import register

CONFIG = """\
[MappingApplication]
rawlog_offset = 0
logOutput_dir = {folder}
LOG_FREQUENCY = 0
SAVE_POSE_LOG = 0
SAVE_3D_SCENE = 0
CAMERA_3DSCENE_FOLLOWS_ROBOT = 0
SHOW_PROGRESS_3D_REAL_TIME = 0
SHOW_LASER_SCANS_3D = 0
verbosity_level = ERROR

# every scan is matched
localizationLinDistance = 0
localizationAngDistance = 0
insertionLinDistance = 0.5
insertionAngDistance = 20
minICPgoodnessToAccept = 0.40
matchAgainstTheGrid = 0

occupancyGrid_count = 0
gasGrid_count = 0
landmarksMap_count = 0
beaconMap_count = 0
pointsMap_count = 1
likelihoodMapSelection = -1

[MappingApplication_pointsMap_00_insertOpts]
minDistBetweenLaserPoints = 0.05
fuseWithExisting = 0
isPlanarMap = 1

[ICP]
ICP_algorithm = icpClassic
maxIterations = 80
minAbsStep_trans = 1e-6
minAbsStep_rot = 1e-6
thresholdDist = 0.15
thresholdAng_DEG = 5
ALFA = 0.8
smallestThresholdDist = 0.05
onlyClosestCorrespondences = true
onlyUniqueRobust = true
corresponding_points_decimation = 1
"""


@register("icp-slam")
class IcpSlam(MrptSlam):
    """MRPT's icp-slam, a guest over files: ICP to a map of points, run when the last scan is in."""

    command = "icp-slam"
    config = CONFIG
    columns = (4, 2)
    pose_columns = (1, 2, 3)  # step, x, y, yaw
    ms_column = 0  # ms, size of the map
    # not used: it takes odometry's step as the start of its ICP, however sure
    motion = MotionModel(
        m_per_m=0.05, m_per_rad=0.05, rad_per_m=0.05, rad_per_rad=0.05, least_m=0.005,
        least_rad=0.005,
    )  # fmt: skip
