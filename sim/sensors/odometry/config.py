# SPDX-License-Identifier: Apache-2.0
"""How wrong a robot's wheels are, and named presets with their sources."""

import math
from dataclasses import dataclass
from types import MappingProxyType

from slam.errors import UnknownNameError, meant
from slam.settings import Settings, number


@dataclass(frozen=True, kw_only=True)
class OdometryConfig(Settings):
    """How wrong the wheels are. Deviations are of one run among many, or after one unit of motion.

    Sideways motion is seen by no encoder. A slip turns the heading by 1 to 3 degrees.
    """

    diameter_ratio_std: float = number(0.0, "ratio", "of Ed - 1")
    track_std: float = number(0.0, "ratio", "of Eb - 1")
    scale_std: float = number(0.0, "ratio", "of Es - 1")
    trans_std_per_m: float = number(0.0, "m", "after 1 m")
    trans_std_per_rad: float = number(0.0, "m", "after 1 rad")
    rot_std_per_m: float = number(0.0, "rad", "after 1 m")
    rot_std_per_rad: float = number(0.0, "rad", "after 1 rad")
    side_std_per_m: float = number(0.0, "m", "after 1 m, sideways")
    slip_per_m: float = number(0.0, "1/m", "slips per metre driven")
    slip_per_contact_m: float = number(0.0, "1/m", "the same while touching something", high=1e12)
    ticks_per_m: float = number(0.0, "1/m", "of rim travel; 0: no quantisation", high=1e12)


PRESETS = MappingProxyType(
    {
        # Systematic part: UMBmark's quantities, magnitudes inferred (fidelity note, 2.4). Random
        # part: MRPT's Gaussian odometry model gives 1 % of distance, 1 deg/m, 5 % of rotation for
        # everything together; with the systematic part apart, the lower end of what is believable
        # for an indoor Pioneer (2.2): 1 %, 0.5 deg/m, 2 %. Encoders: 500-tick motor encoders
        # behind a gear, about 100 ticks/mm (2.1).
        "pioneer3dx": OdometryConfig(
            diameter_ratio_std=0.003,
            track_std=0.02,
            scale_std=0.01,
            trans_std_per_m=0.01,
            trans_std_per_rad=0.0057,
            rot_std_per_m=math.radians(0.5),
            rot_std_per_rad=0.02,
            side_std_per_m=0.002,
            slip_per_contact_m=1.0,
            ticks_per_m=100_000.0,
        ),
        # The odometry motion model of Thrun, Burgard and Fox 2005, table 5.6, with the values
        # MRPT ships for it: 0.05 rad/rad, 4 deg/m, 0.01 m/m, 0.0057 m/rad; no systematic part.
        "probabilistic_robotics": OdometryConfig(
            trans_std_per_m=0.01,
            trans_std_per_rad=0.0057,
            rot_std_per_m=math.radians(4.0),
            rot_std_per_rad=0.05,
        ),
        # Encoders without any error: the path the wheels truly rolled.
        "ideal": OdometryConfig(),
    }
)


def preset(name: str) -> OdometryConfig:
    """A named ``OdometryConfig``; raises ``UnknownNameError`` with the near match."""
    if name not in PRESETS:
        raise UnknownNameError(
            f"no odometry preset is called '{name}'.{meant(name, PRESETS)} "
            f"Known: {', '.join(PRESETS)}."
        )
    return PRESETS[name]
