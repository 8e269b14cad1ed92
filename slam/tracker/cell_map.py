# SPDX-License-Identifier: Apache-2.0
"""A map of cells: an unbounded plane, stored where something was seen.

Cells lie on a square lattice; cell (i, j) is centred at ((i + 0.5) cell, (j + 0.5) cell). They are
pooled in blocks of 8 x 8; a directory maps a block's place to its slot in the pool.
"""

import abc
import copy
import math
from typing import Any, Self

import numpy as np

from slam._jit import uncounted
from slam.arrays import Float, Float32, Int32
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frontend.visibility import View
from slam.tracker.cells import (
    FIRST,
    MOST_OFF,
    SIDE,
    Cells,
    Look,
    living,
    no_cells,
    released,
    used,
    with_room,
)  # fmt: skip
from slam.tracker.config import TrackerConfig
from slam.tracker.windows import dense

MAX_BLOCKS_ACROSS = 1 << 15  # directory edge; 7.8 km at 3 cm cells
MAX_DIRECTORY = 1 << 26  # entries, 256 MiB: 1.9 km square
MAX_CELLS = 1 << 26  # of a raster, 256 MiB: 245 m square at 3 cm; a larger map has wider cells


@uncounted
def _release(arrays: tuple[Any, ...]) -> None:
    released(Cells(*arrays))


class CellMap(abc.ABC):
    """Holds the arrays and keeps them large enough.

    A SLAM's own map says in ``integrate`` how a scan is taken in.

    off_cm  cm, ``Cells.off`` of what becomes long known now
    """

    off_cm = MOST_OFF

    def __init__(self, config: TrackerConfig) -> None:
        self.config = config
        self.cell = config.cell_m
        self.cells = no_cells()

    def begun_like(self, other: "CellMap | None") -> Self:
        """This map, in which nothing lives yet, with room for as much as lives in another: growing
        takes as long as drawing."""
        if other is not None:
            self.cells = no_cells(max(used(other.cells), FIRST), len(other.cells.touched))
        return self

    def pace(self, step: float) -> float:
        """Prior age, s, of a cell whose looks are ``step`` s long: its first do not count fully."""
        return max(self.config.trace_s, self.config.map.pace_looks * step)

    def twin(self) -> Self:
        """A copy that can be written without this one."""
        other = copy.copy(self)
        other.cells = Cells(*[array.copy() for array in self.cells])  # type: ignore[arg-type]
        return other

    def cover(self, xmin: float, ymin: float, xmax: float, ymax: float) -> None:
        """Grow the directory so that blocks may be born anywhere in the rectangle (m)."""
        size, first = SIDE * self.cell, self.cells.corner
        shape = np.array(self.cells.directory.shape[::-1])
        last = first + shape
        low = np.minimum(first, np.floor(np.array([xmin, ymin]) / size).astype(np.int64) - 1)
        high = np.maximum(last, np.floor(np.array([xmax, ymax]) / size).astype(np.int64) + 2)
        if (low == first).all() and (high == last).all():
            return
        # Grow by half of the present extent on the side that asks, so that growing stays rare.
        low = np.where(low < first, low - shape // 2, first)
        high = np.where(high > last, high + shape // 2, last)
        across, along = (high - low).tolist()
        if max(across, along) > MAX_BLOCKS_ACROSS or across * along > MAX_DIRECTORY:
            raise InvalidValueError(
                f"the map would be {across * size:.0f} m x {along * size:.0f} m across; "
                f"cell_m = {self.cell} is too small for this stream, or its poses jump"
            )
        grown = np.full((along, across), -1, np.int32)
        (i, j), (columns, rows) = (first - low).tolist(), shape.tolist()
        grown[j : j + rows, i : i + columns] = self.cells.directory
        self.cells = self.cells._replace(directory=grown, corner=low)

    def grow(self) -> None:
        """Make room where a kernel ran out of it."""
        self.cells = with_room(self.cells)

    def release(self) -> None:
        """Forget the present impressions, and the blocks that were born under them in vain."""
        _release(tuple(self.cells))

    def kept(self, slots: Int32) -> Float32:
        """(n, 8, 8) what a file keeps as ``age``."""
        return self.cells.age[slots]

    def restore(self, slot: int, kept: Float32) -> None:
        """Let a block of a file have what ``kept`` gave."""
        self.cells.age[slot] = kept

    @abc.abstractmethod
    def integrate(
        self,
        view: View,
        T_map_laser: Float,
        step: float,
        *,
        write: bool,
    ) -> Look:
        """Take the present impressions in for ``step`` s; ``write`` False only looks."""

    def window(self, xmin: float, ymin: float, xmax: float, ymax: float) -> tuple[Float32, Float32]:
        """Dense short-term x and long-term y of the cells whose centres lie in the rectangle (m).

        Row 0 is the lowest y. Both are 0 where nothing lives.
        """
        slack = 1e-6  # cells: an edge on a centre counts as reaching it
        i0 = math.ceil(xmin / self.cell - 0.5 - slack)
        j0 = math.ceil(ymin / self.cell - 0.5 - slack)
        shape = (
            max(0, math.floor(ymax / self.cell - 0.5 + slack) - j0 + 1),
            max(0, math.floor(xmax / self.cell - 0.5 + slack) - i0 + 1),
        )
        return dense(self.cells, i0, j0, shape)

    def extent(self) -> tuple[int, int, int, int] | None:
        """First and past-the-last cell index (i0, j0, i1, j1) of the living blocks."""
        _, places = living(self.cells)
        if len(places) == 0:
            return None
        (i0, j0), (i1, j1) = places.min(axis=0).tolist(), (places.max(axis=0) + 1).tolist()
        return i0 * SIDE, j0 * SIDE, i1 * SIDE, j1 * SIDE

    def coarseness(self, extent: tuple[int, int, int, int]) -> int:
        """How many cells a side are one in a raster of ``extent``, so that it has ``MAX_CELLS``."""
        i0, j0, i1, j1 = extent
        n = 1
        while -(-(i1 - i0) // n) * -(-(j1 - j0) // n) > MAX_CELLS:
            n += 1
        return n

    def raster(self, values: Float32, extent: tuple[int, int, int, int], n: int = 1) -> Raster:
        """``values`` of the cells of ``extent``, ``n`` a side as one."""
        origin = np.array([extent[0] * self.cell, extent[1] * self.cell, 0.0])
        return Raster(values=values, resolution_m=n * self.cell, T_map_origin=origin)

    def bytes_per_neuron(self) -> float:
        """Bytes of every array, unused slots and directory included, per cell that is alive."""
        slots, _ = living(self.cells)
        alive = (self.cells.x[slots] != 0.0) | (self.cells.y[slots] != 0.0)
        return sum(array.nbytes for array in self.cells) / max(int(alive.sum()), 1)
