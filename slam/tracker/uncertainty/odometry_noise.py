# SPDX-License-Identifier: Apache-2.0
"""How far to trust odometry: its covariance, scaled until it explains what matching corrects.

An innovation is where a match alone puts the robot, against where odometry does. Its covariance is
that of the increment plus that of a match. What was driven lately says by how much to multiply the
first, apart for translation and for rotation, whether a log states it or it had to be assumed.

Wheels that slip, or people who push the robot, do so for some tenths of a second. After two scans
in a row that odometry cannot have led to, its next increments may be off by as much.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from slam._jit import njit
from slam.arrays import Float
from slam.frames import Odometry
from slam.frontend.heading_bias import HeadingBias
from slam.frontend.odometry_prior import Prediction, predict, squared, turned
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.matcher import Match
from slam.tracker.uncertainty.covariances import inverse_of, plus

SLIP = 12.0  # squared innovation of three numbers that noise exceeds in 0.7 %; set by hand
SLIP_S = 0.2  # s that a slip lasts in the mean; set by hand: station, 0.6 rad in 0.6 s
SLIP_STEP_S = 0.15  # s, longest step: slower scans see no slip twice


class Innovation(NamedTuple):
    """What the correction of a matched pose says about the covariance that was stated.

    nis      normalised square
    place    m^2 of the position; ``heading`` rad^2
    match_m2, match_rad2  variances of the match itself
    """

    nis: float
    place: float
    heading: float
    match_m2: float
    match_rad2: float


@njit
def innovation(
    stated: Float, prior: Float, data: Float, off: Float, share: float, across: tuple[float, float]
) -> Innovation:
    """Of the correction ``off`` of a pose matched with ``prior``.

    ``data`` is the information with which the match corrected, ``share`` how much of the variance
    that claims it really has. The innovation e is what a match alone would have said: off = K e, so
    e = off + R inv(P) off. Of the position only along the unit vector ``across``, unless that is
    zero.
    """
    precision = inverse_of(prior)
    R = inverse_of(plus(data, 1e-3, precision))
    pulled, e = np.zeros(3), np.zeros(3)
    for i in range(3):
        for k in range(3):
            pulled[i] += precision[i, k] * off[k]
    for i in range(3):
        e[i] = off[i]
        for k in range(3):
            e[i] += R[i, k] * pulled[k]
    S = inverse_of(plus(stated, share, R))
    nis = 0.0
    for i in range(3):
        for k in range(3):
            nis += e[i] * S[i, k] * e[k]
    x, y = across
    place, variance = e[0] * e[0] + e[1] * e[1], R[0, 0] + R[1, 1]
    if x != 0.0 or y != 0.0:
        place = (x * e[0] + y * e[1]) ** 2
        variance = x * x * R[0, 0] + 2.0 * x * y * R[0, 1] + y * y * R[1, 1]
    return Innovation(nis, place, e[2] * e[2], share * variance, share * R[2, 2])


def _variances(covariance: Float, across: tuple[float, float]) -> tuple[float, float]:
    """Of position, along a unit vector or both ways where that is zero, and of heading."""
    (a, b, _), (_, d, _), (_, _, heading) = covariance.tolist()
    x, y = across
    return (x * x * a + 2.0 * x * y * b + y * y * d if x or y else a + d), heading


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
        stated = prediction.covariance + prediction.carried
        found = innovation(stated, prediction.prior, data, off, share, across)
        self.nis = found.nis
        step_m2, step_rad2 = _variances(turned(prediction.unscaled, start), across)
        carried_m2, carried_rad2 = _variances(prediction.carried, across)
        floor_m2, floor_rad2 = prediction.floor
        floors_m2 = floor_m2 * (2.0 if along_rad is None else 1.0)
        config = self._config
        frames = max(config.memory, config.memory_s / max(prediction.elapsed, 1e-3))
        keep = math.exp(-1.0 / frames)
        scales: list[float] = self.scales.tolist()
        for k, squared_off, unit, rest in (
            (0, found.place, step_m2, floors_m2 + carried_m2 + found.match_m2),
            (1, found.heading, step_rad2, floor_rad2 + carried_rad2 + found.match_rad2),
        ):
            expected = scales[k] * unit + rest
            square = min(squared_off, config.wild * expected)
            # Least squares of square = scale * unit + rest, weighed by what scatter to expect.
            weight = unit / expected**2
            self._squares[k] = keep * self._squares[k] + weight * (square - rest)
            self._expected[k] = keep * self._expected[k] + weight * unit
            scale = self._squares[k] / max(self._expected[k], 1e-9)
            self.scales[k] = min(max(scale, self._least), config.most)
        if self.bias is not None and self._stated:
            # an assumed variance says nothing of what is bias and what is chance
            variances = float(prediction.covariance[2, 2]), float(prediction.prior[2, 2])
            heading = match.matched, float(off[2]), data
            self.bias.learn(prediction.increment, prediction.elapsed, variances, heading)
