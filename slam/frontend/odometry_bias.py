# SPDX-License-Identifier: Apache-2.0
"""What the odometry adds to the heading by itself, learnt while the map shows the heading.

Wheels of unequal size turn a robot that drives straight, a wrong track miscounts its turns
(UMBmark, Borenstein and Feng 1996), both for a whole run. Left in, they lead a robot
astray as soon as the map shows little. Without them, odometry is more accurate.
"""

from __future__ import annotations

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.config import FRONTEND, BiasConfig


class HeadingBias:
    """A Kalman filter of three: the heading's error against the map, and the two biases.

    Each match gives it what the data alone say of the heading. It learns nothing where they say
    nothing, so it needs no gate against featureless places.

    per_m, per_rad  what the odometry adds, rad for each m driven and each rad turned
    """

    def __init__(self, config: BiasConfig = FRONTEND.bias) -> None:
        self._config = config
        self.per_m, self.per_rad = 0.0, 0.0
        self._P = [[0.0] * 3, [0.0, config.per_m**2, 0.0], [0.0, 0.0, config.per_rad**2]]

    def corrected(self, increment: Float) -> Float:
        """The increment (3,) without the biases."""
        x, y, turn = increment.tolist()
        return np.array([x, y, turn * (1.0 - self.per_rad) - x * self.per_m])

    def learn(
        self,
        increment: Float,
        elapsed: float,
        variances: tuple[float, float],
        matched: tuple[float, float, Float],
    ) -> None:
        """Take in one match.

        increment  (3,) corrected motion of ``elapsed`` s that led to the prediction
        variances  rad^2 of its heading: by odometry, and as the matcher was given it
        matched    share of the observations matched, the heading found minus the predicted one
                   (rad), and the data's information (3, 3) by (x, y, theta) at their full weight
        """
        said, given = variances
        self._move(increment, said, elapsed)
        share, off, information = matched
        found, config = _of_heading(information, self._config.place_information), self._config
        kept = found * given / (1.0 + found * given)  # of what the data say, beside the prior
        if share >= config.matched and kept >= config.data_share:
            self._see(se2.wrap(off) / kept, 1.0 / (config.independent * found))

    def _move(self, increment: Float, variance: float, elapsed: float) -> None:
        P, G = self._P, (1.0, float(increment[0]), float(increment[2]))
        row = [G[0] * P[0][k] + G[1] * P[1][k] + G[2] * P[2][k] for k in range(3)]
        P[0] = [row[0] * G[0] + row[1] * G[1] + row[2] * G[2] + variance, row[1], row[2]]
        P[1][0], P[2][0] = row[1], row[2]
        config = self._config
        P[1][1] += config.per_m**2 * elapsed / config.lasts_s
        P[2][2] += config.per_rad**2 * elapsed / config.lasts_s

    def _see(self, innovation: float, variance: float) -> None:
        P = self._P
        S = P[0][0] + variance
        if innovation * innovation > self._config.outlier * S:
            return
        K = [P[j][0] / S for j in range(3)]
        self.per_m -= K[1] * innovation
        self.per_rad -= K[2] * innovation
        self._P = [[P[j][k] - K[j] * P[0][k] for k in range(3)] for j in range(3)]


def _of_heading(information: Float, least: float) -> float:
    """Information on the heading that is left with the place unknown, 1/rad^2."""
    (a, b, e), (_, d, f), (_, _, h) = information.tolist()
    a, d = a + least, d + least
    left: float = h - (d * e * e - 2.0 * b * e * f + a * f * f) / max(a * d - b * b, 1e-9)
    return max(left, 0.0)
