# SPDX-License-Identifier: Apache-2.0
"""In which steps ranges are coded, and what rounding does to noise."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slam.evaluation.scanner.figures import Figures, exact, key_of, ratio
from slam.evaluation.scanner.stretches import Stretch
from slam.frames import Float

STEPS_MM = (100.0, 50.0, 40.0, 25.0, 20.0, 10.0, 8.0, 5.0, 4.0, 2.5, 2.0, 1.0, 0.5, 0.25, 0.2, 0.1)
ALL = 0.995  # share of returns on multiples of a step that makes it the step
NEAR = 0.02  # of a step from its multiple, beside what single precision cannot hold
COARSE_BINS_M = ((0.0, 4.0), (4.0, 80.0))
COARSE = 5  # how many steps some devices count at once


def codes(stretches: Sequence[Stretch]) -> Figures:
    """Of all returns: ``step`` m, 0 for ranges that are not rounded, and ``coarse`` by range.

    coarse  share of codes that are multiples of five steps. Of evenly used codes a fifth are; all
            are where the device counts so.
    """
    returns = [part.ranges[np.isfinite(part.ranges)] for part in stretches]
    every = np.concatenate([np.zeros(0), *returns])
    steps, step = (1e-3 * mm for mm in STEPS_MM), math.nan
    if len(every):
        step = next((s for s in steps if on_multiples(every, s).mean() >= ALL), 0.0)
    figures = {"step": exact(step, len(every), len(returns))}
    for low, high in COARSE_BINS_M:
        own = [r[(r >= low) & (r < high)] for r in returns if step]
        fives = [float(on_multiples(r, COARSE * step).sum()) for r in own]
        figures[key_of("coarse", low, high)] = ratio(fives, [len(r) for r in own])
    return figures


def on_multiples(ranges: Float, step_m: float) -> NDArray[np.bool_]:
    """(n,) which ranges are whole steps."""
    off = np.abs(ranges - np.rint(ranges / step_m) * step_m)
    near: NDArray[np.bool_] = off <= NEAR * step_m + 1e-7 * ranges
    return near


def flicker_variance(sigma: float, step: float) -> float:
    """m^2 about its own mean of a fixed range plus noise, rounded; mean over where it lies.

    The total error has sigma^2 + step^2 / 12. The part of it that is the same each time is
    sum_k step^2 / (2 pi^2 k^2) exp(-(2 pi k sigma / step)^2): without noise, all of the rounding.
    """
    if step <= 0.0:
        return sigma * sigma
    wave = (math.tau * sigma / step) ** 2
    if wave < 1e-3:  # the series ends late, and this is its limit: a beam near the end of a code
        return step * sigma / math.sqrt(math.pi)
    terms = int(math.sqrt(40.0 / wave)) + 1  # exp(-40): the rest is nothing
    same = sum(math.exp(-wave * k * k) / (k * k) for k in range(1, terms + 1))
    return max(sigma**2 + step**2 / 12.0 - step**2 / (2.0 * math.pi**2) * same, 0.0)


def sigma_before_rounding(variance: float, step: float) -> float:
    """m, inverse of ``flicker_variance``, by bisection."""
    low, high = 0.0, math.sqrt(max(variance, 0.0)) + step
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if flicker_variance(middle, step) < variance else (low, middle)
    return 0.5 * (low + high)


def sigma_as_sent(variance: float, step: float) -> float:
    """m, of a range that is sent about the true one: noise and rounding, from its flicker."""
    return math.hypot(sigma_before_rounding(variance, step), step / math.sqrt(12.0))
