# SPDX-License-Identifier: Apache-2.0
"""How well a map tells what is there now, judged against the simulation while it is being made.

A map is laid into the world by the robot's true first pose, so drift counts. A cell is occupied
above 0.5. Judged once a second, and after every scan while a place that was seen empty is believed:

ghost_rate         share of occupied cells with nothing within ``NEAR_M``: neither what never moves
                   nor a mover's hull. ``ghost_left_rate``: those where a mover was seen before
new_object_recall  of what stands for 2 s at a new place, was seen in 5 scans and lately: the share
                   that the map holds (half its hits within ``REACH_M`` of an occupied cell)
half_life          of the belief in the place of a moved chair, bin or load, from the scan that
                   first sees it empty: ``censored_median``, as some outlast the run or the watch
door_accuracy      of doors seen in the last 2 s and closed (< 15 degrees) or open (> 45): the share
                   of which the map says so (closed: half the closed leaf is occupied)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.kinds import is_door
from scripts.comparison.recording import Recording
from scripts.comparison.sight import BELIEVED, LATELY_S, OldPlace, Places, Sight, clearance
from slam import se2
from slam.evaluation.statistics import censored_median
from slam.frames import NS_PER_S, Float
from slam.system import Raster

EVERY_S = 1.0
NEAR_M = 0.15
REACH_M = 0.06  # drift of a good SLAM and a cell; more would hold a place by what little is left
CLOSED_RAD, OPEN_RAD = math.radians(15.0), math.radians(45.0)
FRAME_M, STEP_M = 0.2, 0.05  # of a closed leaf: left out at both ends; between the points asked for
DOOR_BEAMS = 5


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
        self._believed: Believed | None = None
        self.places = Places(drive, self._static, self._believes)
        shape = drive.static_map.values.shape
        self._seen: NDArray[np.uint8] = np.zeros(shape, dtype=np.uint8)  # where movers were hit
        self._doors = [row for row, kind in enumerate(drive.kinds) if is_door(kind)]
        self._door_seen = dict.fromkeys(self._doors, -math.inf)
        self._next_s = EVERY_S
        self._ghosts: list[tuple[float, float]] = []
        self._found: list[bool] = []
        self._right: list[bool] = []

    def look(self, k: int) -> None:
        """Take in scan k, before the map after it is judged."""
        sight, seconds = Sight(self._drive, k), float(self._seconds[k])
        self.places.look(k, sight, seconds)
        self._mark(sight.points[self._drive.hit[k] >= 0])
        for row in self._doors:
            start, end, _ = self._leaf(row)
            if sight.crossing(start, end) >= DOOR_BEAMS:
                self._door_seen[row] = seconds

    def wants(self, k: int) -> bool:
        """Whether the map after scan k is to be judged."""
        due = float(self._seconds[k]) >= self._next_s
        return due or any(old.fading for old in self.places.left)

    def judge(self, k: int, raster: Raster | None) -> None:
        """Score the map after scan k; None for a SLAM without."""
        seconds = float(self._seconds[k])
        if raster is None:
            return
        T_world_map = self._drive.frames[0].truth
        assert T_world_map is not None
        self._believed = believed = Believed(raster, T_world_map)
        for old in self.places.left:
            if old.watched:
                _forgets(old, believed.holds(old.points), seconds)
        if seconds < self._next_s:
            return
        self._next_s += EVERY_S
        self._ghosts.append(self._ghost_rates(believed.occupied(), k))
        new = self.places.new_objects(k, self._per_s)
        self._found += [believed.holds(points) for points in new]
        self._right += self._doors_right(believed, k)

    def scores(self) -> dict[str, Any]:
        """The columns ``MAPS``; nothing for a SLAM without maps."""
        if self._believed is None:
            return {}
        old = [place for place in self.places.left if place.seen_empty_s is not None]
        ended = [place.forgotten for place in old]
        return {
            "ghost_rate": _mean([alone for alone, _ in self._ghosts]),
            "ghost_left_rate": _mean([left for _, left in self._ghosts]),
            "new_object_recall": _mean(self._found),
            "new_objects": len(self._found),
            "half_life_s": censored_median([p.lasted_s for p in old], ended),
            "half_life_observations": censored_median([p.observations for p in old], ended),
            "half_life_events": len(old),
            "half_life_censored": len(old) - sum(ended),
            "door_accuracy": _mean(self._right),
            "doors_judged": len(self._right),
        }

    def _believes(self, points: Float) -> bool | None:
        return None if self._believed is None else self._believed.holds(points)

    def _mark(self, points: Float) -> None:
        _, rows, columns = _cells(self._drive.static_map, points[np.isfinite(points[:, 0])])
        self._seen[rows, columns] = 1

    def _ghost_rates(self, occupied: Float, k: int) -> tuple[float, float]:
        """Of the occupied cells: those with nothing near, and those that are left of a mover."""
        if len(occupied) == 0:
            return 0.0, 0.0
        alone = occupied[self._static(occupied) > NEAR_M]
        alone = alone[clearance(alone, self._drive, k) > NEAR_M]
        raster = self._drive.static_map
        seen = cv2.dilate(self._seen, disc(NEAR_M, raster.resolution_m))
        left = _sampled(seen, raster, alone, 0.0) > 0.0
        return len(alone) / len(occupied), float(left.sum()) / len(occupied)

    def _leaf(self, row: int) -> tuple[Float, Float, Float]:
        """The closed leaf without its ends: start, end (2,), and points (n, 2) along it, m."""
        x, y, yaw = self._drive.closed[row].tolist()
        way = np.array([math.cos(yaw), math.sin(yaw)])
        hinge, width = np.array([x, y]), float(self._drive.radii_m[row])
        along = np.arange(FRAME_M, width - FRAME_M + 1e-9, STEP_M)
        return hinge + FRAME_M * way, hinge + (width - FRAME_M) * way, hinge + along[:, None] * way

    def _angle(self, row: int, k: int) -> float:
        """How far a door stands open at scan k, rad; a leaf that slid by its width: pi / 2."""
        pose, closed = self._drive.poses[k, row], self._drive.closed[row]
        turned = abs(se2.wrap(float(pose[2] - closed[2])))
        slid = math.hypot(float(pose[0] - closed[0]), float(pose[1] - closed[1]))
        return max(turned, 0.5 * math.pi * slid / float(self._drive.radii_m[row]))

    def _doors_right(self, believed: Believed, k: int) -> list[bool]:
        right = []
        for row in self._doors:
            if self._seconds[k] - self._door_seen[row] > LATELY_S:
                continue
            angle = self._angle(row, k)
            points = self._leaf(row)[2]
            blocked = (clearance(points, self._drive, k, without=row) < NEAR_M).any()
            if blocked or CLOSED_RAD <= angle <= OPEN_RAD:
                continue
            right.append(believed.holds(points) == (angle < CLOSED_RAD))
        return right


def _forgets(old: OldPlace, believed: bool, seconds: float) -> None:
    """What the newest map thinks of an old place."""
    old.believed = believed
    if old.seen_empty_s is not None:
        old.lasted_s, old.forgotten = seconds - old.seen_empty_s, not believed


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None
