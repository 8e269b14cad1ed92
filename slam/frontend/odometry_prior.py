# SPDX-License-Identifier: Apache-2.0
"""Where the robot should be by its odometry, and how sure of that one may be."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from slam import se2
from slam.frames import MOST_TWIST, Float, Odometry
from slam.frontend import odometry_steps
from slam.frontend.config import FRONTEND, PriorConfig
from slam.frontend.odometry_bias import HeadingBias

IDENTITY = np.eye(3)
# Guard against rounding: least variance of a matrix left singular, m^2 and rad^2: (1 um, 1 urad)^2
SINGULAR = 1e-12


def turned(covariance: Float, theta: float) -> Float:
    """A (3, 3) covariance of a motion in axes turned by -theta; products in a fixed order."""
    c, s = math.cos(theta), math.sin(theta)
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = covariance.tolist()
    a = c * c * xx - 2.0 * c * s * xy + s * s * yy
    b = c * s * (xx - yy) + (c * c - s * s) * xy
    d = s * s * xx + 2.0 * c * s * xy + c * c * yy
    e, f = c * xt - s * yt, s * xt + c * yt
    return np.array([[a, b, e], [b, d, f], [e, f, tt]])


def upper_inverted(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[float, float, float, float, float, float]:
    """``inverted`` of [[a, b, c], [b, d, e], [c, e, f]]: the same six of it."""
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * aa + b * ab + c * ac
    if det <= 0.0:
        x, y, t = (1.0 / max(v, SINGULAR) for v in (a, d, f))
        return x, 0.0, 0.0, y, 0.0, t
    return aa / det, ab / det, ac / det, bb / det, bc / det, cc / det


def inverted(matrix: Float) -> Float:
    """Inverse of a symmetric positive definite (3, 3) matrix, in a fixed order of operations.

    One that rounding has left singular is taken without its correlations.
    """
    (a, b, c), (_, d, e), (_, _, f) = matrix.tolist()
    a, b, c, d, e, f = upper_inverted(a, b, c, d, e, f)
    return np.array([[a, b, c], [b, d, e], [c, e, f]])


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Prior of one frame.

    T_map_robot  (3,) predicted pose
    increment    (3,) T_before_now by odometry
    covariance   (3, 3) of the increment, in the map frame, scaled and floored
    twist        (3,) body velocity for de-skewing
    elapsed      s since the previous frame
    unscaled     (3, 3) as stated or assumed, in the previous robot frame; zero: nothing to learn
    floor        m^2 and rad^2 that were added
    loosened     (3, 3) that the matcher's prior of the increment has more than the covariance
    carried      (3, 3) of the pose before, from odometry that no match has confirmed yet; zero
                 where too little is in view: things that move would lead astray
    """

    T_map_robot: Float
    increment: Float
    covariance: Float
    twist: Float
    elapsed: float
    unscaled: Float = field(default_factory=lambda: np.zeros((3, 3)))
    floor: tuple[float, float] = (0.0, 0.0)
    loosened: Float = field(default_factory=lambda: np.zeros((3, 3)))
    carried: Float = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def step(self) -> Float:
        """(3, 3) of the increment, as the matcher takes it."""
        return self.covariance + self.loosened

    @property
    def prior(self) -> Float:
        """(3, 3) of the pose, as the matcher takes it."""
        return self.covariance + self.loosened + self.carried


def assumed_covariance(increment: Float, config: PriorConfig = FRONTEND.prior) -> Float:
    """Covariance (3, 3) of an increment whose log says nothing, in the previous robot frame."""
    distance = math.hypot(float(increment[0]), float(increment[1]))
    turn = abs(float(increment[2]))
    sd_xy = config.assumed_share * distance + config.assumed_turn_m * turn
    sd_theta = config.assumed_rad_per_sqrt_m * math.sqrt(distance) + config.assumed_turn * turn
    return np.diag([sd_xy**2, sd_xy**2, sd_theta**2])


def _widened(covariance: Float, widths: tuple[float, float], floor: tuple[float, float]) -> Float:
    """Standard deviations of position and heading times ``widths``, variances plus ``floor``."""
    (xx, xy, xt), (yx, yy, yt), (tx, ty, tt) = covariance.tolist()
    (a, b), (m2, rad2) = widths, floor
    return np.array(
        [
            [xx * a * a + m2, xy * a * a, xt * a * b],
            [yx * a * a, yy * a * a + m2, yt * a * b],
            [tx * b * a, ty * b * a, tt * b * b + rad2],
        ]
    )


def predict(
    T_map_before: Float,
    before: Odometry,
    now: Odometry,
    scales: tuple[float, float] = (1.0, 1.0),
    bias: HeadingBias | None = None,
    config: PriorConfig = FRONTEND.prior,
) -> Prediction:
    """Chain the odometry increment on the last pose; covariance from the frame's own.

    ``scales`` multiply its variance of translation and of rotation; ``bias`` is taken out of the
    increment.
    """
    increment = odometry_steps.increment(before, now)
    if bias is not None:
        increment = bias.corrected(increment)
    elapsed = (now.stamp_ns - before.stamp_ns) * 1e-9
    given = now.increment_covariance
    if given is None:
        unscaled = assumed_covariance(increment, config)
    else:
        unscaled = odometry_steps.invertible(given)
    unscaled = unscaled + config.least_variance * IDENTITY
    share = min(max(elapsed, 1e-3), config.floor_most_s) / config.floor_s
    floor = share * config.floor_m**2, share * config.floor_rad**2
    widths = math.sqrt(scales[0]), math.sqrt(scales[1])
    in_robot = _widened(unscaled, widths, floor)
    loosened = np.zeros((3, 3))
    if given is not None:
        more = (
            math.sqrt(max(config.least_scale - scales[0], 0.0)),
            math.sqrt(max(config.least_scale - scales[1], 0.0)),
        )
        least = share * config.least_m**2, share * config.least_rad**2
        rest = least[0] - floor[0], least[1] - floor[1]
        loosened = _widened(unscaled, more, rest)
    return Prediction(
        T_map_robot=se2.compose(T_map_before, increment),
        increment=increment,
        covariance=turned(in_robot, float(T_map_before[2])),
        unscaled=unscaled,
        loosened=turned(loosened, float(T_map_before[2])),
        floor=floor,
        twist=_twist(now, increment, elapsed, config),
        elapsed=elapsed,
    )


def _twist(now: Odometry, increment: Float, elapsed: float, config: PriorConfig) -> Float:
    """(3,) body velocity over the sweep: measured, else that of the increment, else none."""
    if now.twist is not None:
        return np.asarray(now.twist)
    if 0.0 < elapsed < config.twist_s and float(np.abs(increment).max()) <= MOST_TWIST * elapsed:
        return se2.log(increment) / elapsed
    return np.zeros(3)
