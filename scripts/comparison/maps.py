# SPDX-License-Identifier: Apache-2.0
"""How well a map tells what is there now, judged against the simulation while it is being made.

A map is laid into the world by the robot's true first pose, so drift counts. A cell is occupied
above 0.5. Judged once a second:

ghost_rate         share of occupied cells with nothing within ``NEAR_M``: neither what never moves
                   nor a mover's hull
new_object_recall  of what stands for 2 s at a new place, was seen in 5 scans and lately: the share
                   that the map holds (half its hits within ``REACH_M`` of an occupied cell)
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.kinds import KINDS, is_door
from scripts.comparison.recording import Recording
from slam import se2
from slam.frames import NS_PER_S, Float, Scan
from slam.frontend.deskew import end_points
from slam.system import Raster

BEYOND_M = 0.3  # a beam that goes this much farther than a point has seen that nothing is there
MOVED_M = 0.15  # shift of the centre plus turn at the rim that makes it another place
STILL_S, SEEN_SCANS, LATELY_S = 2.0, 5, 2.0
APART_M = 0.2  # points nearer to a wall than this tell nothing about a mover
GRAIN_M = 0.02  # hits nearer to one another are one point


class Sight:
    """One scan: ``points`` (n, 2) m in the world, NaN without a return; ``eye`` (2,) the laser.

    End points are moved to where the robot truly was at each beam's own time.
    """

    def __init__(self, drive: Recording, k: int) -> None:
        frame = drive.frames[k]
        assert frame.scan is not None
        assert frame.truth is not None
        self.scan: Scan = frame.scan
        self.truth: Float = frame.truth
        twist = frame.odometry.twist
        self.points = _hits(self.scan, self.truth, np.zeros(3) if twist is None else twist)
        self.eye = se2.compose(self.truth, self.scan.spec.T_robot_laser)[:2]

    def beyond(self, points: Float) -> Float:
        """(n,) m by which the nearest beam went farther than points (n, 2) m; -inf without one."""
        spec = self.scan.spec
        T_world_laser = se2.compose(self.truth, spec.T_robot_laser)
        local = se2.transform(se2.inverse(T_world_laser), points)
        ranges = np.sqrt(local[:, 0] ** 2 + local[:, 1] ** 2)
        beams = (np.arctan2(local[:, 1], local[:, 0]) - spec.angle_min) / spec.angle_increment
        nearest = np.round(beams).astype(np.int64)
        inside = (nearest >= 0) & (nearest < spec.n_beams)
        measured = self.scan.ranges[np.clip(nearest, 0, spec.n_beams - 1)].astype(np.float64)
        told = inside & np.isfinite(measured)
        return np.where(told, np.where(told, measured, 0.0) - ranges, -math.inf)


def _hits(scan: Scan, truth: Float, twist: Float) -> Float:
    spec = scan.spec
    ranges = np.where(scan.valid, scan.ranges.astype(np.float64), np.nan)
    points = end_points(
        ranges, spec.angles, spec.beam_time_offsets, spec.T_robot_laser, np.asarray(twist)
    )
    return se2.transform(truth, points)


def seen_empty(points: Float, drive: Recording) -> NDArray[np.bool_]:
    """(n,) which points (n, 2) m the last scan with a say on them saw empty.

    It has a say where a beam passes a point, or ends within ``BEYOND_M`` of it along the beam.
    """
    empty = np.zeros(len(points), dtype=np.bool_)
    left = np.arange(len(points))
    for k in reversed(range(len(drive.frames))):
        if not len(left):
            break
        sight = Sight(drive, k)
        beyond = sight.beyond(points[left])
        empty[left] = beyond > BEYOND_M
        left = left[~(beyond > -BEYOND_M)]
    return empty


def clearance(points: Float, drive: Recording, k: int) -> Float:
    """(n,) m from points (n, 2) to the nearest mover's hull or leaf at scan k; < 0: inside.

    The robot itself does not count. Infinite where there is no mover.
    """
    nearest = np.full(len(points), math.inf)
    for row, kind in enumerate(drive.kinds):
        if kind == "robot":
            continue
        x, y, yaw = drive.poses[k, row].tolist()
        reach = float(drive.radii_m[row])
        offset = points - (x, y)
        if is_door(kind):
            along = offset[:, 0] * math.cos(yaw) + offset[:, 1] * math.sin(yaw)
            offset = offset - np.clip(along, 0.0, reach)[:, None] * (math.cos(yaw), math.sin(yaw))
            reach = 0.0
        distance = np.sqrt((offset * offset).sum(axis=1)) - reach
        nearest = np.minimum(nearest, distance)
    return nearest


@dataclass(eq=False)
class Place:
    """Where a mover stands: since scan ``first``, hit at ``cells`` (units of ``GRAIN_M``)."""

    pose: Float
    first: int
    new: bool
    cells: set[tuple[int, int]] = field(default_factory=set)
    scans: int = 0
    last: int = -1

    def points(self) -> Float:
        """(n, 2) m in the world."""
        return (np.array(sorted(self.cells), dtype=np.float64).reshape(-1, 2) + 0.5) * GRAIN_M


class Places:
    """The places of all movers of a recording, scan by scan."""

    def __init__(self, drive: Recording, near_static: Callable[[Float], Float]) -> None:
        """Over one drive.

        near_static  m from points (n, 2) in the world to the nearest thing that never moves
        """
        self._drive, self._near_static = drive, near_static
        self._rows = [
            k
            for k, kind in enumerate(drive.kinds)
            if (KINDS[kind].group if kind in KINDS else kind) not in ("door", "robot")
        ]
        self.standing = {row: Place(drive.poses[0, row], 0, new=False) for row in self._rows}

    def look(self, k: int, sight: Sight) -> None:
        """Take in scan k."""
        drive = self._drive
        for row in self._rows:
            pose, place = drive.poses[k, row], self.standing[row]
            turned = abs(se2.wrap(float(pose[2] - place.pose[2]))) * float(drive.radii_m[row])
            shift = math.dist(pose[:2].tolist(), place.pose[:2].tolist())
            if shift + turned > MOVED_M:
                place = self.standing[row] = Place(pose, k, new=True)
            hits = sight.points[drive.hit[k] == row]
            hits = hits[np.isfinite(hits[:, 0])]
            hits = hits[self._near_static(hits) > APART_M]
            if len(hits):
                place.cells.update(map(tuple, np.floor(hits / GRAIN_M).astype(int).tolist()))
                place.scans, place.last = place.scans + 1, k

    def new_objects(self, k: int, scans_per_s: float) -> Iterator[Float]:
        """Points of everything that stands at a new place long enough and was seen lately."""
        for place in self.standing.values():
            if (
                place.new
                and k - place.first >= STILL_S * scans_per_s
                and place.scans >= SEEN_SCANS
                and k - place.last <= LATELY_S * scans_per_s
            ):
                yield place.points()


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
    """(n,) of ``values``, a raster's, at points (n, 2) m; ``outside`` beyond its cells."""
    cells = np.floor((points - raster.T_map_origin[:2]) / raster.resolution_m).astype(np.int64)
    inside = ((cells >= 0) & (cells < raster.values.shape[::-1])).all(axis=1)
    out = np.full(len(points), outside)
    out[inside] = values[cells[inside, 1], cells[inside, 0]]
    return out


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

    def wants_map(self, k: int) -> bool:
        """Take in scan k; whether the map after it is to be judged."""
        self._places.look(k, Sight(self._drive, k))
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
