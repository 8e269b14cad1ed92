# SPDX-License-Identifier: Apache-2.0
"""Which part of the plane has been seen: what turns a map of things into a map of free space.

A network of activities stores where something is, not where nothing is. A planner or a map_server
wants both, so whoever writes such a map keeps this beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, Scan
from slam.frontend.visibility import SILENT_M
from slam.strips import MapStrips, Piece, Rectangle, Span, edges, runs

_CHUNK = 512  # cells along a tile: of small ones OpenCV takes as long for each scan and tile
_SHIFT = 4  # bits of the parts of a cell in which OpenCV takes corners
_PARTS = 1 << _SHIFT


class SeenSpace:
    """Accumulates the areas that scans have swept, on cells of ``resolution_m``."""

    def __init__(self, resolution_m: float = 0.05) -> None:
        if not resolution_m > 0.0:
            raise InvalidValueError(f"resolution_m must be > 0 m, got {resolution_m}")
        self.resolution_m = resolution_m
        self._tiles: dict[tuple[int, int], NDArray[np.uint8]] = {}

    def add(self, scan: Scan, T_map_robot: Float) -> None:
        """Mark what ``scan`` saw from ``T_map_robot`` (not de-skewed: a cell more or less).

        As far as returns prove: black surfaces and windows are silent, too, and what returns from
        farther away may have come through a window.
        """
        ranges = scan.ranges.astype(np.float64)
        ranges[~scan.valid] = 0.0  # a beam that was lost, or went on through a window
        ranges = np.minimum(ranges, SILENT_M)
        angles = scan.spec.angles
        rim = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)
        outline = np.vstack([np.zeros((1, 2)), rim])
        T_map_laser = se2.compose(T_map_robot, scan.spec.T_robot_laser)
        cells = se2.transform(T_map_laser, outline) / self.resolution_m
        low = np.floor(cells.min(axis=0) / _CHUNK).astype(int)
        high = np.floor(cells.max(axis=0) / _CHUNK).astype(int)
        fixed = np.round((cells - 0.5) * _PARTS).astype(np.int64)
        for column in range(low[0], high[0] + 1):
            for row in range(low[1], high[1] + 1):
                tile = self._tiles.get((row, column))
                if tile is None:
                    tile = self._tiles[row, column] = np.zeros((_CHUNK, _CHUNK), np.uint8)
                local = fixed - (column * _CHUNK * _PARTS, row * _CHUNK * _PARTS)
                cv2.fillPoly(tile, [local.astype(np.int32)], 1, cv2.LINE_8, _SHIFT)

    def _occupied_tiles(self) -> Iterator[tuple[int, int]]:
        return (key for key, tile in self._tiles.items() if tile.any())

    def merge(self, map_: MapStrips) -> MapStrips:
        """``map_`` with 0 where it was unknown and something has been seen, the unknown rim left
        out.

        Only maps along the map frame's axes. What is seen later is not in it.
        """
        x, y, yaw = map_.T_map_origin.tolist()
        if yaw != 0.0:
            raise InvalidValueError(f"merge needs a map along the map's axes, got yaw {yaw} rad")
        step, size = map_.resolution_m, _CHUNK * self.resolution_m
        height, width = map_.shape
        keys = np.array(list(self._occupied_tiles()), dtype=int).reshape(-1, 2)
        if len(keys) == 0:
            return map_
        corner = np.array([x, y])
        opposite = corner + np.array([width, height]) * step
        low = np.minimum(corner, keys.min(axis=0)[::-1] * size)
        high = np.maximum(opposite, (keys.max(axis=0)[::-1] + 1) * size)
        before = np.ceil((corner - low) / step - 1e-9).astype(int)
        after = np.ceil((high - opposite) / step - 1e-9).astype(int)
        first_row, first_column = int(before[1]), int(before[0])
        shape = height + first_row + int(after[1]), width + first_column + int(after[0])
        origin = corner - before * step
        ours = self._cells(origin[1], shape[0], step), self._cells(origin[0], shape[1], step)
        in_row = {row: np.sort(keys[keys[:, 0] == row, 1]).tolist() for row in set(keys[:, 0])}

        def pieces(first: int, last: int) -> Iterator[Piece]:
            rows, columns = ours[0][first:last], ours[1]
            a, b = max(first, first_row), min(last, first_row + height)
            there = [] if a >= b else map_.pieces(a - first_row, b - first_row)
            known = [(column + first_column, values) for column, values in there]
            seen = list(_tiles_met(rows, columns, in_row))
            spans = [(column, column + values.shape[1]) for column, values in known]
            for left, right in runs(spans + [span for _, _, span in seen]):
                out = np.full((last - first, right - left), np.nan, np.float32)
                for column, values in known:
                    if left <= column < right:
                        end = column - left + values.shape[1]
                        out[a - first : b - first, column - left : end] = values
                for key, (i0, i1), (j0, j1) in seen:
                    if left <= j0 < right:
                        at = np.ix_(rows[i0:i1] % _CHUNK, columns[j0:j1] % _CHUNK)
                        part = out[i0:i1, j0 - left : j1 - left]
                        part[np.isnan(part) & (self._tiles[key][at] != 0)] = 0.0
                yield left, out

        T_map_origin = np.array([*origin, 0.0])
        whole = MapStrips(
            shape=shape,
            resolution_m=step,
            T_map_origin=T_map_origin,
            pieces=pieces,
            extent=lambda: _around(
                self._extent(ours, in_row), map_.known(), first_row, first_column
            ),
        )
        return whole.trimmed() or map_

    def _extent(
        self,
        ours: tuple[NDArray[np.int64], NDArray[np.int64]],
        in_row: Mapping[int, Sequence[int]],
    ) -> Rectangle | None:
        """Of what has been seen, in rows and columns of which ``ours`` are our cells."""
        met = {key: spans for key, *spans in _tiles_met(*ours, in_row)}

        def known(row: int, column: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
            (i0, i1), (j0, j1) = met[row, column]
            at = np.ix_(ours[0][i0:i1] % _CHUNK, ours[1][j0:j1] % _CHUNK)
            there = self._tiles[row, column][at] != 0
            return i0 + np.flatnonzero(there.any(axis=1)), j0 + np.flatnonzero(there.any(axis=0))

        return edges(list(met), known)

    def _cells(self, edge: float, count: int, step: float) -> NDArray[np.int64]:
        """Our cells, along one axis, in which the centres of ``count`` others from ``edge`` lie."""
        centres = edge + (np.arange(count) + 0.5) * step
        cells: NDArray[np.int64] = np.floor(centres / self.resolution_m).astype(np.int64)
        return cells


def _around(
    one: Rectangle | None, other: Rectangle | None, rows: int, columns: int
) -> Rectangle | None:
    """The least rectangle around ``one`` and ``other``, moved by ``rows`` and ``columns``."""
    if other is None:
        return one
    other = other[0] + rows, other[1] + columns, other[2] + rows, other[3] + columns
    if one is None:
        return other
    return (
        min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), max(one[3], other[3])
    )  # fmt: skip


def _tiles_met(
    rows: NDArray[np.int64], columns: NDArray[np.int64], in_row: Mapping[int, Sequence[int]]
) -> Iterator[tuple[tuple[int, int], Span, Span]]:
    """Tiles with any of ``rows`` and ``columns`` (rising), and which of these they have."""
    for row in range(int(rows[0]) // _CHUNK, int(rows[-1]) // _CHUNK + 1):
        i0, i1 = np.searchsorted(rows, (row * _CHUNK, (row + 1) * _CHUNK)).tolist()
        for column in in_row.get(row, ()):
            j0, j1 = np.searchsorted(columns, (column * _CHUNK, (column + 1) * _CHUNK)).tolist()
            if i0 < i1 and j0 < j1:
                yield (row, column), (i0, i1), (j0, j1)
