# SPDX-License-Identifier: Apache-2.0
"""Maps too large to be held as one raster: read a strip at a time, and only where they have cells.

A robot that drives a kilometre leaves few cells in a large rectangle. Whoever writes or draws such
a map asks for one strip of rows after another. Memory is that of a strip, however large the map is,
and time follows the cells that are there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam._jit import njit
from slam.checked import pose, set_fields
from slam.errors import InvalidValueError
from slam.estimate import SQUARE, MapSquares, Raster
from slam.frames import Float

STRIP_CELLS = 1 << 20  # of a strip, 4 MiB: about what is held at a time
_BAND = 128  # rows of a square that are asked for at once
_WHOLE = 1e-6  # cells; so near to a whole number is one
Cells = NDArray[np.float32]
Piece = tuple[int, Cells]
Bounds = tuple[float, float, float, float]
Span = tuple[int, int]
Rectangle = tuple[int, int, int, int]  # first row and column, past-the-last row and column


@dataclass(frozen=True, kw_only=True, eq=False)
class MapStrips:
    """A map of which some rows can be had at a time.

    shape         (height, width) in cells;  resolution_m, T_map_origin  as of ``Raster``
    pieces        of a first and a past-the-last row, what is known there: (first column, values)
                  of disjoint pieces, lowest column first; the values, all rows high, are those of a
                  ``Raster`` and not to be changed. Row 0 is the lowest y
    extent        what ``known`` returns, where that can be had without reading all
    """

    shape: tuple[int, int]
    resolution_m: float
    T_map_origin: Float
    pieces: Callable[[int, int], Iterable[Piece]]
    extent: Callable[[], Rectangle | None] | None = None

    def __post_init__(self) -> None:
        set_fields(self, T_map_origin=pose("MapStrips", "T_map_origin", self.T_map_origin))

    def strips(self, low: int = 0, high: int | None = None) -> Iterator[Span]:
        """First and past-the-last row of each strip of rows ``low`` to before ``high``, lowest y
        first."""
        height, width = self.shape
        high = height if high is None else high
        step = max(STRIP_CELLS // max(width, 1), 1)
        for first in range(low, high, step):
            yield first, min(first + step, high)

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

        def pieces(first: int, last: int) -> Iterator[Piece]:
            out = np.full((last - first, across), np.nan, np.float32)
            for low, high in self.strips(first * n, min(last * n, height)):
                for column, piece in self.pieces(low, high):
                    join(out, piece, n, low - first * n, column)
            yield 0, out

        return MapStrips(
            shape=(math.ceil(height / n), across),
            resolution_m=n * self.resolution_m,
            T_map_origin=self.T_map_origin,
            pieces=pieces,
            extent=lambda: _in_blocks(self.known(), n),
        )

    def known(self) -> Rectangle | None:
        """First row and column, past-the-last row and column with anything known; None for none."""
        return self._known

    @cached_property
    def _known(self) -> Rectangle | None:
        if self.extent is not None:
            return self.extent()
        height, width = self.shape
        in_rows = np.zeros(height, np.bool_)
        left, right = width, 0
        for first, last in self.strips():
            for column, piece in self.pieces(first, last):
                there = ~np.isnan(piece)
                in_rows[first:last] |= there.any(axis=1)
                if column < left or column + piece.shape[1] > right:
                    found = column + np.flatnonzero(there.any(axis=0))
                    left, right = min([left, *found[:1]]), max([right, *(found[-1:] + 1)])
        rows = np.flatnonzero(in_rows)
        return None if len(rows) == 0 else (int(rows[0]), int(left), int(rows[-1]) + 1, int(right))

    def trimmed(self) -> MapStrips | None:
        """Without its unknown rim; None where nothing is known."""
        known = self.known()
        if known is None:
            return None
        inner = self.cut(known)
        return replace(inner, extent=lambda: (0, 0, *inner.shape))

    def cut(self, rectangle: Rectangle) -> MapStrips:
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
    layers = of_layers(lambda bounds: (part(bounds),), 1, squares)
    return None if layers is None else layers[0]


def of_layers(
    part: Callable[[Bounds], Sequence[Raster | None]], count: int, squares: MapSquares
) -> tuple[MapStrips, ...] | None:
    """The same of ``count`` maps on the same cells, which ``part`` gives at once."""
    places, cell = squares.places, squares.resolution_m
    if len(places) == 0:
        return None
    low, left = places.min(axis=0).tolist()
    high, right = (places.max(axis=0) + 1).tolist()

    @lru_cache(maxsize=2)  # strips begin and end within bands
    def band(number: int) -> list[list[Piece]]:
        row = low * SQUARE + number * _BAND
        found: list[list[Piece]] = [[] for _ in range(count)]
        for a, b in runs([(j, j + 1) for j in places[places[:, 0] == row // SQUARE, 1].tolist()]):
            cells = (a * SQUARE, row, b * SQUARE, row + _BAND)
            bounds = (cells[0] * cell, row * cell, cells[2] * cell, (row + _BAND) * cell)
            for layer, raster in zip(found, part(bounds), strict=True):
                if raster is not None:
                    layer.append(((a - left) * SQUARE, _within(raster, cells)))
        return found

    def strips(layer: int) -> MapStrips:
        return MapStrips(
            shape=((high - low) * SQUARE, (right - left) * SQUARE),
            resolution_m=cell,
            T_map_origin=np.array([left * SQUARE * cell, low * SQUARE * cell, 0.0]),
            pieces=partial(_stacked, lambda number: band(number)[layer]),
            extent=partial(_extent, lambda bounds: part(bounds)[layer], squares),
        )

    return tuple(map(strips, range(count)))


def _in_blocks(rectangle: Rectangle | None, n: int) -> Rectangle | None:
    """The blocks of ``n`` a side that a rectangle of cells meets."""
    if rectangle is None:
        return None
    low, left, high, right = rectangle
    return low // n, left // n, -(-high // n), -(-right // n)


def _extent(part: Callable[[Bounds], Raster | None], squares: MapSquares) -> Rectangle | None:
    """Of what is known in ``squares``, in cells from the lowest row and column of them."""
    places, cell = squares.places, squares.resolution_m
    low, left = places.min(axis=0).tolist()

    def known(row: int, column: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        j, i = column * SQUARE, row * SQUARE
        raster = part((j * cell, i * cell, (j + SQUARE) * cell, (i + SQUARE) * cell))
        there = np.zeros((0, 0), np.bool_)
        if raster is not None:
            there = ~np.isnan(_within(raster, (j, i, j + SQUARE, i + SQUARE)))
        return (
            i - low * SQUARE + np.flatnonzero(there.any(axis=1)),
            j - left * SQUARE + np.flatnonzero(there.any(axis=0)),
        )

    return edges([(row, column) for row, column in places.tolist()], known)


def edges(
    squares: Sequence[tuple[int, int]],
    known: Callable[[int, int], tuple[NDArray[np.int64], NDArray[np.int64]]],
) -> Rectangle | None:
    """First and past-the-last row and column of what is known in squares; only the outer are read.

    known  of a square's row and column: the rows and the columns of cells in which it has anything,
           in rising order
    """
    known = lru_cache(maxsize=None)(known)

    def end(axis: int, last: bool) -> int | None:
        for line in sorted({square[axis] for square in squares}, reverse=last):
            found = [known(*square)[axis] for square in squares if square[axis] == line]
            ends = [int(lines[-1 if last else 0]) for lines in found if len(lines)]
            if ends:
                return max(ends) if last else min(ends)
        return None

    low, left, high, right = end(0, False), end(1, False), end(0, True), end(1, True)
    if low is None or left is None or high is None or right is None:
        return None
    return low, left, high + 1, right + 1


def joined_together(layers: Sequence[MapStrips], n: int) -> list[Raster]:
    """``joined(n).whole()`` of maps on the same cells, read a strip of all of them at a time: what
    they share is made once."""
    height, width = layers[0].shape
    outs = [np.full((-(-height // n), -(-width // n)), np.nan, np.float32) for _ in layers]
    for first, last in layers[0].strips():
        for layer, out in zip(layers, outs, strict=True):
            for column, piece in layer.pieces(first, last):
                join(out, piece, n, first, column)
    return [
        Raster(values=out, resolution_m=n * layer.resolution_m, T_map_origin=layer.T_map_origin)
        for layer, out in zip(layers, outs, strict=True)
    ]


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
    if len(bands) == 1:
        row, pieces = bands[0]
        yield from ((column, values[first - row : last - row]) for column, values in pieces)
        return
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


def _within(part: Raster, cells: Rectangle) -> Cells:
    """What of ``part`` lies within first column and row, past-the-last column and row; NaN where it
    has nothing to say."""
    x, y, _ = part.T_map_origin.tolist()
    j0, i0 = round(x / part.resolution_m), round(y / part.resolution_m)
    height, width = part.values.shape
    if (j0, i0, j0 + width, i0 + height) == cells:
        return part.values
    values = np.full((cells[3] - cells[1], cells[2] - cells[0]), np.nan, np.float32)
    j_low, i_low = max(cells[0], j0), max(cells[1], i0)
    j_high, i_high = min(cells[2], j0 + width), min(cells[3], i0 + height)
    if j_low < j_high and i_low < i_high:
        inside = part.values[i_low - i0 : i_high - i0, j_low - j0 : j_high - j0]
        values[i_low - cells[1] : i_high - cells[1], j_low - cells[0] : j_high - cells[0]] = inside
    return values


def join(out: Cells, values: Cells, n: int, row: int, column: int) -> None:
    """Let each cell of ``out`` be at least as large as those of ``values`` in it, ``n`` a side.

    row, column  of ``values`` in ``out``, in cells of ``values``
    """
    given = np.ascontiguousarray(values).view()
    given.setflags(write=False)  # of one type, for one compiled kernel
    _join(out, given, n, row, column)


@njit
def _join(out: Cells, values: Cells, n: int, row: int, column: int) -> None:
    for a in range(values.shape[0]):
        i, j = (row + a) // n, column // n
        beside = n - column % n  # columns of values before the next of out
        for b in range(values.shape[1]):
            value = values[a, b]
            if not np.isnan(value) and not out[i, j] >= value:  # out may be NaN
                out[i, j] = value
            beside -= 1
            if beside == 0:
                j, beside = j + 1, n
