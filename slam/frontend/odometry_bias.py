# SPDX-License-Identifier: Apache-2.0
"""What the odometry adds to the heading by itself, learnt while the map tells the heading.

Wheels of unequal size turn a robot that drives straight, a wrong track miscounts its turns
(UMBmark, Borenstein and Feng 1996), both for a whole run. Left in, they are what a robot goes
astray by as soon as the map tells little; taken out, odometry may be trusted more.
"""

from __future__ import annotations

import numpy as np

from slam import se2
from slam.frames import Float

PER_M, PER_RAD = 0.012, 0.03  # standard deviation among robots: rad per m, rad per rad
LASTS_S = 1000.0  # the time in which a robot may become another one
INDEPENDENT = 0.3  # share of a match's information that is, from frame to frame
TOLD = 0.5  # least share of the data in what a match says of the heading; with MATCHED of it all
MATCHED = 0.3
OUTLIER = 9.0  # squared deviations: a wheel that slipped, or a wrong match


class TurnBias:
    """A Kalman filter of three: the heading's error against the map, and the two biases.

    Each match gives it what the data alone say of the heading. It learns nothing where they tell
    nothing, so it needs no gate against featureless places.

    per_m, per_rad  what the odometry adds, rad for each m driven and each rad turned
    """

    def __init__(self) -> None:
        self.per_m, self.per_rad = 0.0, 0.0
        self._P = [[0.0] * 3, [0.0, PER_M**2, 0.0], [0.0, 0.0, PER_RAD**2]]

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
        told = _of_heading(information)
        kept = told * given / (1.0 + told * given)  # of what the data say, beside the prior
        if share >= MATCHED and kept >= TOLD:
            self._see(se2.wrap(off) / kept, 1.0 / (INDEPENDENT * told))

    def _move(self, increment: Float, variance: float, elapsed: float) -> None:
        P, G = self._P, (1.0, float(increment[0]), float(increment[2]))
        row = [G[0] * P[0][k] + G[1] * P[1][k] + G[2] * P[2][k] for k in range(3)]
        P[0] = [row[0] * G[0] + row[1] * G[1] + row[2] * G[2] + variance, row[1], row[2]]
        P[1][0], P[2][0] = row[1], row[2]
        P[1][1] += PER_M**2 * elapsed / LASTS_S
        P[2][2] += PER_RAD**2 * elapsed / LASTS_S

    def _see(self, innovation: float, variance: float) -> None:
        P = self._P
        S = P[0][0] + variance
        if innovation * innovation > OUTLIER * S:
            return
        K = [P[j][0] / S for j in range(3)]
        self.per_m -= K[1] * innovation
        self.per_rad -= K[2] * innovation
        self._P = [[P[j][k] - K[j] * P[0][k] for k in range(3)] for j in range(3)]


def _of_heading(information: Float) -> float:
    """Information on the heading that is left with the place unknown, 1/rad^2."""
    (a, b, e), (_, d, f), (_, _, h) = information.tolist()
    a, d = a + 1e-3, d + 1e-3  # a place unknown by 30 m
    left: float = h - (d * e * e - 2.0 * b * e * f + a * f * f) / max(a * d - b * b, 1e-9)
    return max(left, 0.0)
