# SPDX-License-Identifier: Apache-2.0
"""The odometry of a log, fitted: how its increments err, and others that err the same way.

An increment of the wheels is the true one and an error: a share of the distance, a turn for each
metre and for each radian turned, and a rest. The reference, too, errs from scan to scan. Over a
window of increments its part stays as large as it is, and that of the wheels grows. So slopes and
variances are those of windows, and what does not grow is no part of a twin's odometry. The rest of
a twin is the log's own, drawn again with replacement: slips stay as rare and as large as they were.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import nnls

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float

LEAST = 10  # increments, to fit anything
WINDOW = 16  # increments of the windows that tell slopes: 6 to 17 m of the logs' ways
LONGEST = 0.25  # of the increments are in the longest window that tells variances
ROBUST = 4.0  # medians of the rest: what is larger is a slip, which decides no slope
DIGITS = 9  # kept: the last ones of a fit are another CPU's
FLOOR = 1e-4  # m, rad: least deviation of an increment, about that of printed digits


@dataclass(frozen=True, kw_only=True, eq=False)
class OdometryFit:
    """How increments err.

    scale       m too much for each metre        side  m to the left for each metre
    turn_per_m  rad for each metre               turn_scale  rad too much for each radian
    variances   (2, 3) rows x and y, heading: for each metre, for each radian, of the reference
    rests       (n, 3) what is left, in deviations of these variances

    In the first three, metres backwards are negative.
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
            f"{unit} {what}": math.sqrt(self.variances[row, column])
            for row, unit in enumerate(("m", "rad"))
            for column, what in enumerate(("per sqrt m", "per sqrt rad", "of the reference"))
        }
        return {
            "m per m": self.scale, "sideways m per m": self.side, "rad per m": self.turn_per_m,
            "rad per rad": self.turn_scale, "increments": len(self.rests), **spread,
        }  # fmt: skip

    def drawn(self, true: Float, rng: np.random.Generator) -> Float:
        """(n, 3) odometry along true poses (n, 3), from its own origin, with errors like these."""
        steps, wheels = _steps(true), self.variances * [1.0, 1.0, 0.0]
        rests = self.rests[rng.integers(len(self.rests), size=len(steps))]
        slopes = np.array([self.scale, self.side, self.turn_per_m, self.turn_scale])
        steps += _by_slope(steps, slopes) + rests * _sigmas(steps, wheels)
        out = np.zeros((len(true), 3))
        for k, step in enumerate(steps):
            out[k + 1] = se2.compose(out[k], step)
        return out


def fitted(odometry: Float, true: Float) -> OdometryFit:
    """Of a log's odometry and its true poses, each (n, 3); ``InvalidValueError`` for too few."""
    if len(odometry) <= LEAST:
        raise InvalidValueError(f"odometry of {len(odometry)} poses, more than {LEAST} are needed")
    steps, headings = _steps(true), true[:-1, 2]
    errors = _steps(odometry) - steps
    errors[:, 2] = se2.wrap_array(errors[:, 2])
    n, metres = min(WINDOW, max(1, int(LONGEST * len(steps)))), steps[:, :1]
    along = _turned(np.hstack([metres, 0.0 * metres]), headings)  # m, in the frame of the map
    left = np.column_stack([-along[:, 1], along[:, 0]])
    by = np.column_stack([_windows(along, n).ravel(), _windows(left, n).ravel()])
    places = _slopes(_windows(_turned(errors[:, :2], headings), n).ravel(), by)
    turns = _slopes(_windows(errors[:, 2:], n).ravel(), _windows(steps[:, ::2], n))
    rests = errors - _by_slope(steps, np.array([*places, *turns]))
    placed = _variances(_turned(rests[:, :2], headings) / math.sqrt(2.0), steps)
    variances = np.array([placed, _variances(rests[:, 2:], steps)])
    return OdometryFit(
        scale=places[0], side=places[1], turn_per_m=turns[0], turn_scale=turns[1],
        variances=variances, rests=np.round(rests / _sigmas(steps, variances), DIGITS),
    )  # fmt: skip


def _steps(poses: Float) -> Float:
    return np.array([se2.between(a, b) for a, b in pairwise(poses)])


def _turned(rows: Float, headings: Float) -> Float:
    """(n, 2) rows, each turned by its heading: sums of them tell where the way leads."""
    c, s = np.cos(headings), np.sin(headings)
    return np.column_stack([c * rows[:, 0] - s * rows[:, 1], s * rows[:, 0] + c * rows[:, 1]])


def _windows(rows: Float, n: int) -> Float:
    """Sums of n successive rows."""
    sums = np.vstack([np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0)])
    out: Float = sums[n:] - sums[:-n]
    return out


def _sizes(steps: Float) -> Float:
    """(n, 3) by which variances grow: metres, radians; and one."""
    return np.column_stack([np.hypot(*steps[:, :2].T), np.abs(steps[:, 2]), np.ones(len(steps))])


def _sigmas(steps: Float, variances: Float) -> Float:
    """(n, 3) deviations of x, y, heading."""
    grown = (_sizes(steps)[:, None, :] * variances).sum(axis=2)
    sigmas = np.sqrt(np.maximum(grown, FLOOR**2))
    out: Float = sigmas[:, [0, 0, 1]]
    return out


def _by_slope(steps: Float, slopes: Float) -> Float:
    """(n, 3) errors of steps, but for the rest; slopes in the order of ``OdometryFit``."""
    scale, side, turn_per_m, turn_scale = slopes
    metres, turned = steps[:, 0], steps[:, 2]
    heading = turn_per_m * metres + turn_scale * turned
    return np.column_stack([scale * metres, side * metres, heading])


def _variances(rests: Float, steps: Float) -> Float:
    """(3,) of ``_sizes``: squared sums of windows of 1, 2, 4, ... rests, all lengths alike."""
    sizes, rows, squares, n = _sizes(steps), [], [], 1
    while n <= max(1, int(LONGEST * len(steps))):
        square = (_windows(rests, n) ** 2).sum(axis=1)
        usual = max(float(square.mean()), FLOOR**2)
        rows.append(np.column_stack([_windows(sizes[:, :2], n), np.ones(len(square))]) / usual)
        squares.append(square / usual)
        n *= 2
    out: Float = np.round(nnls(np.concatenate(rows), np.concatenate(squares))[0], DIGITS)
    return out


def _slopes(errors: Float, by: Float) -> tuple[float, ...]:
    """Least squares, twice: the second time without slips."""
    slopes = np.linalg.lstsq(by, errors, rcond=None)[0]
    rest = np.abs(errors - by @ slopes)
    usual = rest <= ROBUST * max(float(np.median(rest)), 1e-9)
    slopes = np.linalg.lstsq(by[usual], errors[usual], rcond=None)[0]
    return tuple(round(float(slope), DIGITS) for slope in slopes)
