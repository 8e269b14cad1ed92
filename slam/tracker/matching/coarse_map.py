# SPDX-License-Identifier: Apache-2.0
"""The whole map, pooled for a search, laid out a part at a time.

It holds as long as the map is not written to: while the robot is lost.
"""

import math

import numpy as np

from slam.arrays import Bytes
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import SHIFT, SIDE
from slam.tracker.matching.branch_and_bound import look_ahead
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.config import BudgetConfig
from slam.tracker.matching.local_search import field_of
from slam.tracker.matching.planes import SPAN

TILE = (16 * SIDE, 128 * SIDE)  # cells (rows, columns) that are laid out at a time
ROWS = 16 * SPAN  # of the pooled field whose maxima are taken at a time
WIDE = SPAN * SPAN
MOST_BLOCKS = 4096  # of 8 x 8 cells, 60 m square: above, blocks of 64 x 64 are bounded first


class CoarseMap:
    """Maxima of the pooled map over 1, 8 and 64 cells each way, made step by step.

    pitch    m, edge of a pooled cell
    corner   (column, row) of the field's first cell, in pooled cells of the map
    shape    (rows, columns) of the map's extent, pooled; ``margin`` cells lie around it
    planes   as ``planes.bound_blocks`` takes them
    widest   which of them bounds the coarsest blocks of a search
    """

    def __init__(self, cell_map: CellMap, short_term: float, room_m: float = 0.0) -> None:
        """``room_m`` about the map's origin there is room for a search, whatever lives there."""
        config = cell_map.config.matching.whole
        self._cell_map, self._short_term, self._config = cell_map, short_term, config
        self._pool = pooling(cell_map.cell, config.pitch_m)
        self.pitch = self._pool * cell_map.cell
        i0, j0, i1, j1 = cell_map.extent() or (0, 0, 0, 0)
        if i0 < i1:
            room = math.ceil(room_m / (SIDE * cell_map.cell)) * SIDE
            i0, j0, i1, j1 = min(i0, -room), min(j0, -room), max(i1, room), max(j1, room)
        self._extent = i0, j0, i1, j1
        self.shape = ((j1 - j0) // self._pool, (i1 - i0) // self._pool)
        self.margin = math.ceil(config.far_m / self.pitch) + 2
        self.corner = (i0 // self._pool - self.margin, j0 // self._pool - self.margin)
        rows, columns = (-(-(n + 2 * self.margin + 2 * WIDE) // WIDE) * WIDE for n in self.shape)
        self._coarse = np.zeros(self.shape, np.uint8)
        blocks = (self.shape[0] // SPAN + 1) * (self.shape[1] // SPAN + 1)
        widths = (1, SPAN, WIDE) if blocks > MOST_BLOCKS else (1, SPAN)
        self.widest = len(widths) - 1
        self.planes = tuple(np.zeros((w, w, rows // w, columns // w), np.uint8) for w in widths)
        self._todo = self._steps(cell_map)
        self._todo.reverse()

    def _steps(self, cell_map: CellMap) -> list[tuple[str, int, int]]:
        """What there is to do, in order; a tile where nothing lives is left out."""
        i0, j0, i1, j1 = self._extent
        cells = cell_map.cells
        top, left = (j0 >> SHIFT) - int(cells.corner[1]), (i0 >> SHIFT) - int(cells.corner[0])
        steps: list[tuple[str, int, int]] = []
        for j in range(0, j1 - j0, TILE[0]):
            for i in range(0, i1 - i0, TILE[1]):
                row, column = top + (j >> SHIFT), left + (i >> SHIFT)
                down = slice(max(row, 0), max(row + TILE[0] // SIDE, 0))
                tile = down, slice(max(column, 0), max(column + TILE[1] // SIDE, 0))
                if (cells.directory[tile] >= 0).any():
                    steps.append(("tile", j, i))
        rows = self.shape[0]
        steps += [("field", row, min(row + ROWS, rows)) for row in range(0, rows, ROWS)]
        first = (self.margin - SPAN + 1) // SPAN
        last = -(-(self.margin + rows) // SPAN)
        slabs = range(first, last, ROWS // SPAN)
        steps += [("eights", row, min(row + ROWS // SPAN, last)) for row in slabs]
        if self.widest == 2:
            steps += [("wide", row, column) for row in range(SPAN) for column in range(SPAN)]
        return steps

    @property
    def empty(self) -> bool:
        """Whether there is nothing to search in."""
        return 0 in self.shape

    @property
    def ready(self) -> bool:
        """Whether all is laid out."""
        return not self._todo

    def advance(self, budget: Budget) -> None:
        """Lay out what the budget allows."""
        while self._todo and budget.left_ns > 0.0:
            step, a, b = self._todo.pop()
            budget.spend(getattr(self, "_" + step)(a, b, budget.prices))

    def _tile(self, j: int, i: int, prices: BudgetConfig) -> float:
        """Pool a tile of the map; its price."""
        i0, j0, i1, j1 = self._extent
        rows, columns = min(TILE[0], j1 - j0 - j), min(TILE[1], i1 - i0 - i)
        fine = np.zeros((rows, columns), np.uint8)
        field_of(self._cell_map, self._short_term, i0 + i, j0 + j, fine)
        pool = self._pool
        into = np.s_[j // pool : (j + rows) // pool, i // pool : (i + columns) // pool]
        self._coarse[into] = pooled(fine, pool)
        return prices.cell_ns * rows * columns

    def _field(self, row: int, end: int, prices: BudgetConfig) -> float:
        """Put rows of the pooled map in their place."""
        first, last = max(row - 1, 0), min(end + 1, self.shape[0])
        rows = spread(self._coarse[first:last], self._config.beside)[row - first :][: end - row]
        into = np.s_[0, 0, self.margin + row : self.margin + end, self.margin :]
        self.planes[0][into][:, : self.shape[1]] = rows
        return prices.cell_ns * rows.size

    def _eights(self, row: int, end: int, prices: BudgetConfig) -> float:
        """Maxima of 8 x 8 cells, for rows of blocks."""
        source = self.planes[0][0, 0, row * SPAN : end * SPAN + SPAN - 1]
        largest = look_ahead(source, np.zeros_like(source))[: (end - row) * SPAN]
        plane = self.planes[1]
        blocks = largest.reshape(end - row, SPAN, plane.shape[3], SPAN)
        plane[:, :, row:end] = blocks.transpose(1, 3, 0, 2)
        return prices.cell_ns * largest.size

    def _wide(self, row: int, column: int, prices: BudgetConfig) -> float:
        """Maxima of 64 x 64 cells, of one phase of those of 8 x 8."""
        source, plane = self.planes[1][row, column], self.planes[2]
        largest = look_ahead(source, np.zeros_like(source))
        blocks = largest.reshape(plane.shape[2], SPAN, plane.shape[3], SPAN)
        # a cell's phase among 64: of eights times 8, plus that among 8
        plane[row::SPAN, column::SPAN] = blocks.transpose(1, 3, 0, 2)
        return prices.cell_ns * largest.size


def pooled(fine: Bytes, pool: int) -> Bytes:
    """The largest of ``pool`` x ``pool`` neighbouring values."""
    rows, columns = fine.shape
    down = fine.reshape(rows // pool, pool, columns).max(axis=1)
    largest: Bytes = down[:, ::pool].copy()
    for k in range(1, pool):  # both ways at once take forty times as long
        np.maximum(largest, down[:, k::pool], out=largest)
    return largest


def spread(source: Bytes, beside: float) -> Bytes:
    """The source, or ``beside`` times the largest of the eight values around."""
    padded = np.pad(source, 1)
    wide = np.maximum(np.maximum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
    around = np.maximum(np.maximum(wide[:-2], wide[1:-1]), wide[2:])
    return np.maximum(source, (beside * around).astype(np.uint8))


def pooling(cell: float, pitch_m: float) -> int:
    """Cells that are pooled each way, a power of 2."""
    pool = 1
    while pool < SIDE and 2 * pool * cell <= 1.01 * pitch_m:
        pool *= 2
    return pool
