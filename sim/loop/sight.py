# SPDX-License-Identifier: Apache-2.0
"""What stands around the robot, from its own scans and wheels: nothing here knows the truth.

A scan becomes points in the robot's frame, each beam at its own time. What has left the view is
remembered for a few seconds by odometry. At the height of the scan plane an office chair is a gas
spring of 6 cm and a person two shins: a thing so thin is taken for something wider, unless
something wide was lately seen in its place, as where it is the end of a wall or of a door's leaf.
"""

import math

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam._jit import njit
from slam.frames import NS_PER_S, Float, Frame
from slam.frontend.deskew import deskewed

REACH_M = 3.0  # nothing further away matters to the next seconds
MEMORY_S = 4.0  # of what is out of view
THIN_M = 0.2  # a thing narrower than this has a foot wider than what is seen
WIDE_M = 0.6  # a thing at least this wide ends where it is seen to end
GAP_M, GAP_PER_M = 0.12, 0.03  # returns of neighbouring beams further apart are of two things
SPACING_M = 0.04  # of the points kept
WIDE_RADIUS_M, THIN_RADIUS_M = 0.03, 0.29  # taken around a point
THROUGH_M = 0.15  # a remembered point this far before what is seen is gone
WIDE_S = 30.0  # how long a place counts as one where something wide was seen
THIN, WIDE = 1, 2
_SIDE, _CELL_M = 128, 0.1  # such places, on a grid that is reused as the robot moves on


class Sight:
    """Obstacle points, (n, 2) m in the robot's frame at the last scan, and their radii."""

    def __init__(self) -> None:
        self._points: Float = np.zeros((0, 4))  # x, y m in the robot's frame; seen at s; radius m
        self._wide: Float = np.full((_SIDE, _SIDE), -math.inf)  # s, by cells of the odometry frame
        self._T_odom_robot: Float | None = None

    @property
    def points_robot(self) -> Float:
        """(n, 2) m."""
        out: Float = self._points[:, :2].copy()
        return out

    @property
    def radii(self) -> Float:
        """(n,) m."""
        out: Float = self._points[:, 3].copy()
        return out

    def take(self, frame: Frame) -> None:
        """One more scan; a frame without one only moves what is remembered."""
        here = frame.odometry.T_odom_robot
        before = here if self._T_odom_robot is None else self._T_odom_robot
        self._T_odom_robot = here
        old = self._points.copy()
        old[:, :2] = se2.transform(se2.between(here, before), old[:, :2])
        if frame.scan is None:
            self._points = old
            return
        now, spec = frame.stamp_ns / NS_PER_S, frame.scan.spec
        fan = (spec.angle_min, spec.angle_increment)
        offsets = spec.beam_time_offsets if len(spec.beam_time_offsets) else np.zeros(spec.n_beams)
        twist = np.zeros(3) if frame.odometry.twist is None else frame.odometry.twist
        points, things = _scanned(
            frame.scan.ranges, frame.scan.valid, offsets, fan, spec.T_robot_laser, twist, now,
        )  # fmt: skip
        _judge(points, things, old, here, self._wide)
        kept = _unseen(frame.scan.ranges, frame.scan.valid, fan, spec.T_robot_laser, old, now)
        self._points = np.concatenate([points, kept])


@njit
def _scanned(  # noqa: PLR0913 (kernel)
    ranges: NDArray[np.float32],
    valid: NDArray[np.bool_],
    offsets: Float,
    fan: tuple[float, float],
    laser: Float,
    twist: Float,
    now: float,
) -> tuple[Float, NDArray[np.int64]]:
    """(n, 4) points of a scan, and the things they are of: (k, 4) first point, end, THIN or WIDE or
    neither, whether cut off by the edge of view or by something nearer."""
    n = len(ranges)
    out = np.empty((n, 4))
    things = np.empty((n, 4), dtype=np.int64)
    count, k = 0, -1
    lx, ly, fx, fy, last = 0.0, 0.0, 0.0, 0.0, -2
    for i in range(n):
        if not (valid[i] and ranges[i] < REACH_M):
            continue
        angle = laser[2] + fan[0] + i * fan[1]
        x = laser[0] + ranges[i] * math.cos(angle)
        y = laser[1] + ranges[i] * math.sin(angle)
        x, y = deskewed(x, y, offsets[i], twist)
        gap = GAP_M + GAP_PER_M * ranges[i]
        if last != i - 1 or (x - lx) ** 2 + (y - ly) ** 2 > gap * gap:
            k += 1
            things[k, 0] = count
            things[k, 3] = i == 0 or (valid[i - 1] and ranges[i - 1] < ranges[i])
            fx, fy = x, y
        kx, ky = (
            (x - out[count - 1, 0], y - out[count - 1, 1]) if count > things[k, 0] else (1.0, 1.0)
        )
        if kx * kx + ky * ky >= SPACING_M * SPACING_M:
            out[count, 0], out[count, 1], out[count, 2], out[count, 3] = x, y, now, WIDE_RADIUS_M
            count += 1
        things[k, 1] = count
        width2 = (x - fx) ** 2 + (y - fy) ** 2
        things[k, 2] = THIN if width2 < THIN_M * THIN_M else WIDE if width2 > WIDE_M * WIDE_M else 0
        if i == n - 1 or (valid[i + 1] and ranges[i + 1] < ranges[i] - GAP_M):
            things[k, 3] = 1
        lx, ly, last = x, y, i
    return out[:count].copy(), things[: k + 1].copy()


@njit
def _judge(  # noqa: C901 (kernel)
    points: Float, things: NDArray[np.int64], old: Float, T_odom_robot: Float, wide: Float
) -> None:
    """Give thin things their radius and note where wide ones are.

    What is cut off may be the rest of anything: it is thin where it was thin before.
    """
    c, s = math.cos(T_odom_robot[2]), math.sin(T_odom_robot[2])
    for k in range(len(things)):
        first, end, size, cut = things[k]
        before = 0
        for p in range(first, end):
            x, y = points[p, 0], points[p, 1]
            j = math.floor((T_odom_robot[0] + c * x - s * y) / _CELL_M) % _SIDE
            i = math.floor((T_odom_robot[1] + s * x + c * y) / _CELL_M) % _SIDE
            if size == WIDE:
                wide[i, j] = points[p, 2]
            if size != THIN:
                continue
            for a in range(-1, 2):
                for b in range(-1, 2):
                    if points[p, 2] - wide[(i + a) % _SIDE, (j + b) % _SIDE] < WIDE_S:
                        before = 1
        if size != THIN or before == 1:
            continue
        known = not cut
        for q in range(len(old)):
            gap2 = (old[q, 0] - points[first, 0]) ** 2 + (old[q, 1] - points[first, 1]) ** 2
            known = known or (old[q, 3] == THIN_RADIUS_M and gap2 < GAP_M * GAP_M)
        if known:
            points[first:end, 3] = THIN_RADIUS_M


@njit
def _unseen(
    ranges: NDArray[np.float32],
    valid: NDArray[np.bool_],
    fan: tuple[float, float],
    laser: Float,
    old: Float,
    now: float,
) -> Float:
    """(n, 4) of the remembered points those that this scan does not speak of."""
    out = np.empty_like(old)
    count = 0
    for k in range(len(old)):
        dx, dy = old[k, 0] - laser[0], old[k, 1] - laser[1]
        distance = math.sqrt(dx * dx + dy * dy)
        if now - old[k, 2] > MEMORY_S or distance > REACH_M:
            continue
        bearing = math.atan2(dy, dx) - laser[2]
        bearing -= math.tau * math.floor(bearing / math.tau + 0.5)
        beam = math.floor((bearing - fan[0]) / fan[1] + 0.5)
        # What does not answer (black cloth, chrome) is not seen through.
        seen = 0 <= beam < len(ranges) and valid[beam]
        if seen and ranges[beam] >= distance - THROUGH_M:
            continue
        out[count] = old[k]
        count += 1
    return out[:count].copy()
