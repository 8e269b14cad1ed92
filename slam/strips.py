# SPDX-License-Identifier: Apache-2.0
"""Maps too large to be held as one raster: read a strip at a time, and only where they have cells.

A robot that drives a kilometre leaves few cells in a large rectangle. Whoever writes or draws such
a map asks for one strip of rows after another. Memory is that of a strip, however large the map is,
and time follows the cells that are there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.checked import pose
from slam.errors import InvalidValueError
from slam.estimate import SQUARE, MapSquares, Raster
from slam.frames import Float

STRIP_CELLS = 1 << 20  # of a strip, 4 MiB: about what is held at a time
_BAND = 64  # rows of a square that are asked for at once
_WHOLE = 1e-6  # cells; so near to a whole number is one
Cells = NDArray[np.float32]
Piece = tuple[int, Cells]
Bounds = tuple[float, float, float, float]
Span = tuple[int, int]


@dataclass(frozen=True, kw_only=True, eq=False)
class MapStrips:
    """A map of which some rows can be had at a time.

    shape         (height, width) in cells;  resolution_m, T_map_origin  as of ``Raster``
    pieces        of a first and a past-the-last row, what is known there: (first column, values)
                  of disjoint pieces, lowest column first; the values, all rows high, are those of a
                  ``Raster`` and not to be changed. Row 0 is the lowest y
    """

    shape: tuple[int, int]
    resolution_m: float
    T_map_origin: Float
    pieces: Callable[[int, int], Iterable[Piece]]

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "T_map_origin", pose("MapStrips", "T_map_origin", self.T_map_origin)
        )

    def strips(self) -> Iterator[Span]:
        """First and past-the-last row of each strip, lowest y first."""
        height, width = self.shape
        step = max(STRIP_CELLS // max(width, 1), 1)
        for first in range(0, height, step):
            yield first, min(first + step, height)

    def whole(self) -> Raster:
        """All of it, for what is known to be small."""
        values = np.full(self.shape, np.nan, np.float32)
        for first, last in self.strips():
            for column, piece in self.pieces(first, last):
                values[first:last, column : column + piece.shape[1]] = piece
        return Raster(values=values, resolution_m=self.resolution_m, T_map_origin=self.T_map_origin)

    def joined(self, n: int) -> MapStrips:
        """The same in cells ``n`` times as wide, each the largest of several: a thin wall stays."""
        if n < 1:
            raise InvalidValueError(f"cells are joined in blocks of >= 1 a side, got {n}")
        if n == 1:
            return self
        height, width = self.shape
        across = math.ceil(width / n)
        step = max(STRIP_CELLS // (n * width), 1)

        def pieces(first: int, last: int) -> Iterator[Piece]:
            out = np.full((last - first, across), np.nan, np.float32)
            for a in range(first, last, step):
                b = min(a + step, last)
                for column, piece in self.pieces(a * n, min(b * n, height)):
                    small = _joined(piece, n, column % n)
                    at = column // n
                    part = out[a - first : b - first, at : at + small.shape[1]]
                    np.fmax(part, small, out=part)
            yield 0, out

        return MapStrips(
            shape=(math.ceil(height / n), across),
            resolution_m=n * self.resolution_m,
            T_map_origin=self.T_map_origin,
            pieces=pieces,
        )

    def within(self, most_cells: int) -> MapStrips:
        """The same in the smallest such cells of which there are at most ``most_cells``."""
        n = 1
        while math.ceil(self.shape[0] / n) * math.ceil(self.shape[1] / n) > most_cells:
            n += 1
        return self.joined(n)

    def known(self) -> tuple[int, int, int, int] | None:
        """First row and column, past-the-last row and column with anything known; None for none."""
        height, width = self.shape
        in_rows, in_columns = np.zeros(height, np.bool_), np.zeros(width, np.bool_)
        for first, last in self.strips():
            for column, piece in self.pieces(first, last):
                there = ~np.isnan(piece)
                in_rows[first:last] |= there.any(axis=1)
                in_columns[column : column + piece.shape[1]] |= there.any(axis=0)
        rows, columns = np.flatnonzero(in_rows), np.flatnonzero(in_columns)
        if len(rows) == 0:
            return None
        return int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1

    def cut(self, rectangle: tuple[int, int, int, int]) -> MapStrips:
        """A part of it; rows and columns as of ``known``."""
        low, left, high, right = rectangle

        def pieces(first: int, last: int) -> Iterator[Piece]:
            for column, piece in self.pieces(low + first, low + last):
                a, b = max(column, left), min(column + piece.shape[1], right)
                if a < b:
                    yield a - left, piece[:, a - column : b - column]

        return MapStrips(
            shape=(high - low, right - left),
            resolution_m=self.resolution_m,
            T_map_origin=self._corner(low, left),
            pieces=pieces,
        )

    def _corner(self, row: int, column: int) -> Float:
        """The pose of a cell's outer corner."""
        x, y, yaw = self.T_map_origin.tolist()
        cell = self.resolution_m
        across, up = x / cell, y / cell
        if yaw == 0.0 and max(abs(across - round(across)), abs(up - round(up))) < _WHOLE:
            # whole cells from the map's origin: a product has not the error of a sum
            return np.array([(round(across) + column) * cell, (round(up) + row) * cell, 0.0])
        return se2.compose(self.T_map_origin, np.array([column * cell, row * cell, 0.0]))


def of_raster(raster: Raster) -> MapStrips:
    """A map that is there as a whole."""
    height, width = raster.values.shape
    return MapStrips(
        shape=(height, width),
        resolution_m=raster.resolution_m,
        T_map_origin=raster.T_map_origin,
        pieces=lambda first, last: [(0, raster.values[first:last])],
    )


def of_parts(part: Callable[[Bounds], Raster | None], squares: MapSquares) -> MapStrips | None:
    """A map that is had in parts (``MapsInParts``), asked for only where ``squares`` has one.

    None for no squares. The map must not change as long as this is used.
    """
    places, cell = squares.places, squares.resolution_m
    if len(places) == 0:
        return None
    low, left = places.min(axis=0).tolist()
    high, right = (places.max(axis=0) + 1).tolist()

    @lru_cache(maxsize=2)  # strips begin and end within bands
    def band(number: int) -> list[Piece]:
        row = low * SQUARE + number * _BAND
        found = []
        for a, b in runs([(j, j + 1) for j in places[places[:, 0] == row // SQUARE, 1].tolist()]):
            cells = (a * SQUARE, row, b * SQUARE, row + _BAND)
            raster = part((cells[0] * cell, row * cell, cells[2] * cell, (row + _BAND) * cell))
            if raster is not None:
                found.append(((a - left) * SQUARE, _within(raster, cells)))
        return found

    origin = np.array([left * SQUARE * cell, low * SQUARE * cell, 0.0])
    shape = (high - low) * SQUARE, (right - left) * SQUARE
    return MapStrips(
        shape=shape, resolution_m=cell, T_map_origin=origin, pieces=partial(_stacked, band)
    )


def runs(spans: Iterable[Span]) -> list[Span]:
    """Spans (first, past the last) that meet or overlap as one, in rising order."""
    found: list[Span] = []
    for first, last in sorted(spans):
        if found and first <= found[-1][1]:
            found[-1] = found[-1][0], max(last, found[-1][1])
        else:
            found.append((first, last))
    return found


def _stacked(band: Callable[[int], list[Piece]], first: int, last: int) -> Iterator[Piece]:
    """The rows of several bands, as pieces that are all rows high."""
    bands = [(n * _BAND, band(n)) for n in range(first // _BAND, (last - 1) // _BAND + 1)]
    spans = runs((c, c + v.shape[1]) for _, pieces in bands for c, v in pieces)
    for left, right in spans:
        out = np.full((last - first, right - left), np.nan, np.float32)
        for row, pieces in bands:
            a, b = max(first, row), min(last, row + _BAND)
            for column, values in pieces:
                if left <= column < right:
                    at = column - left
                    out[a - first : b - first, at : at + values.shape[1]] = values[
                        a - row : b - row
                    ]
        yield left, out


def _within(part: Raster, cells: tuple[int, int, int, int]) -> Cells:
    """What of ``part`` lies within first column and row, past-the-last column and row; NaN where it
    has nothing to say."""
    values = np.full((cells[3] - cells[1], cells[2] - cells[0]), np.nan, np.float32)
    x, y, _ = part.T_map_origin.tolist()
    j0, i0 = round(x / part.resolution_m), round(y / part.resolution_m)
    height, width = part.values.shape
    j_low, i_low = max(cells[0], j0), max(cells[1], i0)
    j_high, i_high = min(cells[2], j0 + width), min(cells[3], i0 + height)
    if j_low < j_high and i_low < i_high:
        inside = part.values[i_low - i0 : i_high - i0, j_low - j0 : j_high - j0]
        values[i_low - cells[1] : i_high - cells[1], j_low - cells[0] : j_high - cells[0]] = inside
    return values


def _joined(values: Cells, n: int, before: int) -> Cells:
    """The largest of each ``n`` x ``n``, the first block beginning ``before`` columns earlier."""
    height, width = values.shape
    margins = ((0, -height % n), (before, -(width + before) % n))
    padded = np.pad(values, margins, constant_values=np.nan)
    height, width = padded.shape
    blocks = padded.reshape(height // n, n, width // n, n)
    joined: Cells = np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1)
    return joined
