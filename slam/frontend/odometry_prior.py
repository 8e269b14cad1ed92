# SPDX-License-Identifier: Apache-2.0
"""Where the robot should be by its odometry, and how sure of that one may be."""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from slam import se2
from slam._jit import inner, uncounted
from slam.arrays import Float
from slam.errors import InvalidValueError
from slam.frames import MOST_TWIST, Odometry
from slam.frontend.heading_bias import HeadingBias
from slam.frontend.motions import chained

# From frame to frame.
MOST_STEP_M = 1000.0  # between two frames: farther, the stream is broken or of another run
MOST_POSE = 1e9  # m and rad from the origin: there a double still resolves 0.1 micrometres
MOST_STD = 1e4  # m and rad, of an increment; with more, rounding would eat what is known beside
HUGE = 1.0  # m^2 or rad^2: from there on,
MOST_CORRELATION = 1.0 - 1e-6  # exact correlations would leave nothing of what is known beside
LEAST_SHARE = 1e-12  # of the larger variance of position that the smaller one must have
# The prior; set by hand.
FLOOR_M, FLOOR_RAD = 0.002, 0.0015  # least deviation after FLOOR_S; grows with the root of time
FLOOR_S, FLOOR_MOST_S = 0.2, 1.0  # s; the floors grow no further than over the latter
LEAST_SCALE = 2.25  # least factor on a stated variance: else the map drifts unnoticed
LEAST_M, LEAST_RAD = 0.004, 0.003  # least deviation for the matcher, after FLOOR_S
# deviations where none is stated: m/m, m/rad, rad/sqrt(m), rad/rad
ASSUMED_SHARE, ASSUMED_TURN_M, ASSUMED_RAD_PER_SQRT_M, ASSUMED_TURN = 0.10, 0.10, 0.08, 0.15
LEAST_VARIANCE = 1e-12  # m^2 and rad^2, added so that none is zero: (1 um)^2, (1 urad)^2
TWIST_S = 0.5  # s, longest odometry step that gives a twist


Pair = tuple[float, float]
NO_SLIP: Float = np.zeros((3, 3))
# Guard against rounding: least variance of a matrix left singular, m^2 and rad^2: (1 um, 1 urad)^2
SINGULAR = 1e-12


def rotated(c: float, s: float, xx: float, xy: float, yy: float) -> tuple[float, float, float]:
    """A covariance [[xx, xy], [xy, yy]] turned by the angle of cosine c and sine s, like that."""
    return (
        c * c * xx - 2.0 * c * s * xy + s * s * yy,
        c * s * (xx - yy) + (c * c - s * s) * xy,
        s * s * xx + 2.0 * c * s * xy + c * c * yy,
    )


rotate = inner(rotated)  # in kernels


@inner
def turn(covariance: Float, theta: float, out: Float) -> None:
    """As ``turned``, into ``out``."""
    c, s = math.cos(theta), math.sin(theta)
    a, b, d = rotate(c, s, covariance[0, 0], covariance[0, 1], covariance[1, 1])
    xt, yt = covariance[0, 2], covariance[1, 2]
    out[0, 0], out[1, 1], out[2, 2] = a, d, covariance[2, 2]
    out[0, 1] = out[1, 0] = b
    out[0, 2] = out[2, 0] = c * xt - s * yt
    out[1, 2] = out[2, 1] = s * xt + c * yt


@uncounted
def _turned(covariance: Float, theta: float, out: Float) -> None:
    turn(covariance, theta, out)


def turned(covariance: Float, theta: float) -> Float:
    """A (3, 3) covariance of a motion in axes turned by -theta; products in a fixed order."""
    out = np.empty((3, 3))
    _turned(np.ascontiguousarray(covariance), theta, out)
    return out


@uncounted
def upper_inverted(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[float, float, float, float, float, float]:
    """``inverted`` of [[a, b, c], [b, d, e], [c, e, f]]: the same six of it."""
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * aa + b * ab + c * ac
    if det <= 0.0:
        x, y, t = 1.0 / max(a, SINGULAR), 1.0 / max(d, SINGULAR), 1.0 / max(f, SINGULAR)
        return x, 0.0, 0.0, y, 0.0, t
    return aa / det, ab / det, ac / det, bb / det, bc / det, cc / det


@inner
def inverse(m: Float, out: Float) -> None:
    """As ``inverted``, into ``out``."""
    six = upper_inverted(m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2])
    out[0, 0], out[0, 1], out[0, 2] = six[0], six[1], six[2]
    out[1, 0], out[1, 1], out[1, 2] = six[1], six[3], six[4]
    out[2, 0], out[2, 1], out[2, 2] = six[2], six[4], six[5]


@uncounted
def _squared(off: Float, covariance: Float, room: Float) -> float:
    inverse(covariance, room)
    x, y, t = off[0], off[1], off[2]
    a, b, c = room[0, 0], room[0, 1], room[0, 2]
    d, e, f = room[1, 1], room[1, 2], room[2, 2]
    return float(x * (a * x + 2.0 * (b * y + c * t)) + y * (d * y + 2.0 * e * t) + f * t * t)


@uncounted
def _inverted(matrix: Float, out: Float) -> None:
    inverse(matrix, out)


def inverted(matrix: Float) -> Float:
    """Inverse of a symmetric positive definite (3, 3) matrix, in a fixed order of operations.

    One that rounding has left singular is taken without its correlations.
    """
    out = np.empty((3, 3))
    _inverted(np.ascontiguousarray(matrix), out)
    return out


def squared(off: Float, covariance: Float) -> float:
    """``off`` (3,) in deviations, squared: off' inv(covariance) off in a fixed order."""
    return _squared(off, np.ascontiguousarray(covariance), np.empty((3, 3)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Prior of one frame.

    T_map_robot  (3,) predicted pose
    increment    (3,) T_before_now by odometry
    covariance   (3, 3) of the increment, in the map frame, scaled and floored
    twist        (3,) body velocity for de-skewing
    elapsed      s since the previous frame
    own          s since the frame's scanner looked before, where the robot has several; else None
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
    own: float | None = None

    @property
    def look(self) -> float:
        """s that the map sees this scan for."""
        return self.elapsed if self.own is None else self.own

    def changed(self, **fields: Any) -> "Prediction":
        """``replace`` at a fifth of its time."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__, **fields)
        other.__dict__.pop("prior", None)  # kept of the one before
        return other

    @property
    def step(self) -> Float:
        """(3, 3) of the increment, as the matcher takes it."""
        return self.covariance + self.loosened

    @cached_property
    def prior(self) -> Float:
        """(3, 3) of the pose, as the matcher takes it."""
        return self.covariance + self.loosened + self.carried

    def off(self, T_map_robot: Float) -> Float:
        """(3,) by how far a pose corrects the predicted one."""
        off = T_map_robot - self.T_map_robot
        off[2] = se2.wrap(float(off[2]))
        return off


def known(covariance: Float, most_m: float = MOST_STD, most_rad: float = MOST_STD) -> Float:
    """A copy of an increment's covariance (3, 3) with standard deviations lowered to at most
    these, the correlations kept: beyond, they mean "not known"."""
    out = np.array(covariance, dtype=np.float64, order="C")
    most = zip(out.diagonal().tolist(), (most_m, most_m, most_rad), strict=True)
    scale = [min(1.0, limit / math.sqrt(v)) if v > 0.0 else 1.0 for v, limit in most]
    if min(scale) < 1.0:
        out *= np.outer(scale, scale)
    return out


def invertible(covariance: Float) -> Float:
    """``known``, and such that its inverse can be computed: the very numbers, unless a variance is
    ``HUGE``."""
    (xx, _, _), (_, yy, _), (_, _, tt) = covariance.tolist()
    if max(xx, yy, tt) <= HUGE:
        return np.array(covariance, dtype=np.float64, order="C")
    out = known(covariance)
    xx, yy, tt = out.diagonal().tolist()
    if max(xx, yy, tt) > HUGE:
        out *= MOST_CORRELATION
        least = LEAST_SHARE * max(xx, yy)
        np.fill_diagonal(out, [max(xx, least), max(yy, least), max(tt, 0.0)])
    return out


def check_step(before: Odometry, now: Odometry) -> None:
    """Raise ``InvalidValueError`` for a step that no robot makes."""
    x, y, turn = before.T_odom_robot.tolist()
    x_now, y_now, turn_now = now.T_odom_robot.tolist()
    distance = math.hypot(x_now - x, y_now - y)
    if not distance <= MOST_STEP_M:
        raise InvalidValueError(
            f"Odometry.T_odom_robot must move by at most {MOST_STEP_M:g} m from frame to frame, "
            f"got {distance:g} m from {before.stamp_ns} ns to {now.stamp_ns} ns"
        )
    for stamp_ns, farthest in (
        (before.stamp_ns, max(abs(x), abs(y), abs(turn))),
        (now.stamp_ns, max(abs(x_now), abs(y_now), abs(turn_now))),
    ):
        if farthest > MOST_POSE:
            raise InvalidValueError(
                f"Odometry.T_odom_robot must lie within {MOST_POSE:g} m and rad, got {farthest:g} "
                f"at {stamp_ns} ns"
            )


def motion(before: Odometry, now: Odometry) -> Float:
    """(3,) ``T_before_now``. Raises ``InvalidValueError`` for a step that no robot makes."""
    check_step(before, now)
    return se2.between(before.T_odom_robot, now.T_odom_robot)


def assumed_covariance(increment: Float) -> Float:
    """Covariance (3, 3) of an increment whose log says nothing, in the previous robot frame."""
    distance = math.hypot(float(increment[0]), float(increment[1]))
    turn = abs(float(increment[2]))
    sd_xy = ASSUMED_SHARE * distance + ASSUMED_TURN_M * turn
    sd_theta = ASSUMED_RAD_PER_SQRT_M * math.sqrt(distance) + ASSUMED_TURN * turn
    return np.diag([sd_xy**2, sd_xy**2, sd_theta**2])


@inner
def _widen(covariance: Float, widths: Pair, floor: Pair, out: Float) -> None:
    """Standard deviations of position and heading times ``widths``, variances plus ``floor``."""
    a, b = widths
    for i in range(2):
        for j in range(2):
            out[i, j] = covariance[i, j] * a * a
        out[i, i] += floor[0]
        out[i, 2] = covariance[i, 2] * a * b
    out[2, 2] = covariance[2, 2] * b * b + floor[1]


@uncounted
def _scaled(  # noqa: PLR0913 (kernel)
    unscaled: Float,
    theta: float,
    widths: Pair,
    floor: Pair,
    more: Pair,
    rest: Pair,
    slip: Float,
    room: Float,
    covariance: Float,
    loosened: Float,
) -> None:
    """``unscaled`` gets ``LEAST_VARIANCE``; ``covariance``: of it with ``widths`` and ``floor`` in
    axes turned by -theta, plus ``slip``; ``loosened``: of it with ``more`` and ``rest`` there."""
    for i in range(3):
        unscaled[i, i] += LEAST_VARIANCE
    _widen(unscaled, widths, floor, room)
    turn(room, theta, covariance)
    for i in range(3):
        for j in range(3):
            covariance[i, j] += slip[i, j]
    _widen(unscaled, more, rest, room)
    turn(room, theta, loosened)


def predict(
    T_map_before: Float,
    before: Odometry,
    now: Odometry,
    scales: Pair = (1.0, 1.0),
    bias: HeadingBias | None = None,
    slip: Float = NO_SLIP,
) -> Prediction:
    """Chain the odometry increment on the last pose; covariance from the frame's own.

    ``scales`` multiply its variance of translation and of rotation; ``bias`` is taken out of the
    increment. With wheels that slip the increment may be off by ``slip`` (3, 3) more.
    """
    check_step(before, now)
    increment, T_map_robot = np.empty(3), np.empty(3)
    biases = (0.0, 0.0) if bias is None else (bias.per_m, bias.per_rad)
    # numbers, not arrays: those of frames are read-only, but for copies, which would compile anew
    (x, y, turn), (x_now, y_now, turn_now) = (end.T_odom_robot.tolist() for end in (before, now))
    ends = (x, y, turn), (x_now, y_now, turn_now)
    chained(*ends, T_map_before, biases, increment, T_map_robot)
    elapsed = (now.stamp_ns - before.stamp_ns) * 1e-9
    given, (along, turning) = now.increment_covariance, scales
    unscaled = assumed_covariance(increment) if given is None else invertible(given)
    share = min(max(elapsed, 1e-3), FLOOR_MOST_S) / FLOOR_S
    floor = share * FLOOR_M**2, share * FLOOR_RAD**2
    more = rest = 0.0, 0.0
    if given is not None:
        more = (
            math.sqrt(max(LEAST_SCALE - along, 0.0)),
            math.sqrt(max(LEAST_SCALE - turning, 0.0)),
        )
        rest = share * LEAST_M**2 - floor[0], share * LEAST_RAD**2 - floor[1]
    covariance, loosened = np.empty((3, 3)), np.empty((3, 3))
    _scaled(
        unscaled, float(T_map_before[2]), (math.sqrt(along), math.sqrt(turning)), floor, more, rest,
        slip, np.empty((3, 3)), covariance, loosened,
    )  # fmt: skip
    return Prediction(
        T_map_robot=T_map_robot,
        increment=increment,
        covariance=covariance,
        unscaled=unscaled,
        loosened=loosened,
        floor=floor,
        twist=_twist(now, increment, elapsed),
        elapsed=elapsed,
    )


def _twist(now: Odometry, increment: Float, elapsed: float) -> Float:
    """(3,) body velocity over the sweep: measured, else that of the increment, else none."""
    if now.twist is not None:
        return np.asarray(now.twist)
    if 0.0 < elapsed < TWIST_S and float(np.abs(increment).max()) <= MOST_TWIST * elapsed:
        return se2.log(increment) / elapsed
    return np.zeros(3)
