# SPDX-License-Identifier: Apache-2.0
"""The SICK LMS-221: mirror turns, interlacing, range codes, and which of its ways are simulated.

Numbers are from the manufacturer's technical description (TD, 8008970/06-2003) and telegram
listing (TL, 8007954/2006-08-01); what goes beyond them is marked inferred, as in the design note
(fidelity, 1.3 to 1.6). What the receiver makes of them is in ``sim.sensors.lidar.signal``.

The mirror turns 75 times a second, counter-clockwise seen from above; the 180 degree field of view
is its first half turn. Each turn measures in 1 degree steps; 0.5 and 0.25 degree scans are two and
four turns, each started 0.5 or 0.25 degree later, and sorted by angle on output (TL p19, p47). So
neighbouring beams of such a scan are one mirror turn apart in time: what a moving robot sees is
combed, and so it is here. A turn lasts 13.33 ms; the data sheet prints 13.32.
"""

from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType

from sim.sensors.lidar.registry import register
from sim.sensors.lidar.scanner import ERRORS, Band, Scanner, Spot, disc
from slam.errors import InvalidValueError
from slam.frames import Float, LaserSpec
from slam.shaped import Share, check, one_of

TURNS_PER_S = 75
MIRROR_FROM_DEG = -90.0  # where a turn of the mirror begins, whatever the field of view
TIMER_UNIT = 0.010  # m, resolution of the time measurement in every range mode (TD p34, TL 10-10)

NOISE_M = 0.010  # m, one sigma of what is sent, 1 to 20 m (TD p34)
PULSE_M = 1.0  # m, length of a pulse (TL p110)
LMS221_SPOT = disc(aperture=0.008, divergence=0.00595)  # 16 mm + 11.9 mrad, TL p114

# Needed reflectivity for a return against range, clean window (TD fig. 4-2, digitised).
NEEDED = (
    (0.2, 0.47), (0.3, 0.20), (0.5, 0.12), (1.0, 0.046), (1.5, 0.030), (2.0, 0.022), (5.0, 0.016),
    (10.0, 0.022), (15.0, 0.035), (20.0, 0.054), (30.0, 0.107), (40.0, 0.185), (60.0, 0.42),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class RangeEffects:
    """What of the real device's ways is simulated; ``RangeEffects.none()`` is a ruler.

    spot          a disc of seven rays, first pulse wins (TL p19, p114); off: one ideal ray
    reflectivity  dark things far away, or close by, give no return (TD fig. 4-2)
    incidence     oblique surfaces return less (cosine; inferred)
    mixed_pixels  at edges the value may lie between the two surfaces (TL p110)
    glass         panes let the beam through, except near their normal (inferred)
    bounce        panes and polished faces also show what they mirror (inferred)
    systematic    error function of the unit and run: 35 mm in mm mode, 5 cm in cm mode (TD p34)
    timer         time is counted in 10 mm before corrections and rounding (TL p113; inferred)
    error_codes   no return is an error code, NaN, as the ROS driver has it; off: inf, free space
    dropout_rate  share of values lost to dazzle and the like (NaN); no source gives one
    """

    spot: bool = True
    reflectivity: bool = True
    incidence: bool = True
    mixed_pixels: bool = True
    glass: bool = True
    bounce: bool = True
    systematic: bool = True
    timer: bool = True
    error_codes: bool = True
    dropout_rate: Share = 0.0

    def __post_init__(self) -> None:
        check(self)

    @classmethod
    def none(cls) -> "RangeEffects":
        """All off."""
        return cls(**{f.name: False for f in fields(cls) if f.name != "dropout_rate"})


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
    noise_std_m: Share = NOISE_M
    quantise: bool = True
    effects: RangeEffects = field(default_factory=RangeEffects)

    def __post_init__(self) -> None:
        check(self)
        if self.resolution_deg not in SCAN_MODES:
            raise InvalidValueError(
                f"Lms221Config.resolution_deg must be 1, 0.5 or 0.25, got {self.resolution_deg}"
            )
        if self.fov_deg not in (100, 180):
            raise InvalidValueError(f"Lms221Config.fov_deg must be 100 or 180, got {self.fov_deg}")
        one_of("Lms221Config.range_mode", self.range_mode, tuple(RANGE_MODES))

    @classmethod
    def ideal(
        cls, *, resolution_deg: float = 0.5, fov_deg: int = 180, range_mode: str = "80m"
    ) -> "Lms221Config":
        """Geometry and timing of the device, exact ranges; inf where there is nothing."""
        own = cls(resolution_deg=resolution_deg, fov_deg=fov_deg, range_mode=range_mode)
        return own.only("ideal")

    @classmethod
    def noise_only(
        cls, *, resolution_deg: float = 0.5, fov_deg: int = 180, range_mode: str = "80m"
    ) -> "Lms221Config":
        """The 10 mm statistical error and the rounding to codes, no other effect."""
        own = cls(resolution_deg=resolution_deg, fov_deg=fov_deg, range_mode=range_mode)
        return own.only("noise")

    @property
    def turns(self) -> int:
        """Mirror turns per scan."""
        return SCAN_MODES[self.resolution_deg]

    @property
    def rate_hz(self) -> float:
        """Scans per second."""
        return TURNS_PER_S / self.turns

    @property
    def mode(self) -> RangeMode:
        """The range mode's unit and limits."""
        return RANGE_MODES[self.range_mode]

    @property
    def systematic_bound_m(self) -> float:
        """TD p34: 35 mm in millimetre mode, 5 cm in centimetre mode, typical, 1..20 m."""
        return 0.035 if self.mode.unit_m < 0.005 else 0.05

    @property
    def stamp_offset_ns(self) -> int:
        """From the start of the scan to its earliest beam, ns."""
        return self.scanner().stamp_offset_ns

    def spec(self, T_robot_laser: Float | None = None) -> LaserSpec:
        """Geometry and exact beam times: the beam at angle a in turn k is k/75 + (a/360)/75 s."""
        return self.scanner().spec(T_robot_laser)

    def scanner(self) -> Scanner:
        """The model of a scanner that is set so."""
        on, far = self.effects, self.mode.range_max_m
        return Scanner(
            name="lms221",
            first_deg=-self.fov_deg / 2,
            step_deg=self.resolution_deg,
            n_beams=round(self.fov_deg / self.resolution_deg) + 1,
            rate_hz=self.rate_hz,
            turns=self.turns,
            turn_from_deg=MIRROR_FROM_DEG,
            range_max_m=far,
            unit_m=self.mode.unit_m if self.quantise else 0.0,
            noise=(Band(up_to_m=far, error_m=self.noise_std_m),) if self.noise_std_m > 0.0 else (),
            systematic=(
                (Band(up_to_m=far, error_m=self.systematic_bound_m),) if on.systematic else ()
            ),
            counter_m=TIMER_UNIT if on.timer else 0.0,
            spot=LMS221_SPOT if on.spot else Spot(),
            needed=NEEDED if on.reflectivity else (),
            incidence=on.incidence,
            mixed_pixels=on.mixed_pixels,
            pulse_m=PULSE_M,
            glass=on.glass,
            bounce=on.bounce,
            error_codes=on.error_codes,
            dropout_rate=on.dropout_rate,
        )

    def only(self, errors: str) -> "Lms221Config":
        """With the errors named in ``sim.sensors.lidar.scanner.ERRORS``."""
        one_of("errors", errors, ERRORS)
        bare = replace(self, effects=RangeEffects.none())
        ideal = replace(bare, noise_std_m=0.0, quantise=False)
        return {"full": self, "noise": bare, "ideal": ideal}[errors]


@register("lms221")
def lms221(
    *,
    resolution_deg: float = 0.5,
    fov_deg: int = 180,
    range_mode: str = "80m",
    noise_m: float = NOISE_M,
) -> Lms221Config:
    """SICK LMS-221: 180 degrees, 0.5 degrees interlaced, 37.5 Hz, 80 m; the default.

    noise_m  statistical error of what is sent, one sigma, rounding included: what the data sheet
             states, unless said otherwise. Real logs of its family have less (docs/real_scanner.md)
    """
    return Lms221Config(
        resolution_deg=resolution_deg, fov_deg=fov_deg, range_mode=range_mode, noise_std_m=noise_m
    )
