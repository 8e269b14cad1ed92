# SPDX-License-Identifier: Apache-2.0
"""MRPT's rbpf-slam (version 2.5): a Rao-Blackwellised particle filter over grid maps.

Each particle draws its poses by odometry and by the likelihood of the whole scan in its own map
("optimal sampling", Blanco et al. 2010). What mattered on the training seeds (20 s of office, arena
and station, still and at motion 0.5): a scan into the map each 1 m or 30 degrees, not each 0.2 m,
which let the heading drift after odometry's, nor each 2 m, which left it lost among movers; the
likelihood without smoothing (``powFactor``); an odometry that is doubted more than it deserves. 30
particles were no better than 15. ICP to points as the proposal was best in still rooms, at 3 cm,
and flew off by tens of metres among movers: it does not weigh odometry.
"""

from __future__ import annotations

from slam.guests.mrpt import MotionModel, MrptSlam
from slam.system import register

CONFIG = """\
[MappingApplication]
rawlog_offset = 0
logOutput_dir = {folder}
LOG_FREQUENCY = 0
GENERATE_LOG_JOINT_H = 0
GENERATE_LOG_INFO = 0
SAVE_POSE_LOG = 0
SAVE_MAP_IMAGES = 0
SAVE_3D_SCENE = 0
CAMERA_3DSCENE_FOLLOWS_ROBOT = 0
SHOW_PROGRESS_IN_WINDOW = 0
verbosity = ERROR
verbosity_level = ERROR
RANDOM_SEED = 1

insertionLinDistance = 1.0
insertionAngDistance_deg = 30
localizeLinDistance = 0.25
localizeAngDistance_deg = 10

# 3: pfAuxiliaryPFOptimal, optimal sampling
PF_algorithm = 3
adaptiveSampleSize = 0
# 3: prSystematic
resamplingMethod = 3
sampleSize = 15
BETA = 0.5
powFactor = 1
pfAuxFilterOptimal_MaximumSearchSamples = 300
pfOptimalProposal_mapSelection = 0

occupancyGrid_count = 1
gasGrid_count = 0
landmarksMap_count = 0
beaconMap_count = 0
pointsMap_count = 0
likelihoodMapSelection = -1

[MappingApplication_occupancyGrid_00_creationOpts]
resolution = 0.05

[MappingApplication_occupancyGrid_00_insertOpts]
mapAltitude = 0
useMapAltitude = 0
maxDistanceInsertion = 35
maxOccupancyUpdateCertainty = 0.60
considerInvalidRangesAsFreeSpace = 0
minLaserScanNoiseStd = 0.001
wideningBeamsWithDistance = 0

[MappingApplication_occupancyGrid_00_likelihoodOpts]
# 4: likelihood field (Thrun)
likelihoodMethod = 4
LF_decimation = 1
LF_stdHit = 0.05
LF_maxCorrsDistance = 0.30
LF_zHit = 0.95
LF_zRandom = 0.05
LF_maxRange = 30
LF_alternateAverageMethod = 0
enableLikelihoodCache = 1
"""


@register("rbpf-slam")
class RbpfSlam(MrptSlam):
    """MRPT's rbpf-slam, a guest over files: particles with grids, run when the last scan is in."""

    command = "rbpf-slam"
    config = CONFIG
    columns = (8, 4)
    pose_columns = (1, 2, 4)  # step, x, y, z, yaw, pitch, roll, time: the mean of the particles
    ms_column = 1  # step, ms, size of the map, whether the scan went into it
    # about three times a Pioneer's own errors
    motion = MotionModel(
        m_per_m=0.05, m_per_rad=0.05, rad_per_m=0.08, rad_per_rad=0.08, least_m=0.01,
        least_rad=0.01,
    )  # fmt: skip
