# SPDX-License-Identifier: Apache-2.0
"""Which part of the plane has been seen: what turns a map of things into a map of free space.

A network of activities stores where something is, not where nothing is. A planner or a map_server
wants both, so whoever writes such a map keeps this beside it.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import Float, Scan
from slam.frontend.config import FRONTEND

# Black or slanted surfaces give no return either: beyond this a silent beam says nothing.
FREE_WITHOUT_RETURN_M = FRONTEND.view.silent_m
_CHUNK = 256


class SeenSpace:
    """Accumulates the areas that scans have swept, on cells of ``resolution_m``."""

    def __init__(self, resolution_m: float = 0.05) -> None:
        if not resolution_m > 0.0:
            raise InvalidValueError(f"resolution_m must be > 0 m, got {resolution_m}")
        self.resolution_m = resolution_m
        self._tiles: dict[tuple[int, int], NDArray[np.uint8]] = {}

    def add(self, scan: Scan, T_map_robot: Float) -> None:
        """Mark what ``scan`` saw from ``T_map_robot`` (not de-skewed: a cell more or less)."""
        ranges = scan.ranges.astype(np.float64)
        ranges[np.isnan(ranges) | (ranges < scan.spec.range_min)] = 0.0
        ranges = np.minimum(ranges, FREE_WITHOUT_RETURN_M)
        angles = scan.spec.angles
        rim = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)
        outline = np.vstack([np.zeros((1, 2)), rim])
        T_map_laser = se2.compose(T_map_robot, scan.spec.T_robot_laser)
        cells = se2.transform(T_map_laser, outline) / self.resolution_m
        low = np.floor(cells.min(axis=0) / _CHUNK).astype(int)
        high = np.floor(cells.max(axis=0) / _CHUNK).astype(int)
        for column in range(low[0], high[0] + 1):
            for row in range(low[1], high[1] + 1):
                tile = self._tiles.setdefault((row, column), np.zeros((_CHUNK, _CHUNK), np.uint8))
                local = cells - (column * _CHUNK + 0.5, row * _CHUNK + 0.5)
                fixed = np.round(local * 16.0).astype(np.int32)
                cv2.fillPoly(tile, [fixed], 1, cv2.LINE_8, 4)

    def _occupied_tiles(self) -> Iterator[tuple[int, int]]:
        return (key for key, tile in self._tiles.items() if tile.any())

    def merge(self, raster: Raster) -> Raster:
        """``raster`` with 0 where it was unknown and something has been seen; at least its extent.

        Only rasters aligned with the map's axes.
        """
        x, y, yaw = raster.T_map_origin.tolist()
        if yaw != 0.0:
            raise InvalidValueError(f"merge needs a raster along the map's axes, got yaw {yaw} rad")
        step, size = raster.resolution_m, _CHUNK * self.resolution_m
        height, width = raster.values.shape
        keys = np.array(list(self._occupied_tiles()), dtype=int).reshape(-1, 2)
        if len(keys) == 0:
            return raster
        corner = np.array([x, y])
        opposite = corner + np.array([width, height]) * step
        low = np.minimum(corner, keys.min(axis=0)[::-1] * size)
        high = np.maximum(opposite, (keys.max(axis=0)[::-1] + 1) * size)
        before = np.ceil((corner - low) / step - 1e-9).astype(int)
        after = np.ceil((high - opposite) / step - 1e-9).astype(int)
        margins = ((int(before[1]), int(after[1])), (int(before[0]), int(after[0])))
        values = np.pad(raster.values, margins, constant_values=np.nan)
        origin = corner - before * step
        seen = self._sample(origin, values.shape, step)
        values[np.isnan(values) & seen] = 0.0
        return _cropped(values, origin, step)

    def _sample(self, origin: Float, shape: tuple[int, ...], step: float) -> NDArray[np.bool_]:
        """(height, width) whether the centre of each cell has been seen."""
        i = np.floor((origin[1] + (np.arange(shape[0]) + 0.5) * step) / self.resolution_m)
        j = np.floor((origin[0] + (np.arange(shape[1]) + 0.5) * step) / self.resolution_m)
        rows, columns = i.astype(int), j.astype(int)
        seen = np.zeros(shape, dtype=np.bool_)
        for (row, column), tile in self._tiles.items():
            a = np.flatnonzero(rows // _CHUNK == row)
            b = np.flatnonzero(columns // _CHUNK == column)
            if len(a) and len(b):
                part = tile[np.ix_(rows[a] % _CHUNK, columns[b] % _CHUNK)]
                seen[np.ix_(a, b)] = part.astype(np.bool_)
        return seen


def _cropped(values: NDArray[np.float32], origin: Float, step: float) -> Raster:
    """Without the empty rim."""
    known = ~np.isnan(values)
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    part = values[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    corner = origin + np.array([columns[0], rows[0]]) * step
    return Raster(values=part, resolution_m=step, T_map_origin=np.array([*corner, 0.0]))
