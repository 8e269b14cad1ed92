# SPDX-License-Identifier: Apache-2.0
"""The heading bias of an odometry.

Wheels of unequal size turn a robot that drives straight, a wrong track miscounts its turns
(UMBmark, Borenstein and Feng 1996), both for a whole run. That bias is learnt while the map shows
the heading; left in, it leads a robot astray as soon as the map shows little.
"""

import numpy as np

from slam import se2
from slam._jit import inner, uncounted
from slam.arrays import Float
from slam.frontend.config import FRONTEND, BiasConfig

# Set by hand.
LASTS_S = 1000.0  # s in which a robot's bias may change by 1 sigma
INDEPENDENT = 0.3  # share of a match's information, from frame to frame
DATA_SHARE = 0.5  # least share of the data in a match's heading
MATCHED = 0.3  # least matched share of observations
OUTLIER = 9.0  # squared innovation, in variances, above which a match is left out: 3 sigma
PLACE_INFORMATION = 1e-3  # 1/m^2, of the position where it is unknown: 30 m


class HeadingBias:
    """A Kalman filter of three: the heading's error against the map, and the two biases.

    Each match gives it what the data alone say of the heading. It learns nothing where they say
    nothing, so it needs no gate against featureless places.

    per_m, per_rad  what the odometry adds, rad for each m driven and each rad turned
    """

    def __init__(self, config: BiasConfig = FRONTEND.bias) -> None:
        self._config = config
        self.per_m, self.per_rad = 0.0, 0.0
        self._P: Float = np.diag([0.0, config.per_m**2, config.per_rad**2])

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
        (said, given), (share, off, information) = variances, matched
        per_m, per_rad = _learnt(
            self._P, float(increment[0]), float(increment[2]), said, given,
            self._config.per_m**2 * elapsed / LASTS_S, self._config.per_rad**2 * elapsed / LASTS_S,
            share, se2.wrap(off), information,
        )  # fmt: skip
        self.per_m -= per_m
        self.per_rad -= per_rad


@uncounted
def _learnt(  # noqa: PLR0913 (kernel)
    P: Float, along: float, turning: float, said: float, given: float, grown_m: float,
    grown_rad: float, share: float, off: float, information: Float
) -> tuple[float, float]:  # fmt: skip
    """By how much a match lowers the biases; P (3, 3), their covariance, goes on as ``learn`` and
    its arguments say."""
    first, second, third = (
        P[0, 0] + along * P[1, 0] + turning * P[2, 0],
        P[0, 1] + along * P[1, 1] + turning * P[2, 1],
        P[0, 2] + along * P[1, 2] + turning * P[2, 2],
    )
    P[0, 0] = first + second * along + third * turning + said
    P[0, 1] = P[1, 0] = second
    P[0, 2] = P[2, 0] = third
    P[1, 1] += grown_m
    P[2, 2] += grown_rad
    found = _of_heading(information)
    kept = found * given / (1.0 + found * given)  # of what the data say, beside the prior
    if share < MATCHED or kept < DATA_SHARE:
        return 0.0, 0.0
    innovation, S = off / kept, P[0, 0] + 1.0 / (INDEPENDENT * found)
    if innovation * innovation > OUTLIER * S:
        return 0.0, 0.0
    k0, k1, k2 = P[0, 0] / S, P[1, 0] / S, P[2, 0] / S
    p0, p1, p2 = P[0, 0], P[0, 1], P[0, 2]
    for j in range(3):
        k = k0 if j == 0 else k1 if j == 1 else k2
        P[j, 0], P[j, 1], P[j, 2] = P[j, 0] - k * p0, P[j, 1] - k * p1, P[j, 2] - k * p2
    return k1 * innovation, k2 * innovation


@inner
def _of_heading(information: Float) -> float:
    """Information on the heading that is left with the place unknown, 1/rad^2."""
    a, b, e = information[0, 0] + PLACE_INFORMATION, information[0, 1], information[0, 2]
    d, f, h = information[1, 1] + PLACE_INFORMATION, information[1, 2], information[2, 2]
    left = h - (d * e * e - 2.0 * b * e * f + a * f * f) / max(a * d - b * b, 1e-9)
    return float(max(left, 0.0))
