# SPDX-License-Identifier: Apache-2.0
"""How far to trust odometry: its covariance, scaled until it explains what matching corrects.

An innovation is where a match alone puts the robot, against where odometry does. Its covariance is
that of the increment plus that of a match. What was driven lately says by how much to multiply the
first, apart for translation and for rotation, whether a log states it or it had to be assumed.

Wheels that slip, or people who push the robot, do so for some tenths of a second. After two scans
in a row that odometry cannot have led to, its next increments may be off by as much.
"""

import math
from typing import Self

import numpy as np

from slam._jit import inner, njit
from slam.arrays import Float
from slam.frames import Odometry
from slam.frontend.heading_bias import HeadingBias
from slam.frontend.odometry_prior import (
    Prediction,
    inverse,
    predict,
    squared,
    turn,
)  # fmt: skip
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.matcher import Match
from slam.tracker.uncertainty.covariances import plus

SLIP = 12.0  # squared innovation of three numbers that noise exceeds in 0.7 %; set by hand
SLIP_S = 0.2  # s that a slip lasts in the mean; set by hand: station, 0.6 rad in 0.6 s
SLIP_STEP_S = 0.15  # s, longest step: slower scans see no slip twice


@inner
def _across(covariance: Float, across: tuple[float, float]) -> float:
    """Variance of the position along a unit vector; of both directions where that is zero."""
    a, b, d = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    x, y = across
    if x == 0.0 and y == 0.0:
        return float(a + d)
    return float(x * x * a + 2.0 * x * y * b + y * y * d)


@njit
def innovation(
    stated: Float,
    prior: Float,
    data: Float,
    off: Float,
    share: float,
    across: tuple[float, float],
) -> tuple[float, float, float, float, float]:
    """What the correction ``off`` of a pose matched with ``prior`` says about what is ``stated``.

    ``data`` is the information with which the match corrected, ``share`` how much of the variance
    that claims it really has. The innovation e is what a match alone would have said: off = K e, so
    e = off + R inv(P) off. Returns its NIS, its squares in position and heading, and the match's
    variances there; of the position only along the unit vector ``across`` unless that is zero.
    """
    precision, R, S = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    inverse(prior, precision)
    inverse(plus(data, 1e-3, precision), R)
    pulled, e = np.zeros(3), np.zeros(3)
    for i in range(3):
        for k in range(3):
            pulled[i] += precision[i, k] * off[k]
    for i in range(3):
        e[i] = off[i]
        for k in range(3):
            e[i] += R[i, k] * pulled[k]
    inverse(plus(stated, share, R), S)
    nis = 0.0
    for i in range(3):
        for k in range(3):
            nis += e[i] * S[i, k] * e[k]
    x, y = across
    place, variance = e[0] * e[0] + e[1] * e[1], R[0, 0] + R[1, 1]
    if x != 0.0 or y != 0.0:
        place = (x * e[0] + y * e[1]) ** 2
        variance = x * x * R[0, 0] + 2.0 * x * y * R[0, 1] + y * y * R[1, 1]
    return nis, place, e[2] * e[2], share * variance, share * R[2, 2]


@njit
def compared(  # noqa: PLR0913 (kernel)
    covariance: Float,
    carried: Float,
    prior: Float,
    unscaled: Float,
    start: float,
    data: Float,
    off: Float,
    share: float,
    across: tuple[float, float],
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """``innovation`` of an increment with that ``covariance`` from a pose off by what odometry
    ``carried`` there; then, of the step as stated (``unscaled``, in axes turned by -start) and of
    what was carried, the variances of position (see ``across``) and of heading.
    """
    step = np.empty((3, 3))
    turn(unscaled, start, step)
    nis, place, heading, of_place, of_heading = innovation(
        plus(covariance, 1.0, carried), prior, data, off, share, across
    )
    return (
        nis, place, heading, of_place, of_heading,
        _across(step, across), step[2, 2], _across(carried, across), carried[2, 2],
    )  # fmt: skip


class OdometryNoise:
    """Predicts, and learns from what became of it.

    scales  (2,) of the variances of translation and rotation
    nis     of the latest frame; None where its match is not used
    bias    what odometry adds to the heading by itself; taken out of it. None: not learnt
    """

    def __init__(
        self,
        config: TrackerConfig,
        *,
        overlaps: bool,
        least_stated: float,
        bias: HeadingBias | None,
    ) -> None:
        """``overlaps``: a match's information is the curvature of overlaps, which claims more than
        the noise of beams says; ``least_stated``: least scale of a covariance that a log states.
        """
        self._sigma_m = config.frontend.sigma_cells * config.cell_m if overlaps else None
        self._config = config.uncertainty.odometry
        self._least_stated = least_stated
        self.scales: Float = np.ones(2)
        self.nis: float | None = None
        self.bias = bias
        self._stated = False
        self._least = least_stated
        self._slips = False  # in the latest frame
        self._slip: Float = np.zeros((3, 3))  # of the next increment, should a slip go on
        self._squares = [0.0, 0.0]  # no arrays: numbers of those take twice as long
        self._expected = [0.0, 0.0]

    @classmethod
    def of_beams(cls, config: TrackerConfig) -> Self:
        """Matches of scans, whose information is the curvature of overlaps between bells."""
        least, bias = config.uncertainty.odometry.least_stated, HeadingBias(config.frontend.bias)
        return cls(config, overlaps=True, least_stated=least, bias=bias)

    @classmethod
    def of_points(cls, config: TrackerConfig, *, overlaps: bool) -> Self:
        """Matches of points, whose information is what the covariances of points say, or with
        ``overlaps`` the curvature of those.

        A point is off in the same way for many frames (which side of a trunk is seen): odometry
        looks too good beside such matches, and a bias learnt from them is theirs. So a stated
        covariance is never made smaller, and no bias is learnt.
        """
        return cls(config, overlaps=overlaps, least_stated=1.0, bias=None)

    def noise_share(self, sensor_sigma_m: float) -> float:
        """Variance of a match by the noise of what was seen over what its information claims."""
        return 1.0 if self._sigma_m is None else (sensor_sigma_m / self._sigma_m) ** 2 / 2.0

    def predict(self, T_map_before: Float, before: Odometry, now: Odometry) -> Prediction:
        """The prior of a frame."""
        stated = now.increment_covariance is not None
        self._least = self._least_stated if stated else self._config.least_assumed
        if self._expected[0] == 0.0:
            first = self._config.stated if stated else self._config.assumed
            self._expected = [self._config.at_first] * 2
            self._squares = [self._config.at_first * first] * 2
            self.scales = np.array(self._squares) / self._expected
        along, turning = self.scales.tolist()
        self._stated = stated
        elapsed = (now.stamp_ns - before.stamp_ns) * 1e-9
        self._slip = math.exp(-max(elapsed, 0.0) / SLIP_S) * self._slip
        return predict(T_map_before, before, now, (along, turning), self.bias, self._slip)

    def note_slip(self, prediction: Prediction, match: Match) -> None:
        """Ask it of a match, to the map or to a local copy."""
        if match.tau == 0.0 or prediction.elapsed > SLIP_STEP_S:
            self.forget_slip()
            return
        off = prediction.off(match.T_map_robot)
        slipped, self._slips = self._slips, squared(off, prediction.prior) > SLIP
        if slipped and self._slips:
            self._slip = self._slip + np.multiply.outer(off, off)

    def forget_slip(self) -> None:
        """The robot was not matched where its motion led."""
        self._slips, self._slip = False, np.zeros((3, 3))

    def learn(
        self,
        prediction: Prediction,
        match: Match,
        sensor_sigma_m: float,
        along_rad: float | None = None,
    ) -> None:
        """Compare the increment with a match that is used, by ranges of that sigma.

        ``along_rad``: direction in the map about which the match says nothing; None: there is none.
        """
        off = prediction.off(match.T_map_robot)
        data = match.tau * match.information
        share = min(match.tau * self.noise_share(sensor_sigma_m), 1.0)
        across = (0.0, 0.0) if along_rad is None else (-math.sin(along_rad), math.cos(along_rad))
        start = float(prediction.T_map_robot[2]) - float(prediction.increment[2])
        self.nis, place, heading, of_match, match_rad2, of_place, c, of_carried, t = compared(
            prediction.covariance, prediction.carried, prediction.prior, prediction.unscaled,
            start, data, off, share, across,
        )  # fmt: skip
        floor_m2, floor_rad2 = prediction.floor
        floors_m2 = floor_m2 * (2.0 if along_rad is None else 1.0)
        config = self._config
        frames = max(config.memory, config.memory_s / max(prediction.elapsed, 1e-3))
        keep = math.exp(-1.0 / frames)
        scales: list[float] = self.scales.tolist()
        for k, found, unit, rest in (
            (0, place, of_place, floors_m2 + of_carried + of_match),
            (1, heading, c, floor_rad2 + t + match_rad2),
        ):
            expected = scales[k] * unit + rest
            square = min(found, config.wild * expected)
            # Least squares of square = scale * unit + rest, weighed by what scatter to expect.
            weight = unit / expected**2
            self._squares[k] = keep * self._squares[k] + weight * (square - rest)
            self._expected[k] = keep * self._expected[k] + weight * unit
            scale = self._squares[k] / max(self._expected[k], 1e-9)
            self.scales[k] = min(max(scale, self._least), config.most)
        if self.bias is not None and self._stated:
            # an assumed variance says nothing of what is bias and what is chance
            variances = float(prediction.covariance[2, 2]), float(prediction.prior[2, 2])
            found_out = match.matched, float(off[2]), data
            self.bias.learn(prediction.increment, prediction.elapsed, variances, found_out)
