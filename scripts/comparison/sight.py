# SPDX-License-Identifier: Apache-2.0
"""What the scans of a recording saw, from the true pose: where they hit, which places they saw
empty, through which doorways they looked. The same for every SLAM."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from scenes.kinds import is_door
from scripts.comparison.recording import Recording
from slam import se2
from slam.frames import Float, Scan
from slam.frontend.deskew import end_points

BEYOND_M = 0.3  # a beam that goes this much farther than a point has seen that nothing is there
ALONG_M = 0.1  # of a beam beyond its hit that still counts as meeting a doorway


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

    def emptied(self, points: Float) -> NDArray[np.bool_]:
        """(n,) which points (n, 2) m a beam passed and went ``BEYOND_M`` farther."""
        return np.asarray(self.beyond(points) > BEYOND_M)

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

    def crossing(self, start: Float, end: Float) -> int:
        """How many beams cross or end at the line from ``start`` to ``end`` (2,) m."""
        rays = self.points - self.eye
        length = np.sqrt((rays * rays).sum(axis=1))
        with np.errstate(invalid="ignore", divide="ignore"):
            rays = rays * (1.0 + ALONG_M / length)[:, None]
            line, offset = end - start, start - self.eye
            across = rays[:, 0] * line[1] - rays[:, 1] * line[0]
            at_ray = (offset[0] * line[1] - offset[1] * line[0]) / across
            at_line = (offset[0] * rays[:, 1] - offset[1] * rays[:, 0]) / across
            crossed = (at_ray > 0.0) & (at_ray < 1.0) & (at_line > 0.0) & (at_line < 1.0)
        return int(crossed.sum())


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


def clearance(points: Float, drive: Recording, k: int, *, without: int = -1) -> Float:
    """(n,) m from points (n, 2) to the nearest mover's hull or leaf at scan k; < 0: inside.

    The robot itself and mover ``without`` do not count. Infinite where there is no mover.
    """
    nearest = np.full(len(points), math.inf)
    for row, kind in enumerate(drive.kinds):
        if kind == "robot" or row == without:
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
