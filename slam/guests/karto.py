# SPDX-License-Identifier: Apache-2.0
"""Karto's correlative scan matcher (Konolige et al. 2010; Olson 2009) against kept scans.

The package brings the matcher, not Karto's graph: kept scans stay where they were matched. As in
Karto a scan is kept after some way or turn; each scan, kept or not, is matched to the kept ones
nearest to its predicted place, old ones too, so that a robot that comes back finds its old map.
"""

import math
from typing import Any

import numpy as np

from slam import se2
from slam.errors import needed
from slam.frames import Float, LaserSpec
from slam.frontend.odometry_prior import Prediction
from slam.guests.guest import NOTHING_M, Guest, check_beams, moved_on, nearest, ranges_of

RANGE_M = 20.0
FINE_RAD = math.radians(0.1)
NARROW = (0.3, 0.35)  # m across, rad either way
WIDE = (1.2, 0.5)  # the same, where the narrow search does poorly
POOR = 0.35  # Karto's response, of 1; its own least for a loop


class KartoSlam(Guest):
    """Karto's scan matcher, a guest: correlative matching to nearby kept scans, no graph."""

    def __init__(self) -> None:
        self._module: Any = needed("karto_scanmatcher", "karto-scanmatcher")
        super().__init__()

    def reset(self) -> None:
        """Forget everything; the next frame is the origin of the map."""
        super().reset()
        self._kept: list[Any] = []
        self._places: list[Float] = []

    def begin(self, spec: LaserSpec) -> None:
        """Two matchers, of a narrow and a wide search."""
        check_beams(self, spec)
        self._spec = spec
        reach = min(spec.range_max, RANGE_M)
        first, step = spec.angle_min, spec.angle_increment
        last = first + (spec.n_beams - 1) * step
        self._laser = self._module.LaserScanConfig(
            first, last, step, spec.range_min, spec.range_max, reach, "laser"
        )
        self._matchers = []
        for search_m, search_rad in (NARROW, WIDE):
            config = self._module.ScanMatcherConfig()
            config.range_threshold = reach
            config.search_size = search_m
            config.coarse_search_angle_offset = search_rad
            config.fine_search_angle_resolution = FINE_RAD
            self._matchers.append(self._module.Wrapper(config))

    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        """Match to the kept scans nearby, far and wide where that fits poorly."""
        T_map_laser = se2.compose(prediction.T_map_robot, self._spec.T_robot_laser)
        scan = self._scan(points_robot, T_map_laser)
        if not self._kept:
            self._keep(scan, T_map_laser)
            return prediction.T_map_robot, {"response": 1.0}
        near = [self._kept[k] for k in nearest(self._places, T_map_laser)]
        result = self._matchers[0].match_scan(scan, near, True, True)
        if result.response < POOR:
            wide = self._matchers[1].match_scan(scan, near, True, True)
            if wide.response > result.response:
                result = wide
        best = result.best_pose
        T_map_laser = np.array([best.x, best.y, best.yaw])
        if moved_on(self._places[-1], T_map_laser):
            self._keep(scan, T_map_laser)
        T_map_robot = se2.compose(T_map_laser, se2.inverse(self._spec.T_robot_laser))
        return T_map_robot, {"response": float(result.response)}

    def _scan(self, points_robot: Float, T_map_laser: Float) -> Any:
        """Karto's own type: a range for each beam, here of the de-skewed end points."""
        spec = self._spec
        ranges = ranges_of(points_robot, spec, NOTHING_M)
        pose = self._module.Pose2(*T_map_laser.tolist())
        number = len(self._path)
        return self._module.LocalizedRangeScan(
            self._laser, ranges.tolist(), pose, pose, number, float(number)
        )

    def _keep(self, scan: Any, T_map_laser: Float) -> None:
        scan.corrected_pose = self._module.Pose2(*T_map_laser.tolist())
        self._kept.append(scan)
        self._places.append(T_map_laser)
