# SPDX-License-Identifier: Apache-2.0
"""From the geometry under a laser spot to the distance the LMS-221 reports.

A spot of 16 mm + 11.9 mrad (TL p114) is seven rays. Rays at about the same distance make one pulse
whose energy is the sum of weight, reflectivity and cosine of incidence. The first pulse that
carries the energy needed at its distance (TD fig. 4-2) is the one that counts (TL p19); if more
energy comes back from within the pulse length of about 1 m behind it, the value lies anywhere
between the two (TL p110-111): a mixed pixel. The manufacturer gives no more than that about edges;
what goes beyond his words is marked inferred in the design note (fidelity, 1.6).

Each effect has its own switch in ``RangeEffects``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.caster import Spot
from slam._jit import njit
from slam.errors import InvalidValueError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

PULSE_LENGTH = 1.0  # m, TL p110
SAME_PULSE = 0.1  # m between rays of one pulse; inferred
SAME_SURFACE = 0.5  # m, the same where both hit one thing: an oblique wall; inferred
PANE_RETURN_COS = math.cos(math.radians(5.0))  # a pane answers only that near its normal; inferred
PANE_TRANSMISSION = 0.9  # of the energy, each way; inferred

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
_DISC_WEIGHTS = (0.25, *(0.125,) * 6)

LMS221_SPOT = Spot(aperture=0.008, divergence=0.00595, offsets=_DISC)

# Needed reflectivity for a return against range, clean window (TD fig. 4-2, digitised).
NEEDED_RANGE_M = (0.2, 0.3, 0.5, 1.0, 1.5, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0)
NEEDED = (
    0.47, 0.20, 0.12, 0.046, 0.030, 0.022, 0.016, 0.022, 0.035, 0.054, 0.107, 0.185, 0.42,
)  # fmt: skip
_NEEDED_STEP = 0.01  # m, of the table made from it

# Material name, or how it begins -> reflectivity at 905 nm. TD p7 lists black cardboard 10 %, grey
# cardboard 20, raw pine 40, grey PVC 50, white paper 80, metals 110 and more, black rubber 2; what
# cloth and painted things have is inferred from those classes.
REFLECTIVITY = MappingProxyType(
    {
        "wall": 0.80, "paper": 0.80, "paint": 0.40, "pot": 0.50, "soil": 0.15, "leaf": 0.50,
        "desk": 0.50, "wood": 0.40, "wood_frame": 0.80, "wood_cabinet_front": 0.80,
        "wood_dark": 0.20, "metal": 1.20, "metal_dark": 1.10, "metal_white": 0.80,
        "plastic": 0.50, "plastic_black": 0.05, "plastic_white": 0.80, "plastic_bin": 0.20,
        "rubber": 0.02, "screen": 0.10, "fabric": 0.30, "floor": 0.30, "ground": 0.30,
        "skin": 0.50, "hair": 0.10, "shirt": 0.40, "trousers": 0.20, "trousers_black": 0.08,
        "shoe": 0.08, "glass": 0.05,
    }
)  # fmt: skip
DEFAULT_REFLECTIVITY = 0.50


@dataclass(frozen=True, kw_only=True)
class RangeEffects:
    """What of the real device's ways is simulated; ``RangeEffects.none()`` is a ruler.

    spot          a disc of seven rays, first pulse wins; off: one ideal ray
    reflectivity  dark things far away, or close by, give no return
    incidence     oblique surfaces return less
    mixed_pixels  at edges the value may lie between the two surfaces
    glass         panes let the beam through, except near their normal
    systematic    error function of the unit and run: 35 mm in mm mode, 5 cm in cm mode (TD p34)
    dropout_rate  share of values lost to dazzle and the like (NaN); no source gives one
    """

    spot: bool = True
    reflectivity: bool = True
    incidence: bool = True
    mixed_pixels: bool = True
    glass: bool = True
    systematic: bool = True
    dropout_rate: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.dropout_rate <= 1.0:
            raise InvalidValueError(
                f"RangeEffects.dropout_rate must be within 0..1, got {self.dropout_rate}"
            )

    @classmethod
    def none(cls) -> RangeEffects:
        """All off."""
        return cls(**{f.name: False for f in fields(cls) if f.name != "dropout_rate"})


def reflectivity_of(material: str) -> float:
    """Of a material by its name without prefix: the longest entry of the table it begins with."""
    name = material.rsplit("/", 1)[-1]
    known = [key for key in REFLECTIVITY if name == key or name.startswith(key + "_")]
    return REFLECTIVITY[max(known, key=len)] if known else DEFAULT_REFLECTIVITY


def geom_reflectivity(model: mujoco.MjModel) -> Float:
    """(ngeom,) by the name of each geom's material."""
    of_material = [reflectivity_of(model.mat(i).name) for i in range(model.nmat)]
    table: Float = np.array([*of_material, DEFAULT_REFLECTIVITY])
    of_geom: NDArray[Any] = table[model.geom_matid]
    return of_geom


def glass_geoms(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """(ngeom,) True for panes: material ``glass`` or ``glass_...``."""
    names = [model.mat(i).name.rsplit("/", 1)[-1] for i in range(model.nmat)]
    panes = [name == "glass" or name.startswith("glass_") for name in names]
    table: NDArray[np.bool_] = np.array([*panes, False])
    of_geom: NDArray[Any] = table[model.geom_matid]
    return of_geom


def needed_reflectivity(range_m: float) -> float:
    """Least reflectivity of a full, square target that returns, on the straight log-log curve."""
    last = len(NEEDED) - 2
    k = min(max(sum(r <= range_m for r in NEEDED_RANGE_M) - 1, 0), last)
    x0, x1 = math.log(NEEDED_RANGE_M[k]), math.log(NEEDED_RANGE_M[k + 1])
    y0, y1 = math.log(NEEDED[k]), math.log(NEEDED[k + 1])
    x = math.log(max(range_m, 0.1))
    return math.exp(y0 + (y1 - y0) * (x - x0) / (x1 - x0))


@njit
def _sort_rays(distances: Float, order: Int) -> None:
    for i in range(1, order.size):
        k, j = order[i], i
        while j > 0 and distances[order[j - 1]] > distances[k]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = k


@njit
def _next_pulse(
    distances: Float, energies: Float, surfaces: Int, order: Int, first: int
) -> tuple[int, float, float, int]:
    """(row after the pulse that begins at ``first``, its energy, range, strongest ray)."""
    energy, moment, strongest = 0.0, 0.0, order[first]
    row = first
    while row < order.size:
        k = order[row]
        if row > first:
            before = order[row - 1]
            alike = surfaces[k] == surfaces[before]
            if distances[k] - distances[before] > (SAME_SURFACE if alike else SAME_PULSE):
                break
        energy += energies[k]
        moment += energies[k] * distances[k]
        if energies[k] > energies[strongest]:
            strongest = k
        row += 1
    return row, energy, moment / energy if energy > 0.0 else distances[strongest], strongest


@njit
def detect(
    distances: Float,
    energies: Float,
    surfaces: Int,
    needed: Float,
    chances: Float,
    mixes: bool,
    ranges: Float,
    rays: Int,
    mixed: NDArray[np.bool_],
) -> None:
    """Which pulse of each beam triggers, and what distance that gives.

    distances, energies  (n, k) of each ray, inf and 0 for none
    surfaces             (n, k) what each ray hit
    needed               energy needed against distance, every ``_NEEDED_STEP`` m
    chances              (n,) in [0, 1): where between two surfaces a mixed pixel falls
    Fills ranges (n,) m, inf for no return; rays (n,) the strongest ray of the pulse, -1; mixed (n,)
    """
    count = distances.shape[1]
    order = np.empty(count, dtype=np.int64)
    for i in range(distances.shape[0]):
        ranges[i], rays[i], mixed[i] = math.inf, -1, False
        for k in range(count):
            order[k] = k
        _sort_rays(distances[i], order)
        row = 0
        while row < count and math.isfinite(distances[i, order[row]]):
            row, energy, place, strongest = _next_pulse(
                distances[i], energies[i], surfaces[i], order, row
            )
            bin_ = min(int(place / _NEEDED_STEP), needed.size - 1)
            if energy <= 0.0 or energy < needed[bin_]:
                continue
            ranges[i], rays[i] = place, strongest
            if row < count and mixes:
                _, behind, far, _ = _next_pulse(distances[i], energies[i], surfaces[i], order, row)
                if behind > energy and far - place < PULSE_LENGTH:
                    ranges[i] = place + chances[i] * (far - place)
                    mixed[i] = True
            break


class SignalModel:
    """The receiver of one scanner: rays in, distances before noise and rounding out.

    effects  which of them
    bound    m, of the systematic error (TD p34)
    rng      drawn from a fixed number of times, here and by ``apply``
    """

    def __init__(self, effects: RangeEffects, bound: float, rng: np.random.Generator) -> None:
        self.effects = effects
        self.is_ruler = effects == RangeEffects.none()
        self.spot = LMS221_SPOT if effects.spot else Spot()
        self._weights = np.array(_DISC_WEIGHTS if effects.spot else (1.0,))
        steps = round(100.0 / _NEEDED_STEP)
        self._needed = (
            np.array([needed_reflectivity((k + 0.5) * _NEEDED_STEP) for k in range(steps)])
            if effects.reflectivity
            else np.zeros(steps)
        )
        self._rng = rng
        self._error = _error_function(bound, rng)

    def apply(
        self, hits: tuple[Float, Int, Float], reflectivity: Float, transmission: Float
    ) -> tuple[Float, Int, NDArray[np.bool_]]:
        """(ranges (n,) m, strongest ray (n,) or -1, mixed (n,)) of a scan.

        hits          (n, k) each: distances m, inf for none; what was hit; |cos| of the incidence
        reflectivity  (n, k) of what was hit
        transmission  (n, k) share of the energy that panes let through, both ways
        """
        distances, surfaces, cosines = hits
        n, effects = distances.shape[0], self.effects
        chances, lost = self._rng.random((n,)), self._rng.random((n,))
        if self.is_ruler:
            ranges = distances[:, 0].copy()
            return ranges, np.where(np.isfinite(ranges), 0, -1), np.zeros(n, dtype=np.bool_)
        energies = np.where(np.isfinite(distances), self._weights, 0.0) * transmission
        if effects.reflectivity:
            energies *= reflectivity
        if effects.incidence:
            energies *= np.where(np.isfinite(distances), cosines, 0.0)
        ranges, rays = np.empty(n), np.empty(n, dtype=np.int64)
        mixed, mixes = np.empty(n, dtype=np.bool_), effects.mixed_pixels
        detect(distances, energies, surfaces, self._needed, chances, mixes, ranges, rays, mixed)
        if effects.systematic:
            ranges += self._systematic(ranges, reflectivity, rays)
        ranges[lost < effects.dropout_rate] = np.nan
        return ranges, rays, mixed

    def _systematic(self, ranges: Float, reflectivity: Float, rays: Int) -> Float:
        by_range, by_reflectivity = self._error
        seen = np.flatnonzero(rays >= 0)
        out = np.zeros(ranges.size)
        brightness = np.clip(reflectivity[seen, rays[seen]], 0.0, 1.0)
        bins = np.minimum((ranges[seen] / _ERROR_STEP).astype(np.int64), by_range.size - 2)
        part = ranges[seen] / _ERROR_STEP - bins
        smooth = by_range[bins] * (1.0 - part) + by_range[bins + 1] * part
        out[seen] = smooth + by_reflectivity * (2.0 * brightness - 1.0)
        return out


_ERROR_STEP = 0.1  # m, of the table of the systematic error
_ERROR_WAVES = 5


def _error_function(bound: float, rng: np.random.Generator) -> tuple[Float, float]:
    """A smooth random function of range, and a slope against reflectivity; sum within ``bound``.

    Each unit has its own two correction tables, against range and received energy (TL p16, p113);
    their shape is not published, so: five waves of 2 to 30 m for 80 % of the bound.
    """
    draws = rng.random(3 * _ERROR_WAVES + 1).tolist()
    shares = [0.1 + draws[3 * k] for k in range(_ERROR_WAVES)]
    lengths = [2.0 * 15.0 ** draws[3 * k + 1] for k in range(_ERROR_WAVES)]
    phases = [math.tau * draws[3 * k + 2] for k in range(_ERROR_WAVES)]
    scale = 0.8 * bound / sum(shares)
    by_range = [
        scale
        * sum(
            share * math.sin(math.tau * k * _ERROR_STEP / length + phase)
            for share, length, phase in zip(shares, lengths, phases, strict=True)
        )
        for k in range(1001)
    ]
    return np.array(by_range), 0.2 * bound * (2.0 * draws[-1] - 1.0)
