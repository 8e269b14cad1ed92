# SPDX-License-Identifier: Apache-2.0
"""Whether matches and odometry agree over seconds, not only from scan to scan."""

from __future__ import annotations

import math

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.standing.config import StandingConfig


class Agreement:
    """Sums of what matches corrected, over some windows, against what odometry may be off.

    A window of w s forgets with exp(-t / w): S = sum of corrections, V = sum of their covariances
    by odometry. With R, what a match itself may be off, S' (V + R)^-1 S / 3 is 1 on average.
    """

    def __init__(self, config: StandingConfig) -> None:
        self._config = config
        self._windows = (config.window_s, config.long_window_s)
        self._sums = [np.zeros(3) for _ in self._windows]
        self._variances = [np.zeros((3, 3)) for _ in self._windows]
        own = (config.match_m, config.match_m, math.radians(config.match_deg))
        self._own = np.diag(np.square(own))

    def reset(self) -> None:
        """The robot is elsewhere."""
        self.__init__(self._config)  # type: ignore[misc]

    def ratio(self, prediction: Prediction, T_map_robot: Float) -> float:
        """The largest of the windows' S' (V + R)^-1 S / 3 if the robot is at a pose."""
        return max(
            float(S @ inverted(V + self._own) @ S) / 3.0
            for S, V in self._with(prediction, T_map_robot)
        )

    def take(self, prediction: Prediction, T_map_robot: Float) -> None:
        """The robot is there."""
        whole = self._with(prediction, T_map_robot)
        self._sums, self._variances = [S for S, _ in whole], [V for _, V in whole]

    def share(self, ratio: float) -> float:
        """What is left of the votes of the young at a ratio."""
        return 1.0 / (1.0 + (ratio / self._config.disagreed) ** 2)

    def _with(self, prediction: Prediction, T_map_robot: Float) -> list[tuple[Float, Float]]:
        off = T_map_robot - prediction.T_map_robot
        off[2] = se2.wrap(float(off[2]))
        out = []
        for window, S, V in zip(self._windows, self._sums, self._variances, strict=True):
            keep = math.exp(-prediction.elapsed / window)
            out.append((keep * S + off, keep * keep * V + prediction.covariance))
        return out
