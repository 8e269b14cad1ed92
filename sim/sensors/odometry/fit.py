# SPDX-License-Identifier: Apache-2.0
"""The odometry of a log, fitted: how its increments err, and others that err the same way.

An increment of the wheels is the true one and an error: a share of the distance, a turn for each
metre and for each radian turned, and a rest whose variance grows with both. The rest of a twin is
the log's own, drawn again with replacement, so that slips stay as rare and as large as they were.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from slam import se2
from slam.errors import InvalidValueError

Float = NDArray[np.float64]
LEAST = 10  # increments, to fit anything
ROBUST = 4.0  # medians of the rest: what is larger is a slip, which decides no slope
DIGITS = 9  # kept: the last ones of a fit are another CPU's
FLOOR_M, FLOOR_RAD = 1e-4, 1e-4  # least deviation of an increment, about that of printed digits


@dataclass(frozen=True, kw_only=True, eq=False)
class OdometryFit:
    """How increments err.

    scale       m too much for each metre        side  m to the left for each metre
    turn_per_m  rad for each metre               turn_scale  rad too much for each radian
    variances   (3, 3) rows x, y, heading: for each metre, for each radian, floor
    rests       (n, 3) what is left, in deviations of these variances
    """

    scale: float
    side: float
    turn_per_m: float
    turn_scale: float
    variances: Float
    rests: Float

    def words(self) -> dict[str, Any]:
        """As it is written."""
        spread = {
            f"{what} per sqrt {by}": math.sqrt(self.variances[row, column])
            for row, what in enumerate(("m", "sideways m", "rad"))
            for column, by in enumerate(("m", "rad"))
        }
        return {
            "m per m": self.scale, "sideways m per m": self.side, "rad per m": self.turn_per_m,
            "rad per rad": self.turn_scale, "increments": len(self.rests), **spread,
        }  # fmt: skip

    def drawn(self, true: Float, rng: np.random.Generator) -> Float:
        """(n, 3) odometry along true poses (n, 3), from its own origin, with errors like these."""
        out = np.zeros((len(true), 3))
        for k in range(1, len(true)):
            step = se2.between(true[k - 1], true[k])
            rest = self.rests[int(rng.integers(len(self.rests)))]
            out[k] = se2.compose(out[k - 1], self._off(step) + rest * self._sigma(step))
        return out

    def _off(self, step: Float) -> Float:
        metres, turned = float(np.hypot(step[0], step[1])), float(step[2])
        x = step[0] + self.scale * metres
        y, heading = step[1] + self.side * metres, turned * (1.0 + self.turn_scale)
        return np.array([x, y, heading + self.turn_per_m * metres])

    def _sigma(self, step: Float) -> Float:
        metres, turned = np.hypot(step[0], step[1]), abs(step[2])
        by_metre, by_rad, floor = self.variances.T
        sigma: Float = np.sqrt(by_metre * metres + by_rad * turned + floor)
        return sigma


def fitted(odometry: Float, true: Float) -> OdometryFit:
    """Of a log's odometry and its true poses, each (n, 3); ``InvalidValueError`` for too few."""
    if len(odometry) <= LEAST:
        raise InvalidValueError(f"odometry of {len(odometry)} poses, more than {LEAST} are needed")
    steps = np.array([se2.between(a, b) for a, b in pairwise(true)])
    wheels = np.array([se2.between(a, b) for a, b in pairwise(odometry)])
    errors = wheels - steps
    errors[:, 2] = se2.wrap_array(errors[:, 2])
    metres, turned = np.hypot(steps[:, 0], steps[:, 1]), steps[:, 2]
    (scale,) = _slopes(errors[:, 0], metres[:, None])
    (side,) = _slopes(errors[:, 1], metres[:, None])
    turn_per_m, turn_scale = _slopes(errors[:, 2], np.column_stack([metres, turned]))
    rests = errors - np.column_stack(
        [scale * metres, side * metres, turn_per_m * metres + turn_scale * turned]
    )
    sizes = np.column_stack([metres, np.abs(turned)])
    floors = np.array([FLOOR_M, FLOOR_M, FLOOR_RAD]) ** 2
    grown = np.array([nnls(sizes, rests[:, k] ** 2)[0] for k in range(3)])
    variances = np.column_stack([grown, floors])
    fit = OdometryFit(
        scale=scale, side=side, turn_per_m=turn_per_m, turn_scale=turn_scale,
        variances=np.round(variances, DIGITS), rests=rests,
    )  # fmt: skip
    sigma = np.array([fit._sigma(step) for step in steps])
    return replace(fit, rests=np.round(rests / sigma, DIGITS))


def _slopes(errors: Float, by: Float) -> tuple[float, ...]:
    """Least squares, twice: the second time without slips."""
    slopes = np.linalg.lstsq(by, errors, rcond=None)[0]
    rest = np.abs(errors - by @ slopes)
    usual = rest <= ROBUST * max(float(np.median(rest)), 1e-9)
    slopes = np.linalg.lstsq(by[usual], errors[usual], rcond=None)[0]
    return tuple(round(float(slope), DIGITS) for slope in slopes)
