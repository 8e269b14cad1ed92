# SPDX-License-Identifier: Apache-2.0
"""Noise of ranges: from scan to scan of a robot that stands, and about straight walls in a scan;
in which steps ranges are coded, and what rounding does to noise."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from slam.evaluation.scanner.figures import NOTHING, Figure, Figures, key_of, median, ratio
from slam.evaluation.scanner.stretches import Stretch
from slam.evaluation.scanner.walls import SPLIT_M, Wall, smooth, walls
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
    figures = {"step": replace(NOTHING, value=step, n=len(every), stretches=len(returns))}
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


RANGE_BINS_M = ((0.0, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0), (16.0, 32.0))
OBLIQUE = math.radians(45.0)  # rad of incidence, which parts walls into two bins
STRAY_M = 0.15  # m from a beam's median, from which it is no noise: somebody walked by
OFTEN = 0.8  # share of scans in which a beam must return to have a median
LEAST_N = 100  # differences, and
LEAST_WALLS = 10  # walls, below which a bin says nothing
Chosen = Callable[[Float, Float], NDArray[np.bool_]]
"""Which of (n,) ranges m and (n,) incidences rad belong to a bin."""


def standing(stretches: Sequence[Stretch], angles: Float, step_m: float) -> Figures:
    """One sigma m of what is sent, of a robot at rest before smooth surfaces: from differences of
    successive scans, so slow changes have no part in it; also by range and incidence.
    """
    tallies = [_differences(part.ranges, angles) for part in stretches]
    sent = partial(sigma_as_sent, step=step_m)

    def figure(chosen: Chosen) -> Figure:
        own = [squares[chosen(places, tilts)] for squares, places, tilts in tallies]
        return ratio([0.5 * s.sum() for s in own], [len(s) for s in own], sent).if_of(LEAST_N)

    return _by_bins("standing", figure)


def _differences(ranges: Float, angles: Float) -> tuple[Float, Float, Float]:
    """(n,) squares m^2 of differences, ranges m and incidences rad; strays have no part in it."""
    often = np.isfinite(ranges).mean(axis=0) >= OFTEN
    middle = np.full(ranges.shape[1], np.nan)
    middle[often] = np.nanmedian(ranges[:, often], axis=0)
    beams, incidence = smooth(middle, angles)
    own, middle = ranges[:, beams], middle[beams]
    step = np.diff(np.where(np.abs(own - middle) < STRAY_M, own, np.nan), axis=0)
    pairs = np.isfinite(step)
    at, tilts = (np.broadcast_to(one, step.shape)[pairs] for one in (middle, incidence))
    return step[pairs] ** 2, at, tilts


def about_walls(found: Sequence[Sequence[Wall]]) -> Figures:
    """Deviation of ranges about straight walls, the median wall's; the walls of each stretch.

    Rounding is part of it, what a beam errs by each time, and how far from flat the walls are.
    """
    rows = [
        np.array([(np.median(w.ranges), np.median(w.incidence), _scaled(w)) for w in part])
        for part in found
    ]
    tables = [row.reshape(-1, 3) for row in rows]

    def figure(chosen: Chosen) -> Figure:
        own = [table[chosen(table[:, 0], table[:, 1]), 2] for table in tables]
        return median(own, math.sqrt).if_of(LEAST_WALLS)

    return _by_bins("wall", figure)


def found_walls(part: Stretch, angles: Float, split_m: float = SPLIT_M) -> list[Wall]:
    """Walls of the scans of a stretch that are looked at."""
    return [wall for scan in part.looked_at() for wall in walls(scan, angles, split_m)]


def _scaled(wall: Wall) -> float:
    """m^2 whose median over walls is the variance: that of chi^2 lies below its mean."""
    return wall.variance / (1.0 - 2.0 / (9.0 * wall.freedom)) ** 3  # Wilson and Hilferty


def _by_bins(key: str, figure: Callable[[Chosen], Figure]) -> Figures:
    """Of all, by range, and of walls at less and at more than 45 degrees of incidence."""

    def within(low: float, high: float) -> Chosen:
        return lambda places, _: (places >= low) & (places < high)

    return {
        key: figure(lambda places, _: places >= 0.0),
        **{key_of(key, *ends): figure(within(*ends)) for ends in RANGE_BINS_M},
        f"{key}.square": figure(lambda _, tilts: tilts < OBLIQUE),
        f"{key}.oblique": figure(lambda _, tilts: tilts >= OBLIQUE),
    }
