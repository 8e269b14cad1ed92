# SPDX-License-Identifier: Apache-2.0
"""GenZ-ICP (Lee et al. 2024) on a planar scanner, with odometry as its guess.

It weighs point-to-plane against point-to-point pairs by how many of each a scan has. It is made for
3D scanners: the scan is stacked in three layers, and the pose that it finds is laid flat. Its own
odometry starts from constant velocity; here its registration, its voxel map and its threshold are
called one by one, so that the pose predicted by odometry is the start. It sums on several threads,
in no fixed order: two runs agree to about 1e-14 m a scan, not to the bit.
"""

import ctypes
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from slam.errors import needed
from slam.frames import Float, LaserSpec
from slam.frontend.odometry_prior import Prediction
from slam.guests.guest import Guest, configured, flattened, lifted, stacked, voxel_m
from slam.settings import Settings, number


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing reaches this process's standard output meanwhile, whoever writes to it.

    What was written before it does, and later output does again, whatever is raised.
    """
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    libc.fflush(None)  # what C has kept so far is not to be dropped
    kept = os.dup(1)
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.close(nothing)
        try:
            yield
        finally:
            try:
                sys.stdout.flush()
                libc.fflush(None)
            finally:
                os.dup2(kept, 1)
    finally:
        os.close(kept)


KEPT_SHARE = 0.5  # of a voxel: edge of the cells of which map and match take one point each; at
# 1.0 the layers fall together now and then, and the match diverges in small rooms
OF_PACKAGE, TRAINED = "its package", "training seeds"


@dataclass(frozen=True, kw_only=True)
class GenzIcpConfig(Settings):
    """Numbers of GenZ-ICP, by the names of its YAML."""

    max_range: float = number(
        100.0, "m", "structure farther from the robot is dropped from its map", OF_PACKAGE,
        low=0.5, high=1000.0,
    )  # fmt: skip
    max_points_per_voxel: int = number(
        1, "points", "in a voxel of its map", OF_PACKAGE, low=1, high=1000
    )
    planarity_threshold: float = number(
        0.2, "share", "least eigenvalue by their sum, up to which a patch is a plane", OF_PACKAGE,
        low=1e-6, high=1.0,
    )  # fmt: skip
    initial_threshold: float = number(
        0.15, "m", "correspondence threshold at the start", TRAINED, low=0.01, high=10.0
    )
    min_motion_th: float = number(
        0.02, "m", "motion below it is not learnt", TRAINED, low=1e-4, high=10.0
    )
    max_num_iterations: int = number(100, "steps", "of a match", OF_PACKAGE, low=1, high=5000)
    convergence_criterion: float = number(
        1e-3, "m, rad", "a smaller step ends a match; 1e-4 takes twice as long and is no better",
        low=1e-9, high=0.1,
    )  # fmt: skip


class GenzIcpSlam(Guest):
    """GenZ-ICP, a guest: ICP that weighs planes and points, with odometry as its guess."""

    config_class: ClassVar[type[GenzIcpConfig]] = GenzIcpConfig

    def __init__(self, config: GenzIcpConfig | Mapping[str, Any] | None = None) -> None:
        self.config = configured(GenzIcpConfig, config)
        self._genz: Any = needed("genz_icp.pybind.genz_icp_pybind", "genz-icp")
        super().__init__()

    def begin(self, spec: LaserSpec) -> None:
        """A matcher with a map of this scanner's grain."""
        self._voxel_m = voxel_m(spec.angle_increment)
        own = self.config
        self._map: Any = self._genz._VoxelHashMap(
            self._voxel_m, own.max_range, own.max_range, own.planarity_threshold,
            own.max_points_per_voxel,
        )  # fmt: skip
        self._matcher: Any = self._genz._Registration(
            own.max_num_iterations, own.convergence_criterion, 1
        )
        self._threshold: Any = self._genz._AdaptiveThreshold(
            own.initial_threshold, own.min_motion_th, own.max_range
        )

    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        """Its registration from the predicted pose, as its own odometry calls it."""
        points = self._genz._Vector3dVector(stacked(points_robot, self._voxel_m))
        points = self._genz._voxel_down_sample(points, KEPT_SHARE * self._voxel_m)
        guess, sigma_m = lifted(prediction.T_map_robot), self._threshold._compute_threshold()
        if self._map._empty():
            pose = prediction.T_map_robot
        else:
            with quiet():  # it draws a gauge at each scan
                found = self._matcher._align_points_to_map(
                    points, self._map, guess, 3.0 * sigma_m, sigma_m / 3.0
                )
            pose = flattened(found)
            self._threshold._update_model_deviation(np.linalg.inv(guess) @ lifted(pose))
        self._map._update(points, lifted(pose))
        return pose, {"threshold_m": float(sigma_m)}
