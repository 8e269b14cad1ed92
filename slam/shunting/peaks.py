# SPDX-License-Identifier: Apache-2.0
"""Landmarks of a shunting map: where its activity peaks, between neurons."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import inner, njit
from slam.frames import Float
from slam.shunting.cells import MASK, SHIFT, SIDE, Cells
from slam.shunting.network import Network

MOST = 1 << 14  # peaks returned at most


@inner
def _value(cells: Cells, short: float, i: int, j: int) -> float:
    """v = y + (1 - y) short x of neuron (i, j), what the matcher sees; 0 where no block lives."""
    row, column = (j >> SHIFT) - cells.corner[1], (i >> SHIFT) - cells.corner[0]
    rows, columns = cells.directory.shape
    if row < 0 or column < 0 or row >= rows or column >= columns:
        return 0.0
    slot = cells.directory[row, column]
    if slot < 0:
        return 0.0
    y = cells.y[slot, j & MASK, i & MASK]
    return float(y + (1.0 - y) * short * cells.x[slot, j & MASK, i & MASK])


@inner
def _between(before: float, here: float, after: float) -> float:
    """Offset of the top of the Gaussian through three neighbours, in neurons, |offset| <= 0.5."""
    low = math.log(max(before, 1e-9))
    high = math.log(max(after, 1e-9))
    bend = low + high - 2.0 * math.log(here)
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
def _peaks(
    cells: Cells,
    cell: float,
    short: float,
    least: float,
    centre: NDArray[np.float64],
    reach: float,
    out: NDArray[np.float64],
) -> int:
    """Fill ``out`` (most, 3) with x, y (m) and height of the peaks; how many there are."""
    count = 0
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
                if not highest or count == len(out):
                    continue
                a, b = _value(cells, short, i - 1, j), _value(cells, short, i + 1, j)
                c, d = _value(cells, short, i, j - 1), _value(cells, short, i, j + 1)
                out[count, 0] = (i + 0.5 + _between(a, here, b)) * cell
                out[count, 1] = (j + 0.5 + _between(c, here, d)) * cell
                out[count, 2] = here
                count += 1
    return count


def peaks(
    network: Network, least: float, *, centre: Float | None = None, reach_m: float = math.inf
) -> tuple[Float, Float]:
    """Peaks (n, 2) m in the map frame and their heights (n,), in (0, 1].

    A peak is a neuron no lower than its eight neighbours and at least ``least`` high; its place
    between neurons is the top of the Gaussian through it and its neighbours, axis by axis, which is
    exact for the Gaussians that impressions are. ``centre`` (2,) and ``reach_m`` leave out blocks
    beyond that square.
    """
    out = np.empty((MOST, 3))
    around = np.zeros(2) if centre is None else np.asarray(centre, dtype=np.float64)
    short = network.config.short_term_weight / network.config.saturation
    count = _peaks(network.cells, network.cell, short, least, around, reach_m, out)
    return out[:count, :2].copy(), out[:count, 2].copy()
