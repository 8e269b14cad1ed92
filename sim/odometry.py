# SPDX-License-Identifier: Apache-2.0
"""Wheel encoders and the dead reckoning on them, with the errors real robots have.

Two kinds of error, kept apart because they behave differently:

- **systematic**, drawn once per run: the robot's true wheels differ from the numbers in its
  parameter file (UMBmark, Borenstein and Feng): Ed, ratio of right to left diameter; Eb, true over
  nominal track; Es, true over reported distance. Drift grows with the distance;
- **random**: what floor, castors and tyres add. Its variance grows with the distance driven and
  the angle turned, so a deviation "per metre" is the one after one metre, whatever the rate.

The covariance of an increment is the exact first-order one over the ensemble of runs: random part
plus systematic part, which accumulates coherently *within* the increment. Across increments the
systematic part is fully correlated, which no independent increment covariance can say: who chains
increments over many metres must add to it (``WheelOdometry.systematic_std`` has the numbers).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import state
from sim.odometry_config import PRESETS, OdometryConfig, preset
from slam import se2
from slam._jit import njit
from slam.errors import InvalidValueError
from slam.frames import Odometry

Float = NDArray[np.float64]

Vec3 = tuple[float, float, float]

__all__ = ["PRESETS", "OdometryConfig", "WheelOdometry", "preset"]

# What tyres creep in one scan while the encoders stand still, and what keeps a covariance
# invertible: (20 um)^2 and (20 urad)^2.
FLOOR = 4e-10
SLIP_MIN, SLIP_MAX = math.radians(1.0), math.radians(3.0)  # fidelity note, 2.4


@njit
def _turned(distance: float, angle: float) -> tuple[float, float, float, float]:
    """(dx, dy) of an arc of that length and angle, and d(dx)/d(angle), d(dy)/d(angle)."""
    if abs(angle) < 1e-4:
        half = 0.5 * angle
        return distance, distance * half, -distance * angle / 3.0, 0.5 * distance
    s, c = math.sin(angle), math.cos(angle)
    dx, dy = distance * s / angle, distance * (1.0 - c) / angle
    return dx, dy, (distance * c - dx) / angle, (distance * s - dy) / angle


@njit
def _chain(pose: Float, bx: float, by: float, angle: float) -> None:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    pose[0] += c * bx - s * by
    pose[1] += s * bx + c * by
    pose[2] += angle


@njit
def _accumulate(
    increment: Float, random: Float, systematic: Float, step: Vec3, variances: Vec3, track: float
) -> None:
    """Chain one small motion and its error onto the increment since the last frame, in place.

    increment   (3,) x, y, theta in the frame of the increment's start
    random      (3, 3) covariance of those three numbers by the random part
    systematic  (3, 3) their derivatives by Es - 1, Eb - 1, Ed - 1
    step        distance m, side m, angle rad; ``variances`` of these three

    First order, as ``se2.propagate``: F P F' + G Q G' with the Jacobians of composition.
    """
    distance, side, angle = step
    bx, by, bx_angle, by_angle = _turned(distance, angle)
    unit_x, unit_y, _, _ = _turned(1.0, angle)
    c, s = math.cos(increment[2]), math.sin(increment[2])
    carry = np.eye(3)
    carry[0, 2] = -s * bx - c * (by + side)
    carry[1, 2] = c * bx - s * (by + side)
    # Columns: what one unit of distance, side, angle does to the increment.
    fresh = np.zeros((3, 3))
    fresh[0, 0], fresh[1, 0] = c * unit_x - s * unit_y, s * unit_x + c * unit_y
    fresh[0, 1], fresh[1, 1] = -s, c
    fresh[0, 2], fresh[1, 2] = c * bx_angle - s * by_angle, s * bx_angle + c * by_angle
    fresh[2, 2] = 1.0
    # Rows distance, side, angle; columns Es, Eb, Ed (first order about 1).
    by_parameter = np.zeros((3, 3))
    by_parameter[0, 0], by_parameter[0, 2] = -distance, -0.25 * track * angle
    by_parameter[2, 0], by_parameter[2, 1], by_parameter[2, 2] = -angle, angle, -distance / track
    old_random, old_systematic = random.copy(), systematic.copy()
    for i in range(3):
        for j in range(3):
            variance, derivative = 0.0, 0.0
            for k in range(3):
                variance += fresh[i, k] * variances[k] * fresh[j, k]
                derivative += fresh[i, k] * by_parameter[k, j] + carry[i, k] * old_systematic[k, j]
                for m in range(3):
                    variance += carry[i, k] * old_random[k, m] * carry[j, m]
            random[i, j] = variance
            systematic[i, j] = derivative
    _chain(increment, bx, by + side, angle)


@njit
def _sandwich(random: Float, systematic: Float, variances: Vec3) -> Float:
    """random + systematic diag(variances) systematic' + floor, exactly symmetric."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(i + 1):
            total = 0.5 * (random[i, j] + random[j, i])
            for k in range(3):
                total += systematic[i, k] * variances[k] * systematic[j, k]
            out[i, j] = out[j, i] = total
        out[i, i] += FLOOR
    return out


@njit
def _step_pose(pose: Float, distance: float, side: float, angle: float) -> None:
    bx, by, _, _ = _turned(distance, angle)
    _chain(pose, bx, by + side, angle)


class WheelOdometry:
    """Dead reckoning of one run.

    config  ``OdometryConfig`` or the name of a preset
    rng     drawn from three times at birth and five times at each ``update``, whatever moves
    track   m between the true wheels
    start   (3,) first pose in the odom frame
    errors  Es, Eb, Ed of a known unit, instead of drawn ones

    Attributes: ``pose`` (3,) ``T_odom_robot``; ``ticks`` (2,) int64 encoder counts, left and right;
    ``errors`` Es, Eb, Ed of this run (truth, not for a robot to know).
    """

    def __init__(
        self,
        config: OdometryConfig | str = "pioneer3dx",
        rng: np.random.Generator | None = None,
        *,
        track: float = 0.33,
        start: ArrayLike = (0.0, 0.0, 0.0),
        errors: tuple[float, float, float] | None = None,
    ) -> None:
        self.config = preset(config) if isinstance(config, str) else config
        if not 0.0 < track < math.inf:
            raise InvalidValueError(f"WheelOdometry.track must be > 0 m, got {track}")
        self._rng = np.random.default_rng(0) if rng is None else rng
        self._track = track
        c = self.config
        self._systematic_variances = (c.scale_std**2, c.track_std**2, c.diameter_ratio_std**2)
        drawn = self._rng.standard_normal(3).tolist()
        self.errors = errors or (
            1.0 + c.scale_std * drawn[0],
            1.0 + c.track_std * drawn[1],
            1.0 + c.diameter_ratio_std * drawn[2],
        )
        scale, _, ratio = self.errors
        # What a true metre of each rim is reported as: the parameter file has one mean diameter.
        self._gain = ((ratio + 1.0) / (2.0 * scale), (ratio + 1.0) / (2.0 * ratio * scale))
        self._reported = [0.0, 0.0]  # m, before ticks
        self._counted = [0.0, 0.0]  # m, after ticks
        self._true = [0.0, 0.0]
        self.pose: Float = np.array(start, dtype=np.float64)
        self._at_stamp = self.pose.copy()
        self._increment, self._random, self._systematic = _blank()
        self._covariance: Float = np.zeros((3, 3))

    @property
    def systematic_std(self) -> tuple[float, float, float]:
        """Deviations of Es - 1, Eb - 1, Ed - 1 over the ensemble of runs."""
        c = self.config
        return c.scale_std, c.track_std, c.diameter_ratio_std

    @property
    def ticks(self) -> NDArray[np.int64]:
        """(2,) encoder counts; without quantisation those of 100 ticks per mm."""
        per_m = self.config.ticks_per_m or 100_000.0
        return np.array([math.floor(m * per_m + 0.5) for m in self._counted], dtype=np.int64)

    def update(self, travel: ArrayLike, *, contact: bool = False) -> None:
        """Advance to the true rim travel (left m, right m) since the start of the run.

        ``contact``: the robot touched something on the way, which makes slip likelier.
        """
        left, right = np.asarray(travel, dtype=np.float64).tolist()
        dl, dr = left - self._true[0], right - self._true[1]
        self._true = [left, right]
        distance, angle = 0.5 * (dl + dr), (dr - dl) / self._track
        variances, noise = self._draw(abs(distance), abs(angle), contact)
        nominal_track = self._track / self.errors[1]
        half = 0.5 * nominal_track * noise[2]
        counted = [
            self._count(0, self._gain[0] * dl + noise[0] - half),
            self._count(1, self._gain[1] * dr + noise[0] + half),
        ]
        cl, cr = counted[0] - self._counted[0], counted[1] - self._counted[1]
        self._counted = counted
        _step_pose(self.pose, 0.5 * (cl + cr), noise[1], (cr - cl) / nominal_track)
        _accumulate(
            self._increment, self._random, self._systematic, (distance, 0.0, angle),
            variances, self._track,
        )  # fmt: skip

    def _count(self, wheel: int, reported: float) -> float:
        """Rim travel m after the encoder, for a further ``reported`` metres."""
        self._reported[wheel] += reported
        per_m = self.config.ticks_per_m
        if per_m == 0.0:
            return self._reported[wheel]
        return math.floor(self._reported[wheel] * per_m + 0.5) / per_m

    def _draw(self, distance: float, angle: float, contact: bool) -> tuple[Vec3, Vec3]:
        """(variances, drawn errors) of distance, side and angle."""
        c = self.config
        trans = c.trans_std_per_m**2 * distance + c.trans_std_per_rad**2 * angle
        rot = c.rot_std_per_m**2 * distance + c.rot_std_per_rad**2 * angle
        side = c.side_std_per_m**2 * distance
        chance = 1.0 - math.exp(
            -(c.slip_per_m + (c.slip_per_contact_m if contact else 0.0)) * distance
        )
        normals, uniforms = self._rng.standard_normal(3).tolist(), self._rng.random(2).tolist()
        size = SLIP_MIN + (SLIP_MAX - SLIP_MIN) * abs(2.0 * uniforms[1] - 1.0)
        slip = math.copysign(size, uniforms[1] - 0.5) if uniforms[0] < chance else 0.0
        mean_square = (SLIP_MIN**2 + SLIP_MIN * SLIP_MAX + SLIP_MAX**2) / 3.0
        noise = (
            math.sqrt(trans) * normals[0],
            math.sqrt(side) * normals[1],
            math.sqrt(rot) * normals[2] + slip,
        )
        rot += chance * mean_square
        # An extra length driven on an extra half turn: the one second-order term that matters,
        # because nothing of first order is sideways but ``side``.
        return (trans, side + 0.25 * trans * rot, rot), noise

    def save(self) -> tuple[dict[str, Float], dict[str, Any]]:
        """Everything that decides what comes next: arrays, and the words of the generator."""
        arrays = {
            "wheels": np.array([self._reported, self._counted, self._true]),
            "poses": np.array([self.pose, self._at_stamp, self._increment]),
            "spread": np.array([self._random, self._systematic, self._covariance]),
        }
        return arrays, {"errors": list(self.errors), "random": state.random_words(self._rng)}

    def load(self, arrays: Mapping[str, Float], words: Mapping[str, Any]) -> None:
        """Go on from ``save``; ``InvalidValueError`` if it is of a run with other errors."""
        if list(self.errors) != words["errors"]:
            raise InvalidValueError("the state is of a run whose odometry errs otherwise")
        state.restore_random(self._rng, words["random"])
        self._reported, self._counted, self._true = arrays["wheels"].tolist()
        self.pose, self._at_stamp, self._increment = (a.copy() for a in arrays["poses"])
        self._random, self._systematic, self._covariance = (a.copy() for a in arrays["spread"])

    def begin_scan(self, travel: ArrayLike, *, contact: bool = False) -> None:
        """Advance to the stamp of a scan (its earliest beam); closes the motion increment."""
        self.update(travel, contact=contact)
        self._at_stamp = self.pose.copy()
        self._covariance = _sandwich(self._random, self._systematic, self._systematic_variances)
        self._increment, self._random, self._systematic = _blank()

    def end_scan(
        self, travel: ArrayLike, *, stamp_ns: int, sweep_s: float, contact: bool = False
    ) -> Odometry:
        """Advance to the last beam, ``sweep_s`` after the stamp; the reading for the frame.

        Pose and covariance are those of the stamp, the twist is the mean over the sweep.
        """
        if not sweep_s > 0.0:
            raise InvalidValueError(f"sweep_s must be > 0 s, got {sweep_s}")
        self.update(travel, contact=contact)
        twist = se2.log(se2.between(self._at_stamp, self.pose)) / sweep_s
        return Odometry(
            stamp_ns=stamp_ns,
            T_odom_robot=np.array([*self._at_stamp[:2], se2.wrap(float(self._at_stamp[2]))]),
            increment_covariance=self._covariance,
            twist=twist,
        )


def _blank() -> tuple[Float, Float, Float]:
    """(increment, random covariance, systematic derivatives) of no motion."""
    return np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
