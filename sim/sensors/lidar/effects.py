# SPDX-License-Identifier: Apache-2.0
"""Parts of a scanner that are tables: the reflectivity needed for a return, the error of a unit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar.scanner import Band, error_at
from sim.sensors.lidar.signal import ERROR_STEP, NEEDED_STEP
from slam._jit import njit

Float = NDArray[np.float64]
Curve = tuple[tuple[float, float], ...]


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
