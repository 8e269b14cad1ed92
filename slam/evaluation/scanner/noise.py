# SPDX-License-Identifier: Apache-2.0
"""Noise of ranges: from scan to scan of a robot that stands, and about straight walls in a scan."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
EDGE_M = 0.4  # m between neighbours, from which there is an edge
JUMP_M = 0.05  # m from scan to scan: five sigma and more
OFTEN = 0.8  # share of scans in which a beam must return to have a median
LEAST_N = 100  # differences, and
LEAST_WALLS = 10  # walls, below which a bin says nothing
Chosen = Callable[[Float, Float], NDArray[np.bool_]]
"""Which of (n,) ranges m and (n,) incidences rad belong to a bin."""


@dataclass(frozen=True, kw_only=True)
class _Tally:
    """Of one stretch in which the robot stood.

    squares, places, incidences  (n,) of differences of successive scans: their squares, and where
    about_mean, freedom          squares about the means of beams that always returned
    stray, returns               returns far from their beam's median; of so many
    lost, framed                 beams without a return between two that returned; of so many
    jumps, beside                jumps beside an edge; of so many
    """

    squares: Float
    places: Float
    incidences: Float
    about_mean: float
    freedom: int
    stray: int
    returns: int
    lost: int
    framed: int
    jumps: int
    beside: int


def standing(stretches: Sequence[Stretch], angles: Float, step_m: float) -> Figures:
    """A robot at rest before smooth surfaces; ``flicker`` is of all beams.

    standing    one sigma m of what is sent, from differences of successive scans: slow changes have
                no part in it; by range and incidence, too
    slow        deviation about the mean of a stretch over that of successive scans; 1 for white
                noise
    stray       share of returns ``STRAY_M`` or more from their beam's median
    flicker     share without a return, of beams that returned just before and just after
    edge_jumps  share of ranges ``JUMP_M`` or more from those of the scan before, of beams beside an
                edge: mixed pixels that are drawn anew each time, and beams that hit now one side,
                now the other
    """
    tallies = [_tally(part.ranges, angles) for part in stretches]
    sent = partial(sigma_as_sent, step=step_m)

    def figure(chosen: Chosen) -> Figure:
        own = [t.squares[chosen(t.places, t.incidences)] for t in tallies]
        return ratio([0.5 * s.sum() for s in own], [len(s) for s in own], sent).if_of(LEAST_N)

    white = [t.freedom * 0.5 * float(t.squares.sum()) / max(len(t.squares), 1) for t in tallies]
    slow = ratio([t.about_mean for t in tallies], white, math.sqrt)
    return {
        **_by_bins("standing", figure),
        "slow": replace(slow, n=sum(t.freedom for t in tallies)),
        "stray": ratio([t.stray for t in tallies], [t.returns for t in tallies]),
        "flicker": ratio([t.lost for t in tallies], [t.framed for t in tallies]),
        "edge_jumps": ratio([t.jumps for t in tallies], [t.beside for t in tallies]),
    }


def _tally(ranges: Float, angles: Float) -> _Tally:
    seen = np.isfinite(ranges)
    around = seen[:-2] & seen[2:]
    often = seen.mean(axis=0) >= OFTEN
    middle = np.full(ranges.shape[1], np.nan)
    middle[often] = np.nanmedian(ranges[:, often], axis=0)
    jumps = np.abs(np.diff(ranges[:, _beside_edges(middle)], axis=0))
    beams, incidence = smooth(middle, angles)
    own, middle = ranges[:, beams], middle[beams]
    kept = np.abs(own - middle) < STRAY_M  # False for NaN
    returns = int(np.isfinite(own).sum())
    own = np.where(kept, own, np.nan)
    step = np.diff(own, axis=0)
    pairs = np.isfinite(step)
    whole = own[:, np.isfinite(own).all(axis=0)]
    return _Tally(
        squares=step[pairs] ** 2,
        places=np.broadcast_to(middle, step.shape)[pairs],
        incidences=np.broadcast_to(incidence, step.shape)[pairs],
        about_mean=float(((whole - whole.mean(axis=0)) ** 2).sum()),
        freedom=(len(whole) - 1) * whole.shape[1],
        stray=returns - int(kept.sum()),
        returns=returns,
        lost=int((around & ~seen[1:-1]).sum()),
        framed=int(around.sum()),
        jumps=int((jumps >= JUMP_M).sum()),
        beside=int(np.isfinite(jumps).sum()),
    )


def _beside_edges(ranges: Float) -> NDArray[np.bool_]:
    """(n,) beams of which a neighbour is ``EDGE_M`` or more nearer or farther."""
    edge = np.abs(np.diff(ranges)) >= EDGE_M  # False for NaN
    beside: NDArray[np.bool_] = np.append(edge, False) | np.append(False, edge)
    return beside


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
