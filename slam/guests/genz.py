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
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from slam.errors import needed
from slam.frames import Float, LaserSpec
from slam.frontend.odometry_prior import Prediction
from slam.guests.guest import Guest, flattened, lifted, stacked, voxel_m


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
POINTS = 1  # in a voxel of its map; its default
PLANARITY = 0.2  # least eigenvalue by their sum, up to which a patch is a plane; its default
MAP_M = 100.0  # structure farther from the robot is dropped from its map
FIRST_M = 0.15  # m, correspondence threshold at first; training seeds
STILL_M = 0.02  # m; motion below it is not learnt; training seeds
ITERATIONS = 100  # its default
CONVERGED = 1e-3  # m and rad, of a step; 1e-4 takes twice as long and is no better


class GenzIcpSlam(Guest):
    """GenZ-ICP, a guest: ICP that weighs planes and points, with odometry as its guess."""

    def __init__(self) -> None:
        self._genz: Any = needed("genz_icp.pybind.genz_icp_pybind", "genz-icp")
        super().__init__()

    def begin(self, spec: LaserSpec) -> None:
        """A matcher with a map of this scanner's grain."""
        self._voxel_m = voxel_m(spec.angle_increment)
        self._map: Any = self._genz._VoxelHashMap(self._voxel_m, MAP_M, MAP_M, PLANARITY, POINTS)
        self._matcher: Any = self._genz._Registration(ITERATIONS, CONVERGED, 1)
        self._threshold: Any = self._genz._AdaptiveThreshold(FIRST_M, STILL_M, MAP_M)

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
