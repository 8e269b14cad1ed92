# SPDX-License-Identifier: Apache-2.0
"""Which part of the plane has been seen: what turns a map of things into a map of free space.

A network of activities stores where something is, not where nothing is. A planner or a map_server
wants both, so whoever writes such a map keeps this beside it.
"""

import math

import cv2
import numpy as np

from slam import se2
from slam.arrays import Bytes, Float, Ints
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import Scan
from slam.frontend.visibility import SILENT_M
from slam.rasters import joined, trimmed

_CHUNK = 512  # cells along a tile: of small ones OpenCV takes as long for each scan and tile
_SHIFT = 4  # bits of the parts of a cell in which OpenCV takes corners
_PARTS = 1 << _SHIFT


class SeenSpace:
    """Accumulates the areas that scans have swept, on cells of ``resolution_m``."""

    def __init__(self, resolution_m: float = 0.05) -> None:
        if not resolution_m > 0.0:
            raise InvalidValueError(f"resolution_m must be > 0 m, got {resolution_m}")
        self.resolution_m = resolution_m
        self._tiles: dict[tuple[int, int], Bytes] = {}

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

    def merge(self, map_: Raster, most: float = math.inf) -> Raster:
        """``map_`` with 0 where it was unknown and something has been seen, the unknown rim left
        out; in cells so much wider that it has ``most`` at most.

        Only maps along the map frame's axes. What is seen later is not in it.
        """
        yaw = float(map_.T_map_origin[2])
        if yaw != 0.0:
            raise InvalidValueError(f"merge needs a map along the map's axes, got yaw {yaw} rad")
        keys = np.array([key for key, tile in self._tiles.items() if tile.any()], dtype=int)
        if len(keys) == 0:
            return map_
        n = 1
        origin, before, (width, height) = self._around(map_, n, keys)
        while width * height > most:
            n += 1
            origin, before, (width, height) = self._around(map_, n, keys)
        known = joined(map_, n).values
        out = np.full((height, width), np.nan, np.float32)
        out[before[1] :, before[0] :][: known.shape[0], : known.shape[1]] = known
        step = n * map_.resolution_m
        rows, columns = self._cells(origin[1], height, step), self._cells(origin[0], width, step)
        for row, column in keys.tolist():
            (i0, i1), (j0, j1) = (
                np.searchsorted(ours, (tile * _CHUNK, (tile + 1) * _CHUNK)).tolist()
                for ours, tile in ((rows, row), (columns, column))
            )
            at = np.ix_(rows[i0:i1] % _CHUNK, columns[j0:j1] % _CHUNK)
            part = out[i0:i1, j0:j1]
            part[np.isnan(part) & (self._tiles[row, column][at] != 0)] = 0.0
        T_map_origin = np.array([*origin, 0.0])
        return trimmed(Raster(values=out, resolution_m=step, T_map_origin=T_map_origin)) or map_

    def _around(self, map_: Raster, n: int, keys: Ints) -> tuple[Float, Ints, list[int]]:
        """Of cells ``n`` times as wide as the map's around it and the tiles ``keys``: origin (2,)
        m, how many (2,) lie before the map, and how many there are along x and y.
        """
        step, size = n * map_.resolution_m, _CHUNK * self.resolution_m
        inner = -(-np.array(map_.values.shape[::-1]) // n)
        corner = map_.T_map_origin[:2]
        opposite = corner + inner * step
        low = np.minimum(corner, keys.min(axis=0)[::-1] * size)
        high = np.maximum(opposite, (keys.max(axis=0)[::-1] + 1) * size)
        before = np.ceil((corner - low) / step - 1e-9).astype(int)
        after = np.ceil((high - opposite) / step - 1e-9).astype(int)
        return corner - before * step, before, (before + inner + after).tolist()

    def _cells(self, edge: float, count: int, step: float) -> Ints:
        """Our cells, along one axis, in which the centres of ``count`` others from ``edge`` lie."""
        centres = edge + (np.arange(count) + 0.5) * step
        cells: Ints = np.floor(centres / self.resolution_m).astype(np.int64)
        return cells
