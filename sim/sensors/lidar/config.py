# SPDX-License-Identifier: Apache-2.0
"""How an LMS-221 is set: resolution, field of view, range mode, and which errors it has.

Numbers are from the manufacturer's technical description (TD, 8008970/06-2003) and telegram
listing (TL, 8007954/2006-08-01).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from sim.core.checks import check_types, instance
from sim.sensors.lidar.effects import RangeEffects
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, LaserSpec

Float = NDArray[np.float64]

TURNS_PER_S = 75
STEPS_PER_TURN = 4
STEPS_PER_SWEEP = 2
DEGREES_PER_STEP = 90.0


@dataclass(frozen=True, kw_only=True)
class RangeMode:
    """One way the device codes distance (TL table 3-7): unit m and largest code that is a range."""

    unit_m: float
    largest_code: int
    range_max_m: float


RANGE_MODES = MappingProxyType(
    {
        "8m": RangeMode(unit_m=0.001, largest_code=8182, range_max_m=8.182),
        "16m": RangeMode(unit_m=0.001, largest_code=16374, range_max_m=16.374),
        "32m": RangeMode(unit_m=0.001, largest_code=32758, range_max_m=32.758),
        "80m": RangeMode(unit_m=0.01, largest_code=8182, range_max_m=80.0),
    }
)

# (resolution, field of view) -> mirror turns (TD p10, TL p19, p48).
SCAN_MODES = MappingProxyType({1.0: 1, 0.5: 2, 0.25: 4})


@dataclass(frozen=True, kw_only=True)
class Lms221Config:
    """How the scanner is set, and how it errs: as the device does, unless told otherwise.

    ``Lms221Config()`` has every effect on, ``Lms221Config.ideal()`` none,
    ``Lms221Config.noise_only()`` the statistical error and the rounding.

    resolution_deg  1, 0.5 or 0.25: 1, 2 or 4 mirror turns per scan (75, 37.5, 18.75 scans/s)
    fov_deg         180, or the middle 100
    range_mode      "8m", "16m", "32m" (1 mm codes) or "80m" (1 cm codes, as delivered, TL 10-12)
    noise_std_m     statistical error of what is sent, rounding included (TD p34: 10 mm, 1..20 m)
    quantise        round to the code of the range mode
    effects         what else of the device's ways is simulated (``RangeEffects``)
    """

    resolution_deg: float = 0.5
    fov_deg: int = 180
    range_mode: str = "80m"
    noise_std_m: float = 0.010
    quantise: bool = True
    effects: RangeEffects = field(default_factory=RangeEffects)

    def __post_init__(self) -> None:
        check_types(self)
        instance("Lms221Config.effects", self.effects, RangeEffects)
        if self.resolution_deg not in SCAN_MODES:
            raise InvalidValueError(
                f"Lms221Config.resolution_deg must be 1, 0.5 or 0.25, got {self.resolution_deg}"
            )
        if self.fov_deg not in (100, 180):
            raise InvalidValueError(f"Lms221Config.fov_deg must be 100 or 180, got {self.fov_deg}")
        if self.range_mode not in RANGE_MODES:
            raise InvalidValueError(
                f"Lms221Config.range_mode must be one of {', '.join(RANGE_MODES)}, "
                f"got {self.range_mode!r}"
            )
        if not 0.0 <= self.noise_std_m <= 1.0:
            raise InvalidValueError(
                f"Lms221Config.noise_std_m must be within 0..1 m, got {self.noise_std_m}"
            )

    @classmethod
    def ideal(
        cls, *, resolution_deg: float = 0.5, fov_deg: int = 180, range_mode: str = "80m"
    ) -> Lms221Config:
        """Geometry and timing of the device, exact ranges; inf where there is nothing."""
        return cls(
            resolution_deg=resolution_deg,
            fov_deg=fov_deg,
            range_mode=range_mode,
            noise_std_m=0.0,
            quantise=False,
            effects=RangeEffects.none(),
        )

    @classmethod
    def noise_only(
        cls, *, resolution_deg: float = 0.5, fov_deg: int = 180, range_mode: str = "80m"
    ) -> Lms221Config:
        """The 10 mm statistical error and the rounding to codes, no other effect."""
        return cls(
            resolution_deg=resolution_deg,
            fov_deg=fov_deg,
            range_mode=range_mode,
            effects=RangeEffects.none(),
        )

    @property
    def turns(self) -> int:
        """Mirror turns per scan."""
        return SCAN_MODES[self.resolution_deg]

    @property
    def steps(self) -> int:
        """Physics steps per scan."""
        return STEPS_PER_TURN * self.turns

    @property
    def sweep_steps(self) -> int:
        """Physics steps from the start of a scan to its last beam."""
        return STEPS_PER_TURN * (self.turns - 1) + STEPS_PER_SWEEP

    @property
    def mode(self) -> RangeMode:
        """The range mode's unit and limits."""
        return RANGE_MODES[self.range_mode]

    @property
    def systematic_bound_m(self) -> float:
        """TD p34: 35 mm in millimetre mode, 5 cm in centimetre mode, typical, 1..20 m."""
        return 0.035 if self.mode.unit_m < 0.005 else 0.05

    @property
    def beams(self) -> tuple[Float, NDArray[np.int64]]:
        """((n,) degrees of the mirror, (n,) turn) of every beam, counter-clockwise."""
        first = (180 - self.fov_deg) // 2
        count = round(self.fov_deg / self.resolution_deg) + 1
        index = np.arange(count, dtype=np.int64)
        degrees = np.asarray(first + index * self.resolution_deg, dtype=np.float64)
        return degrees, index % self.turns

    @property
    def stamp_offset_ns(self) -> int:
        """From the start of the scan's first physics step to its earliest beam, ns."""
        return round(float(self.beams[0][0]) / 360.0 / TURNS_PER_S * NS_PER_S)

    def spec(self, T_robot_laser: Float | None = None) -> LaserSpec:
        """Geometry and exact beam times: the beam at angle a in turn k is k/75 + (a/360)/75 s."""
        degrees, turn = self.beams
        times = (turn + degrees / 360.0) / TURNS_PER_S
        return LaserSpec(
            n_beams=degrees.size,
            angle_min=math.radians(-self.fov_deg / 2),
            angle_increment=math.radians(self.resolution_deg),
            range_min=0.0,
            range_max=self.mode.range_max_m,
            beam_time_offsets=times - times[0],
            T_robot_laser=np.zeros(3) if T_robot_laser is None else T_robot_laser,
        )
