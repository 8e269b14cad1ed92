# SPDX-License-Identifier: Apache-2.0
"""small_gicp (Koide 2024): generalised ICP against kept scans, with odometry as its guess.

The package brings the matcher, not a SLAM: as for Karto's, scans are kept after some way or turn,
stay where they were matched, and each scan is matched to those kept nearest to its predicted place.
It is made for 3D scanners: scans are stacked in three layers, and the pose found is laid flat.
"""

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
    Guest,
    configured,
    flattened,
    lifted,
    moved_on,
    nearest,
    stacked,
)
from slam.settings import Settings, number

APART_M = 0.1  # m between the three layers


@dataclass(frozen=True, kw_only=True)
class SmallGicpConfig(Settings):
    """Numbers of small_gicp, by its own names."""

    downsampling_resolution: float = number(
        0.05, "m", "one point in each such cell", low=0.005, high=5.0
    )
    num_neighbors: int = number(
        10, "points", "that a covariance is of", "its package", low=3, high=100
    )
    max_correspondence_distance: float = number(
        0.15, "m", "points farther apart are no pair; 0.25 and 0.5 are pulled along by movers",
        "training seeds", low=0.01, high=10.0,
    )  # fmt: skip
    max_iterations: int = number(30, "steps", "of a match", low=1, high=1000)
    keep_m: float = number(KEEP_M, "m", "a scan is kept after so much way", low=0.01, high=10.0)


class SmallGicpSlam(Guest):
    """small_gicp's matcher, a guest: generalised ICP to nearby kept scans, no graph."""

    config_class: ClassVar[type[SmallGicpConfig]] = SmallGicpConfig

    def __init__(self, config: SmallGicpConfig | Mapping[str, Any] | None = None) -> None:
        self.config = configured(SmallGicpConfig, config)
        self._gicp: Any = needed("small_gicp", "small-gicp")
        super().__init__()

    def begin(self, spec: LaserSpec) -> None:
        """No scans kept."""
        self._kept: list[Float] = []
        self._places: list[Float] = []
        self._near: tuple[int, ...] = ()
        self._target: Any = None

    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        """Generalised ICP from the predicted pose."""
        if not len(points_robot):
            return prediction.T_map_robot, {"inliers": 0.0}
        pose, share = prediction.T_map_robot, 1.0
        if self._kept:
            cloud, tree = self._goal(pose)
            source, _ = self._prepared(points_robot)
            result = self._gicp.align(
                cloud, source, tree, lifted(pose), "GICP",
                self.config.max_correspondence_distance, 1, self.config.max_iterations,
            )  # fmt: skip
            pose = flattened(result.T_target_source)
            share = result.num_inliers / max(source.size(), 1)
        if not self._kept or moved_on(self._places[-1], pose, self.config.keep_m):
            self._kept.append(se2.transform(pose, points_robot))
            self._places.append(pose)
        return pose, {"inliers": float(share)}

    def _goal(self, pose: Float) -> Any:
        """Cloud and tree of the kept scans nearby, made again when these change."""
        near = sorted(nearest(self._places, pose))
        if tuple(near) != self._near:
            self._near = tuple(near)
            self._target = self._prepared(np.concatenate([self._kept[k] for k in near]))
        return self._target

    def _prepared(self, points: Float) -> Any:
        own = self.config
        return self._gicp.preprocess_points(
            stacked(points, APART_M), own.downsampling_resolution, own.num_neighbors, 1
        )
