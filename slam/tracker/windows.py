# SPDX-License-Identifier: Apache-2.0
"""Rectangles of a map's cells as arrays, at the cost of the blocks that live there."""

from typing import NamedTuple

import numpy as np

from slam.arrays import Float32, Int32, Ints
from slam.tracker.cells import SHIFT, SIDE, Cells


class Window(NamedTuple):
    """The living blocks that a rectangle of cells meets.

    slots          (n,) of the pool
    rows, columns  (n,) of the blocks, counted from the first that the rectangle meets
    blocks         rows and columns of blocks that it meets, alive or not
    cells          which of their cells are its own
    """

    slots: Int32
    rows: Ints
    columns: Ints
    blocks: tuple[int, int]
    cells: tuple[slice, slice]

    def spread(self, values: Float32, fill: float, n: int = 1) -> Float32:
        """The rectangle's cells from ``values`` (n, 8, 8) of its blocks, else ``fill``.

        n  so many cells a side are one, the largest of them; of whole blocks
        """
        height, width = self.blocks
        if n > 1:
            out = np.full((-(-height * SIDE // n), -(-width * SIDE // n)), fill, np.float32)
            place = np.arange(SIDE)
            j = (self.rows[:, None, None] * SIDE + place[:, None]) // n
            i = (self.columns[:, None, None] * SIDE + place) // n
            np.fmax.at(out, (j, i), values)
            return out
        out = np.full((height, SIDE, width, SIDE), fill, np.float32)
        out[self.rows, :, self.columns] = values
        return out.reshape(height * SIDE, width * SIDE)[self.cells]


def window(cells: Cells, i0: int, j0: int, shape: tuple[int, int]) -> Window:
    """Of the cells (i0 + column, j0 + row)."""
    top, left = j0 >> SHIFT, i0 >> SHIFT
    blocks = ((j0 + shape[0] - 1) >> SHIFT) + 1 - top, ((i0 + shape[1] - 1) >> SHIFT) + 1 - left
    row, column = top - int(cells.corner[1]), left - int(cells.corner[0])
    low, first = max(-row, 0), max(-column, 0)  # of the blocks, the first in the directory
    slots = cells.directory[
        row + low : max(row + blocks[0], 0), column + first : max(column + blocks[1], 0)
    ]
    a, b = np.nonzero(slots >= 0)
    j, i = j0 - top * SIDE, i0 - left * SIDE
    own = slice(j, j + shape[0]), slice(i, i + shape[1])
    return Window(slots[a, b], a + low, b + first, blocks, own)


def dense(cells: Cells, i0: int, j0: int, shape: tuple[int, int]) -> tuple[Float32, Float32]:
    """x and y of cells (i0 + column, j0 + row), 0 where nothing lives."""
    found = window(cells, i0, j0, shape)
    return (
        found.spread(cells.x[found.slots], 0.0).copy(),
        found.spread(cells.y[found.slots], 0.0).copy(),
    )
