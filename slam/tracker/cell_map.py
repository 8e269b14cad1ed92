# SPDX-License-Identifier: Apache-2.0
"""A map of cells: an unbounded plane, stored where something was seen.

Cells lie on a square lattice; cell (i, j) is centred at ((i + 0.5) cell, (j + 0.5) cell). They are
pooled in blocks of 8 x 8; a directory maps a block's place to its slot in the pool.
"""

from __future__ import annotations

import abc
import copy
import math
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError
from slam.estimate import SQUARE, MapSquares
from slam.frontend.visibility import View
from slam.tracker.cells import (
    ANEW,
    SIDE,
    Cells,
    Look,
    forget_impressions,
    living,
    no_cells,
    with_room,
)  # fmt: skip
from slam.tracker.config import TrackerConfig
from slam.tracker.windows import dense

MAX_BLOCKS_ACROSS = 1 << 15  # directory edge; 7.8 km at 3 cm cells
MAX_DIRECTORY = 1 << 26  # entries, 256 MiB: 1.9 km square
MAX_CELLS = 1 << 28  # of a raster, 1 GiB a layer: 490 m square at 3 cm cells


class CellMap(abc.ABC):
    """Holds the arrays and keeps them large enough.

    A SLAM's own map says in ``integrate`` how a scan is taken in.
    """

    def __init__(self, config: TrackerConfig) -> None:
        self.config = config
        self.cell = config.cell_m
        self.cells = no_cells()

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
        size = SIDE * self.cell
        rows, columns = self.cells.directory.shape
        cx, cy = (int(v) for v in self.cells.corner)
        low = (min(cx, math.floor(xmin / size) - 1), min(cy, math.floor(ymin / size) - 1))
        high = (
            max(cx + columns, math.floor(xmax / size) + 2),
            max(cy + rows, math.floor(ymax / size) + 2),
        )
        if low == (cx, cy) and high == (cx + columns, cy + rows):
            return
        # Grow by half of the present extent on the side that asks, so that growing stays rare.
        low = (
            low[0] - columns // 2 if low[0] < cx else cx,
            low[1] - rows // 2 if low[1] < cy else cy,
        )
        high = (
            high[0] + columns // 2 if high[0] > cx + columns else cx + columns,
            high[1] + rows // 2 if high[1] > cy + rows else cy + rows,
        )
        across, along = high[0] - low[0], high[1] - low[1]
        if max(across, along) > MAX_BLOCKS_ACROSS or across * along > MAX_DIRECTORY:
            raise InvalidValueError(
                f"the map would be {across * size:.0f} m x {along * size:.0f} m across; "
                f"cell_m = {self.cell} is too small for this stream, or its poses jump"
            )
        grown = np.full((high[1] - low[1], high[0] - low[0]), -1, np.int32)
        grown[cy - low[1] : cy - low[1] + rows, cx - low[0] : cx - low[0] + columns] = (
            self.cells.directory
        )
        self.cells = self.cells._replace(directory=grown, corner=np.array(low, np.int64))

    def grow(self) -> None:
        """Make room where a kernel ran out of it."""
        self.cells = with_room(self.cells)

    def release(self) -> None:
        """Forget the present impressions, and the blocks that were born under them in vain."""
        forget_impressions(self.cells)

    def kept(self, slots: NDArray[np.int32]) -> NDArray[np.float32]:
        """(n, 8, 8) what a file keeps as ``age``."""
        return self.cells.age[slots]

    def restore(self, slot: int, kept: NDArray[np.float32]) -> None:
        """Let a block of a file have what ``kept`` gave."""
        self.cells.age[slot] = kept

    @abc.abstractmethod
    def integrate(
        self,
        view: View,
        T_map_laser: NDArray[np.float64],
        step: float,
        *,
        write: bool,
        counted: NDArray[np.uint8] = ANEW,
    ) -> Look:
        """Take the present impressions in for ``step`` s; ``write`` False only looks.

        ``counted``: (2, S, 8, 8) as of ``cells.uncounted``; by default each look counts anew.
        """

    def window(
        self, xmin: float, ymin: float, xmax: float, ymax: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
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

    def squares(self) -> MapSquares:
        """Where blocks live."""
        _, places = living(self.cells)
        found = np.unique(places[:, ::-1] * SIDE // SQUARE, axis=0)
        return MapSquares(self.cell, found.astype(np.int64))

    def raster_extent(
        self, bounds: tuple[float, float, float, float] | None = None
    ) -> tuple[int, int, int, int] | None:
        """``extent``, or what lies within ``bounds`` (xmin, ymin, xmax, ymax, m), alive or not.

        Raises ``InvalidValueError`` where a raster of it would exceed ``MAX_CELLS``.
        """
        found = self.extent() if bounds is None else self._room()
        if found is not None and bounds is not None:
            low = [math.floor(edge / self.cell) for edge in bounds[:2]]
            high = [math.ceil(edge / self.cell) for edge in bounds[2:]]
            i0, j0 = max(found[0], low[0]), max(found[1], low[1])
            i1, j1 = min(found[2], high[0]), min(found[3], high[1])
            found = (i0, j0, i1, j1) if i0 < i1 and j0 < j1 else None
        if found is not None:
            across, along = found[2] - found[0], found[3] - found[1]
            if across * along > MAX_CELLS:
                raise InvalidValueError(
                    f"the map is {across * self.cell:.0f} m x {along * self.cell:.0f} m; as a "
                    f"raster of {self.cell} m it would have more than {MAX_CELLS} cells"
                )
        return found

    def _room(self) -> tuple[int, int, int, int] | None:
        """Cell indices as of ``extent``, of all places where a block may live."""
        (rows, columns), (i0, j0) = self.cells.directory.shape, self.cells.corner.tolist()
        if not rows or not columns:
            return None
        return i0 * SIDE, j0 * SIDE, (i0 + columns) * SIDE, (j0 + rows) * SIDE

    def bytes_per_neuron(self) -> float:
        """Bytes of every array, unused slots and directory included, per cell that is alive."""
        slots, _ = living(self.cells)
        alive = (self.cells.x[slots] != 0.0) | (self.cells.y[slots] != 0.0)
        return sum(array.nbytes for array in self.cells) / max(int(alive.sum()), 1)
