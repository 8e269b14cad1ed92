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

from slam.guests.mrpt import MotionModel, MrptSlam
from slam.system import register


@register("rbpf-slam")
class RbpfSlam(MrptSlam):
    """MRPT's rbpf-slam, a guest over files: particles with grids, run when the last scan is in."""

    command = "rbpf-slam"
    config = "mrpt_rbpf.ini"
    columns = (8, 4)
    pose_columns = (1, 2, 4)  # step, x, y, z, yaw, pitch, roll, time: the mean of the particles
    ms_column = 1  # step, ms, size of the map, whether the scan went into it
    # about three times a Pioneer's own errors
    motion = MotionModel(
        m_per_m=0.05, m_per_rad=0.05, rad_per_m=0.08, rad_per_rad=0.08, least_m=0.01,
        least_rad=0.01,
    )  # fmt: skip
