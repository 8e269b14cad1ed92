# SPDX-License-Identifier: Apache-2.0
"""Karto's correlative scan matcher (Konolige et al. 2010; Olson 2009) against kept scans.

The package brings the matcher, not Karto's graph: kept scans stay where they were matched. As in
Karto a scan is kept after some way or turn; each scan, kept or not, is matched to the kept ones
nearest to its predicted place, old ones too, so that a robot that comes back finds its old map.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from slam import se2
from slam.errors import needed
from slam.frames import Float, LaserSpec
from slam.frontend.odometry_prior import Prediction
from slam.guests.guest import (
    KEEP_M,
    NOTHING_M,
    Guest,
    check_beams,
    configured,
    moved_on,
    nearest,
    ranges_of,
)
from slam.settings import Settings, number

WIDE = (1.2, 0.5)  # m across, rad either way: where the narrow search does poorly
OF_PACKAGE = "its package"


@dataclass(frozen=True, kw_only=True)
class KartoConfig(Settings):
    """Numbers of Karto's matcher, by its own names (in slam_toolbox's YAML nearly the same)."""

    search_size: float = number(0.3, "m", "across, of the search", low=0.02, high=5.0)
    resolution: float = number(0.01, "m", "of the search", OF_PACKAGE, low=0.005, high=0.2)
    smear_deviation: float = number(
        0.03, "m", "a kept point is smeared so wide; 0.5 to 10 times the resolution", OF_PACKAGE,
        low=0.005, high=0.5,
    )  # fmt: skip
    coarse_search_angle_offset: float = number(
        0.35, "rad", "either way, of the search", low=0.01, high=1.5
    )
    coarse_angle_resolution: float = number(
        math.radians(2.0), "rad", "of the first search", OF_PACKAGE, low=0.002, high=0.3
    )
    fine_search_angle_resolution: float = number(
        math.radians(0.1), "rad", "of the last search", low=1e-4, high=0.1
    )
    distance_variance_penalty: float = number(
        0.5, "m²", "the response falls with 0.2 of the squared distance from odometry over this",
        OF_PACKAGE, low=1e-4, high=10.0,
    )  # fmt: skip
    minimum_distance_penalty: float = number(
        1.0, "share", "of the response, to which distance lowers it; 1: it does not", OF_PACKAGE,
        high=1.0,
    )  # fmt: skip
    angle_variance_penalty: float = number(
        math.radians(20.0), "rad²", "as of distance, of the turn", OF_PACKAGE, low=1e-4, high=10.0
    )
    minimum_angle_penalty: float = number(
        0.9, "share", "of the response, to which the turn lowers it", OF_PACKAGE, high=1.0
    )
    range_threshold: float = number(20.0, "m", "ranges beyond are not matched", low=0.5, high=200.0)
    poor_response: float = number(
        0.35, "share", "of Karto's response: below, a wide search runs", "its least for a loop",
        high=1.0,
    )  # fmt: skip
    keep_m: float = number(
        KEEP_M, "m", "a scan is kept after so much way", "Karto's minimum travel distance",
        low=0.01, high=10.0,
    )  # fmt: skip


OF_MATCHER = (
    "resolution", "smear_deviation", "coarse_angle_resolution", "fine_search_angle_resolution",
    "distance_variance_penalty", "minimum_distance_penalty", "angle_variance_penalty",
    "minimum_angle_penalty",
)  # fmt: skip
"""Numbers of both its matchers."""


class KartoSlam(Guest):
    """Karto's scan matcher, a guest: correlative matching to nearby kept scans, no graph."""

    config_class: ClassVar[type[KartoConfig]] = KartoConfig

    def __init__(self, config: KartoConfig | Mapping[str, Any] | None = None) -> None:
        self.config = configured(KartoConfig, config)
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
        own = self.config
        reach = min(spec.range_max, own.range_threshold)
        first, step = spec.angle_min, spec.angle_increment
        last = first + (spec.n_beams - 1) * step
        self._laser = self._module.LaserScanConfig(
            first, last, step, spec.range_min, spec.range_max, reach, "laser"
        )
        self._matchers = []
        narrow = (own.search_size, own.coarse_search_angle_offset)
        for search_m, search_rad in (narrow, WIDE):
            config = self._module.ScanMatcherConfig()
            for name in OF_MATCHER:
                setattr(config, name, getattr(own, name))
            config.range_threshold = reach
            # Its grid must have an odd side: else Karto writes beside it.
            step = 2.0 * own.resolution
            config.search_size = step * max(round(search_m / step), 1)
            config.coarse_search_angle_offset = search_rad
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
        if result.response < self.config.poor_response:
            wide = self._matchers[1].match_scan(scan, near, True, True)
            if wide.response > result.response:
                result = wide
        best = result.best_pose
        T_map_laser = np.array([best.x, best.y, best.yaw])
        if moved_on(self._places[-1], T_map_laser, self.config.keep_m):
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
