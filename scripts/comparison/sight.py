# SPDX-License-Identifier: Apache-2.0
"""What the scans of a recording saw, from the true pose: where they hit, which places they saw
empty; and where movers stand: new objects that a map should hold. The same for every SLAM."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenes.kinds import KINDS, is_door
from scripts.comparison.recording import Recording
from slam import se2
from slam.frames import Float, Scan
from slam.frontend.deskew import end_points

BEYOND_M = 0.3  # a beam that goes this much farther than a point has seen that nothing is there


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


MOVED_M = 0.15  # shift of the centre plus turn at the rim that makes it another place
STILL_S, SEEN_SCANS, LATELY_S = 2.0, 5, 2.0
APART_M = 0.2  # points nearer to a wall than this tell nothing about a mover
GRAIN_M = 0.02  # hits nearer to one another are one point


def _group(kind: str) -> str:
    """What moves a kind; one that a module registers, and this process does not know, is itself."""
    return KINDS[kind].group if kind in KINDS else kind


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
            k for k, kind in enumerate(drive.kinds) if _group(kind) not in ("door", "robot")
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
