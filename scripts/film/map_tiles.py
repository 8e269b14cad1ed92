# SPDX-License-Identifier: Apache-2.0
"""A growing map as small pictures of its parts, coarser as more of it is seen at once.

What a film needs of a map is as large as the film, however large the map is: tiles hold the
largest value of several cells each, and only those that changed are made again.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam.estimate import Raster
from slam.frames import Float
from slam.strips import join

Bounds = tuple[float, float, float, float]
Levels = NDArray[np.uint8]
_SLACK = 1e-6  # pixels; an edge so near to that of a pixel is there
TILE = 128  # pixels of a side
LEAST_PX = 0.5  # of the view for a pixel of a tile; smaller ones are joined, two by two


class LevelMap(NamedTuple):
    """A map in 256 levels: (height, width), m a pixel, pose of the outer corner of the first."""

    levels: Levels
    resolution_m: float
    T_map_origin: Float


def levels_of(raster: Raster) -> LevelMap:
    """A whole map so."""
    return LevelMap(_levels(raster.values), raster.resolution_m, raster.T_map_origin)


class MapTiles:
    """``cells`` a side make one pixel of a tile: a power of two that only grows."""

    def __init__(self) -> None:
        self.cells = 1
        self._cell_m = 0.0
        self._tiles: dict[tuple[int, int], Levels] = {}

    def fit(self, scale: float) -> None:
        """Join pixels until each is at least half a pixel of a view of ``scale`` px a metre."""
        while self._tiles and self.cells * self._cell_m * scale < LEAST_PX:
            self._coarsen()

    def aligned(self, bounds: Bounds) -> Bounds:
        """``bounds`` (m) grown to whole pixels of the tiles."""
        step = self.cells * self._cell_m
        if step == 0.0:
            return bounds
        low = [math.floor(edge / step + _SLACK) * step for edge in bounds[:2]]
        high = [math.ceil(edge / step - _SLACK) * step for edge in bounds[2:]]
        return low[0], low[1], high[0], high[1]

    def put(self, raster: Raster) -> None:
        """Replace what is there by ``raster``, along the map's axes and in cells of one size.

        Pixels that it covers in part keep no more than that part: ask for ``aligned`` bounds.
        """
        self._cell_m = raster.resolution_m
        x, y, _ = raster.T_map_origin.tolist()
        columns = math.floor(x / self._cell_m + 0.5)
        rows = math.floor(y / self._cell_m + 0.5)
        n, (height, width) = self.cells, raster.values.shape
        top, left = rows // n, columns // n
        shape = (rows + height - 1) // n - top + 1, (columns + width - 1) // n - left + 1
        largest = np.full(shape, np.nan, np.float32)
        join(largest, raster.values, n, rows - top * n, columns - left * n)
        self._paste(_levels(largest), top, left)

    def empty(self, bounds: Bounds) -> bool:
        """Whether nothing is to be seen within ``bounds``, m."""
        step = self.cells * self._cell_m
        if step == 0.0:
            return True
        j0, i0 = (math.floor(edge / step + _SLACK) for edge in bounds[:2])
        j1, i1 = (math.ceil(edge / step - _SLACK) for edge in bounds[2:])
        for a in range(i0 // TILE, (i1 - 1) // TILE + 1):
            for b in range(j0 // TILE, (j1 - 1) // TILE + 1):
                tile = self._tiles.get((a, b))
                rows = slice(max(i0 - a * TILE, 0), i1 - a * TILE)
                columns = slice(max(j0 - b * TILE, 0), j1 - b * TILE)
                if tile is not None and tile[rows, columns].any():
                    return False
        return True

    def whole(self) -> LevelMap | None:
        """All tiles as one; None before the first."""
        if not self._tiles:
            return None
        rows = [row for row, _ in self._tiles]
        columns = [column for _, column in self._tiles]
        top, left = min(rows), min(columns)
        size = (max(rows) - top + 1) * TILE, (max(columns) - left + 1) * TILE
        levels = np.zeros(size, np.uint8)
        for (row, column), tile in self._tiles.items():
            i, j = (row - top) * TILE, (column - left) * TILE
            levels[i : i + TILE, j : j + TILE] = tile
        step = self.cells * self._cell_m
        origin = np.array([left * TILE * step, top * TILE * step, 0.0])
        return LevelMap(levels, step, origin)

    def _paste(self, levels: Levels, row: int, column: int) -> None:
        height, width = levels.shape
        for a in range(row // TILE, (row + height - 1) // TILE + 1):
            for b in range(column // TILE, (column + width - 1) // TILE + 1):
                i0, i1 = max(row, a * TILE), min(row + height, (a + 1) * TILE)
                j0, j1 = max(column, b * TILE), min(column + width, (b + 1) * TILE)
                part = levels[i0 - row : i1 - row, j0 - column : j1 - column]
                if (a, b) not in self._tiles and not part.any():
                    continue
                tile = self._tiles.setdefault((a, b), np.zeros((TILE, TILE), np.uint8))
                tile[i0 - a * TILE : i1 - a * TILE, j0 - b * TILE : j1 - b * TILE] = part

    def _coarsen(self) -> None:
        before, self._tiles = self._tiles, {}
        self.cells *= 2
        half = TILE // 2
        for (row, column), tile in before.items():
            small = tile.reshape(half, 2, half, 2).max(axis=(1, 3))
            at = row // 2, column // 2
            made = self._tiles.setdefault(at, np.zeros((TILE, TILE), np.uint8))
            i, j = (row % 2) * half, (column % 2) * half
            made[i : i + half, j : j + half] = small


def _levels(values: NDArray[np.float32]) -> Levels:
    return (np.fmax(values, np.float32(0.0)) * np.float32(255.0)).astype(np.uint8)  # NaN: 0
