# SPDX-License-Identifier: Apache-2.0
"""KISS-ICP (Vizzo et al. 2023) on a planar scanner, with odometry as its guess.

Its authors built it for 3D scanners outdoors. Three things give it its best chance here: the scan
lies in the plane z = 0; voxels follow the scanner's beam spacing, not its range; and the pose
predicted by odometry goes in through ``last_delta`` in place of its constant velocity.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from slam.errors import needed
from slam.frames import Float, LaserSpec
from slam.frontend.odometry_prior import Prediction
from slam.guests.guest import Guest, configured, flattened, lifted, voxel_m
from slam.settings import Settings, number

OF_PACKAGE = "its package"


@dataclass(frozen=True, kw_only=True)
class KissIcpConfig(Settings):
    """Numbers of KISS-ICP, by the names of its YAML."""

    max_range: float = number(
        100.0, "m", "structure farther from the robot is dropped from its map", OF_PACKAGE,
        low=0.5, high=1000.0,
    )  # fmt: skip
    voxel_size: float = number(
        0.0, "m", "edge of a voxel; 0: the beams' spacing at 10 m, 0.1 to 0.3", high=5.0
    )
    max_points_per_voxel: int = number(
        20, "points", "in a voxel of its map", OF_PACKAGE, low=1, high=1000
    )
    initial_threshold: float = number(
        0.3, "m", "correspondence threshold at the start", low=0.01, high=10.0
    )
    min_motion_th: float = number(0.02, "m", "motion below it is not learnt", low=1e-4, high=10.0)
    fixed_threshold: float = number(
        0.0, "m", "correspondence threshold throughout; 0: learnt", OF_PACKAGE, high=10.0
    )
    max_num_iterations: int = number(500, "steps", "of a match", OF_PACKAGE, low=1, high=5000)
    convergence_criterion: float = number(
        1e-4, "m, rad", "a smaller step ends a match", OF_PACKAGE, low=1e-9, high=0.1
    )


class KissIcpSlam(Guest):
    """KISS-ICP, a guest: point-to-point ICP on a voxel map, with odometry as its guess."""

    config_class: ClassVar[type[KissIcpConfig]] = KissIcpConfig

    def __init__(self, config: KissIcpConfig | Mapping[str, Any] | None = None) -> None:
        self.config = configured(KissIcpConfig, config)
        self._kiss = needed("kiss_icp.kiss_icp", "kiss-icp")
        self._module = needed("kiss_icp.config", "kiss-icp")
        super().__init__()

    def begin(self, spec: LaserSpec) -> None:
        """A matcher with a map of this scanner's grain."""
        own, config = self.config, self._module.KISSConfig()
        config.data.deskew = False  # done already, by odometry
        config.data.max_range = own.max_range
        config.mapping.voxel_size = own.voxel_size or voxel_m(spec.angle_increment)
        config.mapping.max_points_per_voxel = own.max_points_per_voxel
        config.adaptive_threshold.initial_threshold = own.initial_threshold
        config.adaptive_threshold.min_motion_th = own.min_motion_th
        config.adaptive_threshold.fixed_threshold = own.fixed_threshold or None
        config.registration.max_num_iterations = own.max_num_iterations
        config.registration.convergence_criterion = own.convergence_criterion
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
