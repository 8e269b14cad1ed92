# SPDX-License-Identifier: Apache-2.0
"""Landmarks of a shunting map: where its activity peaks, between neurons."""

import math
from dataclasses import dataclass

import numpy as np

from slam._jit import inner, njit
from slam.arrays import Float
from slam.tracker.cells import MASK, SHIFT, SIDE, Cells, activity, slot_of
from slam.tracker.network import Network

MOST = 1 << 14  # peaks returned at most


@inner
def _value(cells: Cells, short: float, i: int, j: int) -> float:
    """What the matcher sees of neuron (i, j); 0 where no block lives."""
    slot = slot_of(cells, i, j)
    return float(activity(cells, short, slot, j & MASK, i & MASK)) if slot >= 0 else 0.0


@inner
def _spread(near: Float, own: float, out: Float) -> None:
    """Covariance xx, xy, yy (cells^2) of a bell beyond the lattice's ``own`` width, into ``out``.

    ``near`` (3, 3) are the logarithms of the neuron and its neighbours: their second differences
    are the inverse covariance of the Gaussian through them.
    """
    a = 2.0 * near[1, 1] - near[1, 0] - near[1, 2]
    d = 2.0 * near[1, 1] - near[0, 1] - near[2, 1]
    b = 0.25 * (near[0, 2] + near[2, 0] - near[0, 0] - near[2, 2])
    det = a * d - b * b
    out[:] = 0.0
    if a <= 0.0 or det <= 1e-6:
        return
    mean, half, cross = 0.5 * (a + d) / det, 0.5 * (d - a) / det, -b / det
    radius = math.sqrt(half * half + cross * cross)
    low = max(mean - radius - own**2, 0.0)
    high = max(mean + radius - own**2, 0.0)
    keep = 0.5 * (high - low) / radius if radius > 0.0 else 0.0
    out[0] = 0.5 * (low + high) + keep * half
    out[1] = keep * cross
    out[2] = 0.5 * (low + high) - keep * half


@inner
def _between(low: float, here: float, high: float) -> float:
    """Offset of the top of the Gaussian through three neighbours, in neurons, |offset| <= 0.5, from
    their logarithms."""
    bend = low + high - 2.0 * here
    if bend >= -1e-9:
        return 0.0
    return min(max(0.5 * (low - high) / bend, -0.5), 0.5)


@inner
def _reached(centre: float, reach: float, size: float, corner: int, blocks: int) -> tuple[int, int]:
    """First and past-the-last of the directory's blocks within ``reach``, along one axis."""
    first = math.floor(max((centre - reach) / size - corner, 0.0))
    last = math.floor(min((centre + reach) / size - corner, blocks - 1.0))
    return first, last + 1


@njit
def _peaks(  # noqa: PLR0913 (kernel)
    cells: Cells,
    cell: float,
    short: float,
    least: float,
    centre: Float,
    reach: float,
    own: float,
    out: Float,
) -> int:
    """Fill ``out`` (most, 7) with x, y, height, spread xx, xy, yy and age; how many there are."""
    count = 0
    near = np.empty((3, 3))
    size = SIDE * cell
    rows, columns = cells.directory.shape
    first_row, past_row = _reached(centre[1], reach, size, cells.corner[1], rows)
    first_column, past_column = _reached(centre[0], reach, size, cells.corner[0], columns)
    for row in range(first_row, past_row):
        for column in range(first_column, past_column):
            if cells.directory[row, column] < 0:
                continue
            for place in range(SIDE * SIDE):
                i = (column + cells.corner[0]) * SIDE + (place & MASK)
                j = (row + cells.corner[1]) * SIDE + (place >> SHIFT)
                here = _value(cells, short, i, j)
                if here < least:
                    continue
                highest = True
                for k in range(9):
                    di, dj = k % 3 - 1, k // 3 - 1
                    other = _value(cells, short, i + di, j + dj)
                    # of two equal neighbours the first is the peak
                    if other > here or (other == here and k < 4):
                        highest = False
                        break
                    near[1 + dj, 1 + di] = math.log(max(other, 1e-9))
                if not highest or count == len(out):
                    continue
                out[count, 0] = (i + 0.5 + _between(near[1, 0], near[1, 1], near[1, 2])) * cell
                out[count, 1] = (j + 0.5 + _between(near[0, 1], near[1, 1], near[2, 1])) * cell
                out[count, 2] = here
                _spread(near, own, out[count, 3:6])
                slot = cells.directory[row, column]
                out[count, 6] = cells.age[slot, j & MASK, i & MASK]
                count += 1
    return count


@dataclass(frozen=True, kw_only=True, eq=False)
class Peaks:
    """Landmarks of a shunting map.

    points_map  (n, 2) m
    heights     (n,) activity, in (0, 1]
    spreads     (n, 2, 2) m^2, by how much the bell is wider than a neuron's own: how uncertain one
                look was, on average over those that wrote it
    ages_s      (n,) s for which it was looked at; 0 without a long-term trace
    """

    points_map: Float
    heights: Float
    spreads: Float
    ages_s: Float


def peaks(
    network: Network, least: float, *, centre: Float | None = None, reach_m: float = math.inf
) -> Peaks:
    """The peaks of activity, of height ``least`` and more.

    A peak is a neuron no lower than its eight neighbours; its place between neurons is the top of
    the Gaussian through it and its neighbours, axis by axis, which is exact for the Gaussians that
    impressions are. ``centre`` (2,) and ``reach_m`` leave out blocks beyond that square.
    """
    out = np.empty((MOST, 7))
    around = np.zeros(2) if centre is None else np.asarray(centre, dtype=np.float64)
    short = network.config.short_term_weight / network.config.saturation
    own = network.config.frontend.sigma_cells
    count = _peaks(network.cells, network.cell, short, least, around, reach_m, own, out)
    found = out[:count].copy()
    return Peaks(
        points_map=found[:, :2].copy(),
        heights=found[:, 2],
        spreads=found[:, [3, 4, 4, 5]].reshape(-1, 2, 2) * network.cell**2,
        ages_s=found[:, 6],
    )
