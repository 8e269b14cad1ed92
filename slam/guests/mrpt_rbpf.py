# SPDX-License-Identifier: Apache-2.0
"""MRPT's rbpf-slam (Blanco 2.5.8): a Rao-Blackwellised particle filter over grid maps."""

from __future__ import annotations

from slam.frames import Float
from slam.guests.mrpt import MrptSlam
from slam.guests.rawlog import MotionModel
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

insertionLinDistance = 0.2
insertionAngDistance_deg = 10
localizeLinDistance = 0.1
localizeAngDistance_deg = 5

# 3: pfAuxiliaryPFOptimal, optimal sampling
PF_algorithm = 3
adaptiveSampleSize = 0
# 3: prSystematic
resamplingMethod = 3
sampleSize = 30
BETA = 0.5
powFactor = 0.01
pfAuxFilterOptimal_MaximumSearchSamples = 400
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
LF_decimation = 5
LF_stdHit = 0.10
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
    motion = MotionModel(
        m_per_m=0.05, m_per_rad=0.05, rad_per_m=0.05, rad_per_rad=0.05, least_m=0.005,
        least_rad=0.005,
    )  # fmt: skip

    def config(self, folder: str) -> str:
        """``CONFIG``: one seed, so that a run repeats itself."""
        return CONFIG.format(folder=folder)

    def poses(self, rows: Float) -> Float:
        """Rows: step, x, y, z, yaw, pitch, roll, time: the mean of the particles."""
        return rows[:, [1, 2, 4]]

    def spent(self, rows: Float) -> Float:
        """Rows: step, ms, size of the map, whether the scan went into it."""
        return rows[:, 1]
