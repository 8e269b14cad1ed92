# SPDX-License-Identifier: Apache-2.0
"""How sure the shunting SLAM is of its pose, in the map of the known start."""

from __future__ import annotations

import math

import numpy as np

from slam import se2
from slam.frames import Float
from slam.shunting.matching import Match
from slam.shunting.motion import WIDEN, Prediction, inverted

INFORMATION_SHARE = 0.3  # of the data's curvature that is independent from frame to frame
DRIFT_SHARE = 1.0  # of the pose's error that goes into newly mapped structure
LOCK_CELLS, LOCK_RAD = 0.05, 3e-4  # what the lattice itself leaves, 1 sigma


class Belief:
    """Fuses odometry and match into the covariance of the pose.

    covariance    (3, 3) of (x, y, theta) in the map frame; zero at the known start
    newest_drift  (3, 3) the share of it that the latest frame wrote into the map
    """

    def __init__(self, cell_m: float) -> None:
        self.covariance: Float = np.zeros((3, 3))
        self.newest_drift: Float = np.zeros((3, 3))
        self._relative: Float = np.zeros((3, 3))
        self._drift: Float = np.zeros((3, 3))
        lock = LOCK_CELLS * cell_m
        self._floor: Float = np.diag([lock * lock, lock * lock, LOCK_RAD**2])

    def relocated(self, covariance: Float) -> None:
        """Found again somewhere in the map, to within ``covariance`` (3, 3)."""
        self._relative = covariance.copy()

    def update(self, T_map_before: Float, prediction: Prediction, match: Match) -> None:
        """Take the motion from ``T_map_before`` and the match at its end in."""
        before = se2.propagate(self._relative, T_map_before, prediction.increment, np.zeros((3, 3)))
        spread = before + prediction.covariance / WIDEN**2
        share = INFORMATION_SHARE * match.tau
        self._relative = inverted(inverted(spread) + share * match.information)
        # What is new is mapped with the pose's present error, which then stays in the map.
        share = DRIFT_SHARE * (1.0 - match.matched)
        share *= math.sqrt(min(5.0 * max(prediction.elapsed, 0.0), 1.0))
        self.newest_drift = share * self._relative
        self._drift = self._drift + self.newest_drift
        self.covariance = self._relative + self._drift + self._floor
