# SPDX-License-Identifier: Apache-2.0
"""Noise of ranges: from scan to scan of a robot that stands, and about straight walls in a scan."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from slam.evaluation.scanner.codes import sigma_as_sent
from slam.evaluation.scanner.figures import Figure, median, ratio
from slam.evaluation.scanner.stretches import Stretch
from slam.evaluation.scanner.walls import SPLIT_M, Wall, smooth, walls
from slam.frames import Float

RANGE_BINS_M = ((0.0, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0), (16.0, 32.0))
OBLIQUE = math.radians(45.0)  # rad of incidence, which parts walls into two bins
STRAY_M = 0.15  # m from a beam's median, from which it is no noise: somebody walked by
EDGE_M = 0.4  # m between neighbours, from which there is an edge
JUMP_M = 0.05  # m from scan to scan: five sigma and more
OFTEN = 0.8  # share of scans in which a beam must return to have a median
LEAST_N = 100  # differences, and
LEAST_WALLS = 10  # walls, below which a bin says nothing


@dataclass(frozen=True, kw_only=True)
class Noise:
    """One sigma m, of what is sent; ``by_range`` in ``RANGE_BINS_M``.

    square, oblique  walls at less and at more than 45 degrees of incidence
    """

    overall: Figure
    by_range: tuple[Figure, ...]
    square: Figure
    oblique: Figure


@dataclass(frozen=True, kw_only=True)
class Standing:
    """A robot at rest before smooth surfaces.

    noise    from differences of successive scans: slow changes have no part in it
    slow     deviation about the mean of a stretch over that of successive scans; 1 for white noise
    stray    share of returns ``STRAY_M`` or more from their beam's median
    flicker  share without a return, of beams that returned just before and just after
    edge_jumps  share of ranges ``JUMP_M`` or more from those of the scan before, of beams beside an
             edge: mixed pixels that are drawn anew each time, and beams that hit now one side, now
             the other
    """

    noise: Noise
    slow: Figure
    stray: Figure
    flicker: Figure
    edge_jumps: Figure


@dataclass
class _Tally:
    """Of one stretch: squares of differences, ranges and incidences that they are of."""

    squares: Float = field(default_factory=lambda: np.zeros(0))
    places: Float = field(default_factory=lambda: np.zeros(0))
    incidences: Float = field(default_factory=lambda: np.zeros(0))
    about_mean: float = 0.0
    freedom: int = 0
    stray: int = 0
    returns: int = 0
    lost: int = 0
    framed: int = 0
    jumps: int = 0
    beside: int = 0


def standing(stretches: Sequence[Stretch], angles: Float, step_m: float) -> Standing:
    """Of stretches in which the robot stood; smooth surfaces, but ``flicker`` is of all beams."""
    tallies = [_tally(part.ranges, angles) for part in stretches]
    sent = partial(sigma_as_sent, step=step_m)

    def figure(chosen: Callable[[Float, Float], NDArray[np.bool_]]) -> Figure:
        own = [t.squares[chosen(t.places, t.incidences)] for t in tallies]
        return _enough(ratio([0.5 * s.sum() for s in own], [len(s) for s in own], sent), LEAST_N)

    white = [t.freedom * 0.5 * float(t.squares.sum()) / max(len(t.squares), 1) for t in tallies]
    slow = replace(
        ratio([t.about_mean for t in tallies], white, math.sqrt),
        n=sum(t.freedom for t in tallies),
    )
    return Standing(
        noise=_by_bins(figure), slow=slow,
        stray=ratio([t.stray for t in tallies], [t.returns for t in tallies]),
        flicker=ratio([t.lost for t in tallies], [t.framed for t in tallies]),
        edge_jumps=ratio([t.jumps for t in tallies], [t.beside for t in tallies]),
    )  # fmt: skip


def _tally(ranges: Float, angles: Float) -> _Tally:
    tally = _Tally()
    seen = np.isfinite(ranges)
    around = seen[:-2] & seen[2:]
    tally.framed, tally.lost = int(around.sum()), int((around & ~seen[1:-1]).sum())
    often = seen.mean(axis=0) >= OFTEN
    middle = np.full(ranges.shape[1], np.nan)
    middle[often] = np.nanmedian(ranges[:, often], axis=0)
    step = np.abs(np.diff(ranges[:, _beside_edges(middle)], axis=0))
    tally.beside, tally.jumps = int(np.isfinite(step).sum()), int((step >= JUMP_M).sum())
    beams, incidence = smooth(middle, angles)
    own, middle = ranges[:, beams], middle[beams]
    kept = np.abs(own - middle) < STRAY_M  # False for NaN
    tally.returns = int(np.isfinite(own).sum())
    tally.stray = tally.returns - int(kept.sum())
    own = np.where(kept, own, np.nan)
    step = np.diff(own, axis=0)
    pairs = np.isfinite(step)
    tally.squares = step[pairs] ** 2
    tally.places = np.broadcast_to(middle, step.shape)[pairs]
    tally.incidences = np.broadcast_to(incidence, step.shape)[pairs]
    whole = own[:, np.isfinite(own).all(axis=0)]
    tally.about_mean = float(((whole - whole.mean(axis=0)) ** 2).sum())
    tally.freedom = (len(whole) - 1) * whole.shape[1]
    return tally


def _beside_edges(ranges: Float) -> NDArray[np.bool_]:
    """(n,) beams of which a neighbour is ``EDGE_M`` or more nearer or farther."""
    edge = np.abs(np.diff(ranges)) >= EDGE_M  # False for NaN
    beside: NDArray[np.bool_] = np.append(edge, False) | np.append(False, edge)
    return beside


def about_walls(found: Sequence[Sequence[Wall]]) -> Noise:
    """Deviation of ranges about straight walls, the median wall's; the walls of each stretch.

    Rounding is part of it, what a beam errs by each time, and how far from flat the walls are.
    """

    def figure(chosen: Callable[[Float, Float], NDArray[np.bool_]]) -> Figure:
        own = [np.array([_scaled(w) for w in part if _is(w, chosen)]) for part in found]
        return _enough(median(own, math.sqrt), LEAST_WALLS)

    return _by_bins(figure)


def found_walls(part: Stretch, angles: Float, split_m: float = SPLIT_M) -> list[Wall]:
    """Walls of the scans of a stretch that are looked at."""
    return [wall for scan in part.looked_at() for wall in walls(scan, angles, split_m)]


def _is(wall: Wall, chosen: Callable[[Float, Float], NDArray[np.bool_]]) -> bool:
    place, tilt = np.median(wall.ranges, keepdims=True), np.median(wall.incidence, keepdims=True)
    return bool(chosen(place, tilt)[0])


def _scaled(wall: Wall) -> float:
    """m^2 whose median over walls is the variance: that of chi^2 lies below its mean."""
    return wall.variance / (1.0 - 2.0 / (9.0 * wall.freedom)) ** 3  # Wilson and Hilferty


def _by_bins(figure: Callable[[Callable[[Float, Float], NDArray[np.bool_]]], Figure]) -> Noise:
    def within(low: float, high: float) -> Callable[[Float, Float], NDArray[np.bool_]]:
        return lambda places, _: (places >= low) & (places < high)

    return Noise(
        overall=figure(lambda places, _: places >= 0.0),
        by_range=tuple(figure(within(low, high)) for low, high in RANGE_BINS_M),
        square=figure(lambda _, tilts: tilts < OBLIQUE),
        oblique=figure(lambda _, tilts: tilts >= OBLIQUE),
    )


def _enough(figure: Figure, least: int) -> Figure:
    return figure if figure.n >= least else ratio([], [])
