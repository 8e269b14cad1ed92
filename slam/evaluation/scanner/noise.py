# SPDX-License-Identifier: Apache-2.0
"""Noise of ranges: from scan to scan of a robot that stands, and about straight walls in a scan."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from slam.evaluation.scanner.codes import sigma_as_sent
from slam.evaluation.scanner.figures import Figure, Figures, key_of, median, ratio
from slam.evaluation.scanner.stretches import Stretch
from slam.evaluation.scanner.walls import SPLIT_M, Wall, smooth, walls
from slam.frames import Float

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
