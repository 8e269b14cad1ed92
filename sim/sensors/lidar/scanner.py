# SPDX-License-Identifier: Apache-2.0
"""What a scanner is: its beams, when each is measured, how ranges are coded and how they err.

A model is one ``Scanner``, put together out of parts; a part that is left out is not simulated.
Nothing here knows of the physics: when a beam is measured is a time, not a number of steps.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from sim.sensors.lidar import columns as col
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Float, LaserSpec
from slam.shaped import Share, check, one_of

ERRORS = ("full", "noise", "ideal")  # every error that is known; the statistical one alone; none
RATE_HZ = (1.0, 300.0)  # of scans; a scan lasts a physics step of 1/300 s or longer
MAX_BEAMS = 10_000
MAX_TURNS = 16
MAX_RANGE_M = 1000.0
Metres = Annotated[float, Meta(ge=0.0, le=MAX_RANGE_M)]


@dataclass(frozen=True, kw_only=True)
class Spot:
    """The disc that a beam lights; by default an ideal beam, one ray in the middle.

    aperture    radius at the window, m
    divergence  half angle sideways, rad
    aspect      half angle upwards over that sideways, at most 1
    offsets     (k, 2) places of the k rays on the unit disc (left, up)
    weights     (k,) their shares of the energy
    """

    aperture: Share = 0.0
    divergence: Share = 0.0
    aspect: Share = 1.0
    offsets: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    weights: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        check(self)

    def size_at(self, range_m: float) -> tuple[float, float]:
        """Width and height of the disc, m."""
        wide = self.divergence * range_m
        return 2.0 * (self.aperture + wide), 2.0 * (self.aperture + self.aspect * wide)

    def rays(self) -> Float:
        """(k, 6) in the columns of ``sim.sensors.lidar.columns``."""
        out = np.empty((len(self.offsets), col.N_RAY))
        for k, (u, v) in enumerate(self.offsets):
            left, up = self.divergence * u, self.divergence * self.aspect * v
            length = math.sqrt(1.0 + left * left + up * up)
            out[k, [col.U, col.V, col.RISE]] = u, v, up
            out[k, [col.FORWARD, col.LEFT, col.UP]] = 1.0 / length, left / length, up / length
        return out


# Radon's seven-point rule for a disc: exact for polynomials up to degree 5. Turned so that the
# seven lie at even steps sideways, the way in which chair columns and legs are thin.
_RING, _TURN = math.sqrt(2.0 / 3.0), math.atan(1.0 / (3.0 * math.sqrt(3.0)))
_DISC = (
    (0.0, 0.0),
    *(
        (_RING * math.cos(_TURN + k * math.pi / 3), _RING * math.sin(_TURN + k * math.pi / 3))
        for k in range(6)
    ),
)


def disc(*, aperture: float, divergence: float, aspect: float = 1.0) -> Spot:
    """A spot of seven rays; radius m at the window, half angle rad, and that upwards over it."""
    weights = (0.25, *(0.125,) * 6)
    return Spot(
        aperture=aperture, divergence=divergence, aspect=aspect, offsets=_DISC, weights=weights
    )


@dataclass(frozen=True, kw_only=True)
class Band:
    """An error up to a range; the last band holds beyond.

    up_to_m  range to which the band holds
    error_m  the error, to which ``share`` of the range is added
    share    of the range
    """

    up_to_m: Annotated[float, Meta(ge=1e-3, le=MAX_RANGE_M)]
    error_m: Share
    share: Share = 0.0

    def __post_init__(self) -> None:
        check(self)


SIGMA_AT_M = 5.0  # where a spec states the one sigma of its ranges: across a room


def error_at(bands: Sequence[Band], range_m: float) -> float:
    """m, of the band that holds there; 0 without any."""
    if not bands:
        return 0.0
    band = next((b for b in bands if range_m <= b.up_to_m), bands[-1])
    return band.error_m + band.share * range_m


@dataclass(frozen=True, kw_only=True)
class Scanner:
    """A scanner model. Angles in degrees, counter-clockwise from straight ahead.

    Beams:
    name           in metadata and messages
    first_deg      direction of beam 0, the rightmost
    step_deg       from each beam to the next
    n_beams        number of beams
    rate_hz        scans per second
    turns          of the mirror in a scan; beam i is measured in turn i % turns (interlacing)
    clockwise      the mirror turns that way
    turn_from_deg  where the mirror points when a turn begins; None: at the first beam it meets
    beam_times_s   (n_beams,) s after the scan's start, instead of those of an even mirror

    Ranges:
    range_min_m    least range; closer is sent as an error code (NaN)
    range_max_m    largest range; further is sent as inf
    unit_m         step of the range code; 0: not rounded

    Parts, each of which may be left out:
    noise          statistical error of what is sent, one sigma, rounding included
    systematic     bound of a smooth error of the unit, drawn for each run
    counter_m      step in which time is counted before corrections and rounding
    spot           the disc that a beam lights, of which the first pulse counts
    needed         (range m, reflectivity): a full, square target needs that much to return
    incidence      oblique surfaces return less (cosine)
    mixed_pixels   at edges the value may lie between the two surfaces; needs a ``spot``
    pulse_m        length of a pulse; surfaces further apart than that do not mix
    glass          panes let the beam through, except near their normal
    bounce         panes and polished faces also show what they mirror
    error_codes    no return is an error code, NaN; else inf, free space
    dropout_rate   share of values lost, NaN
    """

    name: str
    first_deg: Annotated[float, Meta(ge=-360.0, le=360.0)]
    step_deg: Annotated[float, Meta(ge=1e-3, le=360.0)]
    n_beams: Annotated[int, Meta(ge=1, le=MAX_BEAMS)]
    rate_hz: Annotated[float, Meta(ge=RATE_HZ[0], le=RATE_HZ[1])]
    turns: Annotated[int, Meta(ge=1, le=MAX_TURNS)] = 1
    clockwise: bool = False
    turn_from_deg: float | None = None
    beam_times_s: tuple[float, ...] = ()

    range_min_m: Metres = 0.0
    range_max_m: Metres
    unit_m: Share = 0.0
    noise: tuple[Band, ...] = ()
    systematic: tuple[Band, ...] = ()
    counter_m: Share = 0.0

    spot: Spot = Spot()
    needed: tuple[tuple[float, float], ...] = ()
    incidence: bool = False
    mixed_pixels: bool = False
    pulse_m: Annotated[float, Meta(ge=0.0, le=10.0)] = 1.0
    glass: bool = False
    bounce: bool = False
    error_codes: bool = False
    dropout_rate: Share = 0.0

    def __post_init__(self) -> None:
        check(self)
        if not self.range_min_m < self.range_max_m:
            raise InvalidValueError(
                f"Scanner.range_max_m must be > range_min_m, got {self.range_max_m}"
            )
        self._check_times()

    def _check_times(self) -> None:
        if self.beam_times_s and len(self.beam_times_s) != self.n_beams:
            raise InvalidValueError(
                f"Scanner.beam_times_s must be {self.n_beams} times, got {len(self.beam_times_s)}"
            )
        times = self.times_s
        if not (times.min() >= 0.0 and times.max() <= float(self.period_s) * (1.0 + 1e-9)):
            raise InvalidValueError(
                f"Scanner: beams must be measured within the {float(self.period_s):g} s of a scan, "
                f"got {times.min():g} to {times.max():g} s after its start"
            )

    # -- as a config of the device ------------------------------------------------------------

    def scanner(self) -> "Scanner":
        """Itself, as any config of a scanner gives one."""
        return self

    def only(self, errors: str) -> "Scanner":
        """With the errors named in ``ERRORS``: "full" is the model as it stands."""
        if errors == "full":
            return self
        one_of("errors", errors, ERRORS)
        bare = replace(
            self, systematic=(), counter_m=0.0, spot=Spot(), needed=(), incidence=False,
            mixed_pixels=False, glass=False, bounce=False, error_codes=False, dropout_rate=0.0,
        )  # fmt: skip
        return bare if errors == "noise" else replace(bare, noise=(), unit_m=0.0)

    # -- beams and their times ----------------------------------------------------------------

    @property
    def period_s(self) -> Fraction:
        """s from scan to scan, exactly."""
        return 1 / Fraction(self.rate_hz).limit_denominator(1_000_000)

    @property
    def turn_s(self) -> Fraction:
        """s of one turn of the mirror, exactly."""
        return self.period_s / self.turns

    @property
    def turn_of(self) -> NDArray[np.int64]:
        """(n_beams,) turn of the mirror in which each beam is measured."""
        return np.arange(self.n_beams, dtype=np.int64) % self.turns

    @property
    def share_of_turn(self) -> Float:
        """(n_beams,) when in its turn each beam is measured, 0 to 1."""
        index = np.arange(self.n_beams, dtype=np.int64)
        if self.beam_times_s:
            given = np.array(self.beam_times_s, dtype=np.float64)
            return np.asarray(given / float(self.turn_s) - self.turn_of, dtype=np.float64)
        last = self.first_deg + (self.n_beams - 1) * self.step_deg
        begin = self.turn_from_deg
        if self.clockwise:
            mirror = ((last if begin is None else begin) - self.first_deg) - index * self.step_deg
        else:
            mirror = (self.first_deg - (self.first_deg if begin is None else begin)) + (
                index * self.step_deg
            )
        return np.asarray(mirror / 360.0, dtype=np.float64)

    @property
    def times_s(self) -> Float:
        """(n_beams,) s after the scan's start at which each beam is measured."""
        if self.beam_times_s:
            return np.array(self.beam_times_s, dtype=np.float64)
        times = (self.turn_of + self.share_of_turn) / float(1 / self.turn_s)
        return np.asarray(times, dtype=np.float64)

    @property
    def stamp_offset_ns(self) -> int:
        """From the start of the scan to its earliest beam, ns."""
        return round(float(self.times_s.min()) * NS_PER_S)

    def spec(self, T_robot_laser: Float | None = None) -> LaserSpec:
        """Geometry and exact beam times, as in every scan."""
        times = self.times_s
        return LaserSpec(
            n_beams=self.n_beams,
            angle_min=math.radians(self.first_deg),
            angle_increment=math.radians(self.step_deg),
            range_min=self.range_min_m,
            range_max=self.range_max_m,
            beam_time_offsets=times - times.min(),
            T_robot_laser=np.zeros(3) if T_robot_laser is None else T_robot_laser,
            range_sigma_m=error_at(self.noise, SIGMA_AT_M),
        )
