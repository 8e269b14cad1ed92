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

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.core import state
from sim.sensors.odometry.config import PRESETS, OdometryConfig, preset
from sim.sensors.odometry.motion import COUNTED, NOW, over_scan, update
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, Odometry
from slam.shaped import instance

__all__ = ["PRESETS", "OdometryConfig", "WheelOdometry", "preset"]


class WheelOdometry:
    """Dead reckoning of one run.

    config  ``OdometryConfig`` or the name of a preset
    rng     drawn from three times at birth, five times at each ``update``, ten at each scan
    track   m between the true wheels

    Attribute ``errors``: Es, Eb, Ed of this run (truth, not for a robot to know).
    """

    def __init__(
        self,
        config: OdometryConfig | str = "pioneer3dx",
        rng: np.random.Generator | None = None,
        *,
        track: float = 0.33,
    ) -> None:
        self.config = preset(config) if isinstance(config, str) else config
        instance("odometry", self.config, OdometryConfig)
        if not 0.0 < track < math.inf:
            raise InvalidValueError(f"WheelOdometry.track must be > 0 m, got {track}")
        self._rng = np.random.default_rng(0) if rng is None else rng
        c = self.config
        self._systematic_variances = (c.scale_std**2, c.track_std**2, c.diameter_ratio_std**2)
        drawn = self._rng.standard_normal(3).tolist()
        self.errors = (
            1.0 + c.scale_std * drawn[0],
            1.0 + c.track_std * drawn[1],
            1.0 + c.diameter_ratio_std * drawn[2],
        )
        scale, _, ratio = self.errors
        # What a true metre of each rim is reported as: the parameter file has one mean diameter.
        gain = ((ratio + 1.0) / (2.0 * scale), (ratio + 1.0) / (2.0 * ratio * scale))
        squares = (
            c.trans_std_per_m, c.trans_std_per_rad, c.rot_std_per_m, c.rot_std_per_rad,
            c.side_std_per_m,
        )  # fmt: skip
        slips = (c.slip_per_m, c.slip_per_contact_m)
        own = (c.ticks_per_m, track, track / self.errors[1], *gain)
        self._parameters = np.array([*(std**2 for std in squares), *slips, *own])
        self._wheels: Float = np.zeros((3, 3))
        self._poses: Float = np.zeros((3, 3))
        self._spread: Float = np.zeros((3, 3, 3))

    @property
    def pose(self) -> Float:
        """(3,) ``T_odom_robot``, not wrapped."""
        now: Float = self._poses[NOW].copy()
        return now

    @property
    def systematic_std(self) -> tuple[float, float, float]:
        """Deviations of Es - 1, Eb - 1, Ed - 1 over the ensemble of runs."""
        c = self.config
        return c.scale_std, c.track_std, c.diameter_ratio_std

    @property
    def ticks(self) -> NDArray[np.int64]:
        """(2,) encoder counts; without quantisation those of 100 ticks per mm."""
        per_m = self.config.ticks_per_m or 100_000.0
        counted = self._wheels[COUNTED, :2].tolist()
        return np.array([math.floor(m * per_m + 0.5) for m in counted], dtype=np.int64)

    def update(self, travel: Sequence[float] | Float, *, contact: bool = False) -> None:
        """Advance to the true rim travel (left m, right m; sideways m) since the start of the run.

        ``contact``: the robot touched something on the way, which makes slip likelier.
        """
        left, right, *side = (float(rim) for rim in travel)
        update(
            (left, right, side[0] if side else 0.0), contact, self._parameters,
            self._rng.standard_normal(3), self._rng.random(2),
            self._wheels, self._poses, self._spread,
        )  # fmt: skip

    def save(self) -> tuple[dict[str, Float], dict[str, Any]]:
        """Everything that decides what comes next: arrays, and the words of the generator."""
        arrays = {name: live.copy() for name, live in self._live().items()}
        return arrays, {"errors": list(self.errors), "random": state.random_words(self._rng)}

    def load(self, arrays: Mapping[str, Float], words: Mapping[str, Any]) -> None:
        """Go on from ``save``; ``InvalidValueError`` if it is of a run with other errors."""
        if list(self.errors) != words["errors"]:
            raise InvalidValueError("the state is of a run whose odometry errs otherwise")
        state.restore_random(self._rng, words["random"])
        for name, live in self._live().items():
            live[...] = arrays[name]

    def _live(self) -> dict[str, Float]:
        return {"wheels": self._wheels, "poses": self._poses, "spread": self._spread}

    def over_scan(self, travel: Float, first: float, last: float, *, contact: bool) -> None:
        """Advance to the first beam of a scan, which closes the motion increment, and to the last.

        travel       (steps + 1, 3) true rim travel m at the physics steps of the scan
        first, last  when its first and last beam are, in steps
        """
        rng = self._rng
        draws = (
            rng.standard_normal(3), rng.random(2), rng.standard_normal(3), rng.random(2),
        )  # fmt: skip
        over_scan(
            travel, (first, last), contact, self._parameters, draws, self._systematic_variances,
            self._wheels, self._poses, self._spread,
        )  # fmt: skip

    def reading(self, *, stamp_ns: int, sweep_s: float) -> Odometry:
        """For the frame of the scan that has just ended, ``sweep_s`` after its stamp.

        Pose and covariance are those of the stamp, the twist is the mean over the sweep.
        """
        if not sweep_s > 0.0:
            raise InvalidValueError(f"sweep_s must be > 0 s, got {sweep_s}")
        now, at_stamp, _ = self._poses
        x, y, theta = at_stamp.tolist()
        return Odometry(
            stamp_ns=stamp_ns,
            T_odom_robot=np.array([x, y, se2.wrap(theta)]),
            increment_covariance=self._spread[2],
            twist=se2.log(se2.between(at_stamp, now)) / sweep_s,
        )
