# SPDX-License-Identifier: Apache-2.0
"""The twelve knobs of the EKF, and its presets for corners and for Victoria Park."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

from slam.errors import InvalidValueError
from slam.landmarks.hypotheses import Gates

Association = Literal["ipjc", "jcbb", "individual"]


@dataclass(frozen=True, kw_only=True)
class EkfConfig:
    """Everything a user may turn.

    association          "ipjc" (incremental posterior joint compatibility), "jcbb", "individual"
    individual_gate      a pair alone must lie within this probability of chi-square, 2 dof
    joint_gate           k pairs together, 2 k dof
    posterior_gate       a pair given the pairs accepted before it, 2 dof; IPJC alone. All three are
                         wide: the first pairs carry the whole error of the odometry, and a step
                         beyond the gate, one of a thousand at 0.999, would be a step without
                         landmarks
    noise_scale          factor on the standard deviations of features: the share of linearisation
                         errors, which a 1 mm sensor after steps of 0.1 m and 0.03 rad needs
    range_m, fov_deg     what the sensor of features sees; features beyond are not used
    occluder_m           half width of the things behind which a landmark is hidden, m
    confirm_looks        observations that make an object a landmark; the paper: re-observed once
    detection            probability that a landmark in view is seen
    memory_looks         after this many looks more of them prove nothing: how long a landmark
                         that was seen for ever outlives its disappearance
    separation_m         no new object nearer than this to one that is known, m
    """

    association: Association = "ipjc"
    individual_gate: float = 0.999999
    joint_gate: float = 0.999999
    posterior_gate: float = 0.99999
    noise_scale: float = 1.25
    range_m: float = 12.0
    fov_deg: float = 180.0
    occluder_m: float = 0.0
    confirm_looks: int = 2
    detection: float = 0.9
    memory_looks: float = 4.0
    separation_m: float = 0.0

    def __post_init__(self) -> None:
        if self.association not in get_args(Association):
            raise InvalidValueError(
                f"EkfConfig.association must be one of {get_args(Association)}, "
                f"got {self.association!r}"
            )
        for name in ("individual_gate", "joint_gate", "posterior_gate"):
            self._number(name, 0.5, 1.0 - 1e-12)
        self._number("noise_scale", 1e-3, 1e3)
        self._number("range_m", 0.1, 1e4)
        self._number("fov_deg", 1.0, 360.0)
        self._number("occluder_m", 0.0, 100.0)
        self._number("detection", 0.2, 0.999)
        self._number("memory_looks", 1.0, 1e4)
        self._number("separation_m", 0.0, 100.0)
        if isinstance(self.confirm_looks, bool) or not isinstance(self.confirm_looks, int):
            raise InvalidValueError(
                f"EkfConfig.confirm_looks must be a whole number, got {self.confirm_looks!r}"
            )
        self._number("confirm_looks", 1, 100)

    def _number(self, name: str, low: float, high: float) -> None:
        value = getattr(self, name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or math.isnan(value):
            raise InvalidValueError(f"EkfConfig.{name} must be a number, got {value!r}")
        if not low <= value <= high:
            raise InvalidValueError(f"EkfConfig.{name} must lie in [{low}, {high}], got {value}")

    @property
    def gates(self) -> Gates:
        """The three together."""
        return Gates(
            individual=self.individual_gate, joint=self.joint_gate, posterior=self.posterior_gate
        )

    @classmethod
    def corners(cls, **changes: Any) -> EkfConfig:
        """Corners of indoor scans: near, some round, some false; what moves does so slowly.

        A false pair costs more here than a true one that is left out: hence the narrow gates, and
        none for linearisation, which is nothing beside centimetres of noise.
        """
        preset: dict[str, Any] = {
            "individual_gate": 0.999,
            "joint_gate": 0.99,
            "posterior_gate": 0.95,
            "noise_scale": 1.0,
            "confirm_looks": 8,
            "detection": 0.8,
            "memory_looks": 4.0,
            "separation_m": 0.15,
        }
        return cls(**(preset | changes))

    @classmethod
    def victoria_park(cls, **changes: Any) -> EkfConfig:
        """Tree trunks at up to 30 m, many of them missed or hidden behind people and cars."""
        preset: dict[str, Any] = {
            "noise_scale": 1.0,
            "range_m": 30.0,
            "occluder_m": 0.5,
            "confirm_looks": 3,
            "detection": 0.5,
            "memory_looks": 15.0,
            "separation_m": 2.0,
        }
        return cls(**(preset | changes))
