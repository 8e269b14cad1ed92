# SPDX-License-Identifier: Apache-2.0
"""How well a map tells what is there now, judged against the simulation while it is being made.

A map is laid into the world by the robot's true first pose, so drift counts. A cell is occupied
above 0.5. Judged once a second:

ghost_rate         share of occupied cells with nothing within ``NEAR_M``: neither what never moves
                   nor a mover's hull
new_object_recall  of what stands for 2 s at a new place, was seen in 5 scans and lately: the share
                   that the map holds (half its hits within ``REACH_M`` of an occupied cell)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scripts.comparison.recording import Recording
from scripts.comparison.sight import Places, Sight, clearance
from slam import se2
from slam.frames import NS_PER_S, Float
from slam.system import Raster

EVERY_S = 1.0
NEAR_M = 0.15
REACH_M = 0.06  # drift of a good SLAM and a cell; more would hold a place by what little is left
BELIEVED = 0.5


class StaticDistance:
    """m from points in the world to the nearest cell that is static; infinite off the map."""

    def __init__(self, raster: Raster) -> None:
        free = (raster.values < 0.5).astype(np.uint8)
        self._metres = cv2.distanceTransform(free, cv2.DIST_L2, 5) * raster.resolution_m
        self._raster = raster

    def __call__(self, points: Float) -> Float:
        """(n,) of points (n, 2)."""
        return _sampled(self._metres, self._raster, points, math.inf)


def _sampled(values: NDArray[Any], raster: Raster, points: Float, outside: float) -> Float:
    inside, rows, columns = _cells(raster, points)
    out = np.full(len(points), outside)
    out[inside] = values[rows, columns]
    return out


def _cells(
    raster: Raster, points: Float
) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64]]:
    """(n,) which points (n, 2) m are on a raster, and of those the rows and columns."""
    cells = np.floor((points - raster.T_map_origin[:2]) / raster.resolution_m).astype(np.int64)
    height, width = raster.values.shape
    inside = np.asarray((cells >= 0).all(axis=1) & (cells < (width, height)).all(axis=1))
    return inside, cells[inside, 1], cells[inside, 0]


def disc(radius_m: float, cell_m: float) -> NDArray[np.uint8]:
    """Footprint of a dilation by that many metres, its own cell at least."""
    n = int(radius_m / cell_m + 1e-9)
    y, x = np.mgrid[-n : n + 1, -n : n + 1]
    inside: NDArray[np.bool_] = (x * x + y * y) * cell_m * cell_m <= radius_m * radius_m + 1e-9
    return inside.astype(np.uint8)


class Believed:
    """A map, asked in world coordinates."""

    def __init__(self, raster: Raster, T_world_map: Float) -> None:
        self._raster, self._T_world_map = raster, T_world_map
        self._T_map_world = se2.inverse(T_world_map)
        self._reach = cv2.dilate(np.nan_to_num(raster.values), disc(REACH_M, raster.resolution_m))

    def occupied(self) -> Float:
        """(n, 2) m in the world: the centres of the occupied cells."""
        raster = self._raster
        row, column = np.nonzero(raster.values > BELIEVED)  # False for NaN
        cells = np.stack([column + 0.5, row + 0.5], axis=1) * raster.resolution_m
        return se2.transform(self._T_world_map, cells + raster.T_map_origin[:2])

    def holds(self, points: Float) -> bool:
        """Whether half of points (n, 2) m in the world have an occupied cell within reach."""
        in_map = se2.transform(self._T_map_world, points)
        return bool((_sampled(self._reach, self._raster, in_map, 0.0) > BELIEVED).mean() >= 0.5)


class MapJudge:
    """Watches a recording beside a SLAM and scores its maps."""

    def __init__(self, drive: Recording) -> None:
        self._drive = drive
        stamps = drive.truth().stamps_ns
        self._seconds = (stamps - stamps[0]) / NS_PER_S
        self._per_s = (len(stamps) - 1) / max(float(self._seconds[-1]), 1e-9)
        self._static = StaticDistance(drive.static_map)
        self._places = Places(drive, self._static)
        self._next_s = EVERY_S
        self._ghosts: list[float] = []
        self._found: list[bool] = []

    def look(self, k: int) -> None:
        """Take in scan k, before the map after it is judged."""
        self._places.look(k, Sight(self._drive, k))

    def wants(self, k: int) -> bool:
        """Whether the map after scan k is to be judged."""
        return float(self._seconds[k]) >= self._next_s

    def judge(self, k: int, raster: Raster | None) -> None:
        """Score the map after scan k; None for a SLAM without."""
        if raster is None:
            return
        T_world_map = self._drive.frames[0].truth
        assert T_world_map is not None
        believed = Believed(raster, T_world_map)
        self._next_s += EVERY_S
        self._ghosts.append(self._ghost_rate(believed.occupied(), k))
        new = self._places.new_objects(k, self._per_s)
        self._found += [believed.holds(points) for points in new]

    def scores(self) -> dict[str, Any]:
        """The columns ``MAPS``; nothing for a SLAM without maps."""
        if not self._ghosts:
            return {}
        return {
            "ghost_rate": _mean(self._ghosts),
            "new_object_recall": _mean(self._found),
            "new_objects": len(self._found),
        }

    def _ghost_rate(self, occupied: Float, k: int) -> float:
        """Of the occupied cells: those with nothing near."""
        if len(occupied) == 0:
            return 0.0
        alone = occupied[self._static(occupied) > NEAR_M]
        alone = alone[clearance(alone, self._drive, k) > NEAR_M]
        return len(alone) / len(occupied)


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None
