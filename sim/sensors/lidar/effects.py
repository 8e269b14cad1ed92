# SPDX-License-Identifier: Apache-2.0
"""Which of the LMS-221's ways are simulated, and the manufacturer's numbers behind them.

Numbers are from the technical description (TD, 8008970/06-2003) and the telegram listing (TL,
8007954/2006-08-01); what goes beyond them is marked inferred, as in the design note (fidelity,
1.3 to 1.6). What the receiver makes of them is in ``sim.sensors.lidar.signal``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sim.core.checks import check_types
from sim.sensors.lidar.caster import Spot
from sim.sensors.lidar.signal import ERROR_STEP, NEEDED_STEP
from slam._jit import njit
from slam.errors import InvalidValueError

Float = NDArray[np.float64]

TIMER_UNIT = 0.010  # m, resolution of the time measurement in every range mode (TD p34, TL 10-10)

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
DISC_WEIGHTS = (0.25, *(0.125,) * 6)

LMS221_SPOT = Spot(aperture=0.008, divergence=0.00595, offsets=_DISC)

# Needed reflectivity for a return against range, clean window (TD fig. 4-2, digitised).
NEEDED_RANGE_M = (0.2, 0.3, 0.5, 1.0, 1.5, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0)
NEEDED = (
    0.47, 0.20, 0.12, 0.046, 0.030, 0.022, 0.016, 0.022, 0.035, 0.054, 0.107, 0.185, 0.42,
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
    dropout_rate: float = 0.0

    def __post_init__(self) -> None:
        check_types(self)
        if not 0.0 <= self.dropout_rate <= 1.0:
            raise InvalidValueError(
                f"RangeEffects.dropout_rate must be within 0..1, got {self.dropout_rate}"
            )

    @classmethod
    def none(cls) -> RangeEffects:
        """All off."""
        return cls(**{f.name: False for f in fields(cls) if f.name != "dropout_rate"})


def needed_reflectivity(range_m: float) -> float:
    """Least reflectivity of a full, square target that returns, on the straight log-log curve."""
    last = len(NEEDED) - 2
    k = min(max(sum(r <= range_m for r in NEEDED_RANGE_M) - 1, 0), last)
    x0, x1 = math.log(NEEDED_RANGE_M[k]), math.log(NEEDED_RANGE_M[k + 1])
    y0, y1 = math.log(NEEDED[k]), math.log(NEEDED[k + 1])
    x = math.log(max(range_m, 0.1))
    return math.exp(y0 + (y1 - y0) * (x - x0) / (x1 - x0))


@cache
def needed_table() -> Float:
    """Needed reflectivity every ``NEEDED_STEP`` to 100 m, at the middle of each; read only."""
    return np.array([needed_reflectivity((k + 0.5) * NEEDED_STEP) for k in range(20_000)])


_ERROR_WAVES = 5


@njit
def _waves(scale: float, shares: Float, lengths: Float, phases: Float) -> Float:
    """Their sum every ``ERROR_STEP`` to 100 m."""
    out = np.zeros(1001)
    for k in range(out.size):
        for share, length, phase in zip(shares, lengths, phases):  # noqa: B905  (Numba has no strict)
            out[k] += share * math.sin(math.tau * k * ERROR_STEP / length + phase)
        out[k] *= scale
    return out


def error_function(bound: float, rng: np.random.Generator) -> tuple[Float, float]:
    """A smooth random function of range, and a slope against reflectivity; sum within ``bound``.

    Each unit has its own two correction tables, against range and received energy (TL p16, p113);
    their shape is not published, so: five waves of 2 to 30 m for 80 % of the bound.
    """
    draws = rng.random(3 * _ERROR_WAVES + 1).tolist()
    shares = [0.1 + draws[3 * k] for k in range(_ERROR_WAVES)]
    lengths = [2.0 * 15.0 ** draws[3 * k + 1] for k in range(_ERROR_WAVES)]
    phases = [math.tau * draws[3 * k + 2] for k in range(_ERROR_WAVES)]
    scale = 0.8 * bound / sum(shares)
    by_range = _waves(scale, np.array(shares), np.array(lengths), np.array(phases))
    return by_range, 0.2 * bound * (2.0 * draws[-1] - 1.0)
