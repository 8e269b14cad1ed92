# SPDX-License-Identifier: Apache-2.0
"""What can be set of the EKF, and its presets for corners and for Victoria Park."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from slam.landmarks.hypotheses import Gates
from slam.settings import Settings, number

SEEDS = "training seeds 0-19 (docs/paper/method.md)"
SENSOR = "as PointWorldConfig, the world of section 4.2"
MOST_GATE = 1.0 - 1e-12


@dataclass(frozen=True, kw_only=True)
class EkfConfig(Settings):
    """Everything that can be set.

    The gates are wide: the first pairs carry the whole error of the odometry, and a step beyond the
    gate, one of a thousand at 0.999, would be a step without landmarks.
    """

    presets: ClassVar[tuple[str, ...]] = ("points", "corners", "victoria_park")
    constants: ClassVar[Mapping[str, str]] = {
        "lifecycle": "slam.ekf.slam",
        "extractor": "slam.frontend.corners",
    }

    individual_gate: float = number(
        0.999999, "prob", "of chi-square, a pair alone, 2 dof", SEEDS, low=0.5, high=MOST_GATE
    )
    joint_gate: float = number(
        0.999999, "prob", "the same of k pairs together, 2 k dof", SEEDS, low=0.5, high=MOST_GATE
    )
    posterior_gate: float = number(
        0.99999, "prob", "the same of a pair given those before it", SEEDS,
        low=0.5, high=MOST_GATE,
    )  # fmt: skip
    noise_scale: float = number(
        1.25, "ratio", "on the deviations of features: linearisation, which a 1 mm sensor after "
        "steps of 0.1 m and 0.03 rad needs", SEEDS, low=1e-3, high=1e3,
    )  # fmt: skip
    range_m: float = number(
        12.0,
        "m",
        "range of the sensor of features; farther ones are not used",
        SENSOR,
        low=0.1,
        high=1e4,
    )
    fov_deg: float = number(
        180.0, "deg", "field of view of the sensor of features", SENSOR, low=1.0, high=360.0
    )
    occluder_m: float = number(0.0, "m", "half width of what hides a landmark", high=100.0)
    confirm_looks: int = number(
        2, "looks", "that make an object a landmark; the paper: re-observed once", SEEDS,
        low=1, high=100,
    )  # fmt: skip
    detection: float = number(
        0.9, "prob", "that a landmark in view is seen", SEEDS, low=0.2, high=0.999
    )
    memory_looks: float = number(
        4.0, "looks", "more of them prove nothing: how long a landmark outlives its disappearance",
        SEEDS, low=1.0, high=1e4,
    )  # fmt: skip
    separation_m: float = number(
        0.0, "m", "no new object nearer than this to a known one", SEEDS, high=100.0
    )

    @property
    def gates(self) -> Gates:
        """The three together."""
        return Gates(
            individual=self.individual_gate, joint=self.joint_gate, posterior=self.posterior_gate
        )

    @classmethod
    def points(cls, **changes: Any) -> "EkfConfig":
        """Point features as a sensor gives them: the defaults."""
        return cls(**changes)

    @classmethod
    def corners(cls, **changes: Any) -> "EkfConfig":
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
    def victoria_park(cls, **changes: Any) -> "EkfConfig":
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
