# SPDX-License-Identifier: Apache-2.0
"""One scan from what its rays hit; every scan takes the same number of draws."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar import columns as col
from sim.sensors.lidar.caster import Hits
from sim.sensors.lidar.scanner import Band, Scanner, error_at
from sim.sensors.lidar.signal import ERROR_STEP, NEEDED_STEP, Bool, Int, scan
from slam._jit import njit
from slam.frames import Float

Curve = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanResult:
    """One scan, and the truth about it that only a simulator has.

    ranges       (n,) float32 m, as sent: inf beyond the largest range, NaN an error code (REP
                 117); no return is NaN with ``Scanner.error_codes``, else inf
    true_ranges  (n,) float64 m, inf where nothing was hit
    geoms        (n,) int32 geom id, -1 where nothing was hit or nothing came back
    bodies       (n,) int32 body id, -1 likewise
    cosines      (n,) |cos| of the angle between beam and surface normal, NaN likewise
    mixed        (n,) bool, the range blends two surfaces
    ghost        (n,) bool, the range is that of something seen in a pane or polished face

    Where the beam is a spot of several rays, ``true_ranges`` is that of the middle ray, and geoms,
    bodies and cosines are those of the strongest ray of the pulse that was measured.
    """

    ranges: NDArray[np.float32]
    true_ranges: Float
    geoms: NDArray[np.int32]
    bodies: NDArray[np.int32]
    cosines: Float
    mixed: Bool
    ghost: Bool

    @property
    def incidence(self) -> NDArray[np.float32]:
        """(n,) rad between beam and surface normal, NaN where nothing was hit."""
        return arccos(self.cosines).astype(np.float32)


@njit
def arccos(cosines: Float) -> Float:
    """Elementwise, by libm: NumPy's own changes its last bit with the CPU."""
    out = np.empty(cosines.size)
    for i in range(cosines.size):
        out[i] = math.acos(cosines[i])
    return out


class SignalModel:
    """The receiver of one scanner: hits in, what is sent out.

    scanner  which ranges, which parts
    surface  (candidates,) each: reflectivity; polished; geom id; body id
    rng      drawn from once, to seed a stream for each effect: what is off draws nothing, and
             neither that nor what is hit changes the draws of the others

    Attribute ``streams``: the generators, for who saves the state of a run.
    """

    def __init__(
        self,
        scanner: Scanner,
        surface: tuple[Float, Bool, Int, Int],
        rng: np.random.Generator,
    ) -> None:
        seeds = rng.integers(0, 2**63, size=4)
        unit_of_run, *rest = (np.random.default_rng(seed) for seed in seeds)
        self.streams = tuple(rest)  # noise, mixed pixels, lost values
        owner = np.stack([np.append(ids, -1) for ids in surface[2:]])
        self._surface = (np.append(surface[0], 0.0), np.append(surface[1], False), owner)
        needed = needed_table(scanner.needed) if scanner.needed else np.zeros(1)
        error: tuple[Float, float] = (np.zeros(0), 0.0)
        if scanner.systematic:
            error = error_function(scanner.systematic, unit_of_run)
        ruler = len(scanner.spot.weights) == 1 and not (
            scanner.needed
            or scanner.incidence
            or scanner.mixed_pixels
            or scanner.glass
            or scanner.bounce
        )
        pulse = scanner.pulse_m if scanner.mixed_pixels else 0.0
        switches = (bool(scanner.needed), scanner.incidence, pulse)
        self._receiver = (ruler, np.array(scanner.spot.weights), switches, needed)
        steps = (scanner.counter_m, scanner.unit_m, scanner.range_min_m, scanner.range_max_m)
        self._sender = (error, steps, analog_noise(scanner))
        none = math.nan if scanner.error_codes else math.inf
        self._errors = (scanner.dropout_rate, none)
        # Which of the streams are drawn from.
        self._drawn = (not ruler and pulse > 0.0, len(self._sender[2]) > 0, self._errors[0] > 0.0)
        self._nothing = np.zeros(0)

    def scan(self, hits: Hits, mirrored: tuple[Float, Int, Float]) -> ScanResult:
        """One scan from the caster's ``hits`` and what was mirrored, (n,) or (0,) each."""
        n = hits[0].shape[1]
        places, seen, marks = np.empty((3, n)), np.empty(n, np.int64), np.empty((2, n), np.bool_)
        ranges, whose = np.empty(n, dtype=np.float32), np.empty((2, n), dtype=np.int32)
        scan(
            hits, mirrored, self._surface, self._receiver, self._sender, self._errors,
            self._draws(n), (places, seen, marks), (ranges, whose),
        )  # fmt: skip
        return ScanResult(
            ranges=ranges, true_ranges=places[col.MIDDLE], cosines=places[col.COSINE],
            geoms=whose[col.GEOM_ID], bodies=whose[col.BODY_ID],
            mixed=marks[col.MIXED], ghost=marks[col.GHOST],
        )  # fmt: skip

    def blink(self, n: int) -> None:
        """The draws of a scan of ``n`` beams that nobody looks at."""
        self._draws(n)

    def _draws(self, n: int) -> tuple[Float, Float, Float]:
        """Chances of mixed pixels, normal noise and chances of a loss, of ``n`` beams each."""
        noise, mixed, lost = self.streams
        with_mixed, with_noise, with_losses = self._drawn
        return (
            mixed.random((n,)) if with_mixed else self._nothing,
            noise.standard_normal((n,)) if with_noise else self._nothing,
            lost.random((n,)) if with_losses else self._nothing,
        )


def analog_noise(scanner: Scanner) -> Float:
    """(k, 3) bands of range: up to m; deviation m before rounding, so that what is sent has that of
    ``Scanner.noise``; further deviation per metre. (0, 3) for none.

    Rounding to u adds u^2 / 12 of its own; the second rounding adds nothing where it finds only
    multiples of its unit, that is without corrections in between.
    """
    counter, unit = scanner.counter_m, scanner.unit_m
    again = unit if scanner.systematic or unit > counter else 0.0
    rounding = (counter**2 + again**2) / 12.0
    bands = [
        (band.up_to_m, math.sqrt(max(band.error_m**2 - rounding, 0.0)), band.share)
        for band in scanner.noise
    ]
    if not any(std > 0.0 or share > 0.0 for _, std, share in bands):
        return np.zeros((0, 3))
    return np.array(bands)


def needed_reflectivity(curve: Curve, range_m: float) -> float:
    """Least reflectivity of a full, square target that returns, on the straight log-log curve.

    curve  (range m, reflectivity) at rising ranges
    """
    last = len(curve) - 2
    k = min(max(sum(r <= range_m for r, _ in curve) - 1, 0), last)
    x0, x1 = math.log(curve[k][0]), math.log(curve[k + 1][0])
    y0, y1 = math.log(curve[k][1]), math.log(curve[k + 1][1])
    x = math.log(max(range_m, 0.1))
    return math.exp(y0 + (y1 - y0) * (x - x0) / (x1 - x0))


@cache
def needed_table(curve: Curve) -> Float:
    """Needed reflectivity every ``NEEDED_STEP`` to 100 m, at the middle of each; read only."""
    return np.array([needed_reflectivity(curve, (k + 0.5) * NEEDED_STEP) for k in range(20_000)])


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


def error_function(bounds: Sequence[Band], rng: np.random.Generator) -> tuple[Float, float]:
    """A smooth random function of range, and a slope against reflectivity; sum within ``bounds``.

    Each unit of the LMS-221 has its own two correction tables, against range and received energy
    (TL p16, p113); their shape is not published, so: five waves of 2 to 30 m for 80 % of the bound.
    """
    draws = rng.random(3 * _ERROR_WAVES + 1).tolist()
    shares = [0.1 + draws[3 * k] for k in range(_ERROR_WAVES)]
    lengths = [2.0 * 15.0 ** draws[3 * k + 1] for k in range(_ERROR_WAVES)]
    phases = [math.tau * draws[3 * k + 2] for k in range(_ERROR_WAVES)]
    ranges_m = [k * ERROR_STEP for k in range(1001)]
    bound = error_at(bounds, 0.0)
    if len(bounds) > 1 or bounds[0].share > 0.0:
        bound = 1.0
    scale = 0.8 * bound / sum(shares)
    by_range = _waves(scale, np.array(shares), np.array(lengths), np.array(phases))
    if len(bounds) > 1 or bounds[0].share > 0.0:
        by_range *= [error_at(bounds, r) for r in ranges_m]
        bound = min(error_at(bounds, r) for r in ranges_m)
    return by_range, 0.2 * bound * (2.0 * draws[-1] - 1.0)
