# SPDX-License-Identifier: Apache-2.0
"""KISS-ICP (Vizzo et al. 2023) on a planar scanner, with odometry as its guess.

Its authors built it for 3D scanners outdoors. Three things give it its best chance here: the scan
lies in the plane z = 0; voxels follow the scanner's beam spacing, not its range; and the pose
predicted by odometry goes in through ``last_delta`` in place of its constant velocity.
"""

from typing import Any

import numpy as np

from slam.errors import needed
from slam.frames import Float, LaserSpec
from slam.frontend.odometry_prior import Prediction
from slam.guests.guest import Guest, flattened, lifted, voxel_m

MAP_M = 100.0  # structure farther from the robot is dropped from its map
FIRST_M, STILL_M = 0.3, 0.02  # correspondence threshold at the start; motion below it is not learnt


class KissIcpSlam(Guest):
    """KISS-ICP, a guest: point-to-point ICP on a voxel map, with odometry as its guess."""

    def __init__(self) -> None:
        self._kiss = needed("kiss_icp.kiss_icp", "kiss-icp")
        self._config = needed("kiss_icp.config", "kiss-icp")
        super().__init__()

    def begin(self, spec: LaserSpec) -> None:
        """A matcher with a map of this scanner's grain."""
        config = self._config.KISSConfig()
        config.data.deskew = False  # done already, by odometry
        config.data.max_range = MAP_M
        config.mapping.voxel_size = voxel_m(spec.angle_increment)
        config.adaptive_threshold.initial_threshold = FIRST_M
        config.adaptive_threshold.min_motion_th = STILL_M
        config.registration.max_num_threads = 1
        self._icp: Any = self._kiss.KissICP(config)

    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        """ICP from the predicted pose."""
        points = np.zeros((len(points_robot), 3))
        points[:, :2] = points_robot
        self._icp.last_delta = lifted(prediction.increment)
        self._icp.register_frame(points, np.zeros(len(points)))
        pose = flattened(self._icp.last_pose)
        return pose, {"threshold_m": float(self._icp.adaptive_threshold.get_threshold())}
