# SPDX-License-Identifier: Apache-2.0
"""Distances, sight and beams in the plane: kernels over walls, pillars, and discs.

A segment is anything with x0, y0, x1, y1 at its places 0 to 3, a disc with x, y, radius, in m.
"""

import math

from slam._jit import inner, njit
from slam.frames import Float

FAR = 1e30
Segment = Float | tuple[float, float, float, float]


@inner
def point_to_segment2(px: float, py: float, segment: Segment) -> float:
    """Squared distance of a point from a segment, m^2."""
    dx, dy = segment[2] - segment[0], segment[3] - segment[1]
    length2 = dx * dx + dy * dy
    t = 0.0
    if length2 > 0.0:
        t = min(1.0, max(0.0, ((px - segment[0]) * dx + (py - segment[1]) * dy) / length2))
    ex, ey = px - segment[0] - t * dx, py - segment[1] - t * dy
    squared: float = ex * ex + ey * ey
    return squared


@inner
def meeting(ox: float, oy: float, ux: float, uy: float, segment: Segment) -> tuple[float, float]:
    """Where a line from o along u meets that of a segment: in lengths of u, and of the segment.

    -1, -1 where they are parallel.
    """
    vx, vy = segment[2] - segment[0], segment[3] - segment[1]
    det = ux * vy - uy * vx
    if det == 0.0:
        return -1.0, -1.0
    wx, wy = segment[0] - ox, segment[1] - oy
    return (wx * vy - wy * vx) / det, (wx * uy - wy * ux) / det


@inner
def crossing(a: Segment, b: Segment) -> bool:
    """Whether two segments have a point in common (parallel ones do not)."""
    s, t = meeting(a[0], a[1], a[2] - a[0], a[3] - a[1], b)
    return 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0


@inner
def segments2(a: Segment, b: Segment) -> float:
    """Squared distance of two segments, m^2."""
    if crossing(a, b):
        return 0.0
    first = min(point_to_segment2(a[0], a[1], b), point_to_segment2(a[2], a[3], b))
    second = min(point_to_segment2(b[0], b[1], a), point_to_segment2(b[2], b[3], a))
    return min(first, second)


@inner
def sees(ax: float, ay: float, bx: float, by: float, walls: Float) -> bool:
    """Whether no wall stands between two points."""
    for k in range(walls.shape[0]):  # noqa: SIM110 (kernel)
        if crossing((ax, ay, bx, by), walls[k]):
            return False
    return True


@inner
def clear_of_building(segment: Segment, radius: float, walls: Float, pillars: Float) -> bool:
    """Whether a segment with a radius (m) touches no wall and no pillar."""
    for k in range(walls.shape[0]):
        if segments2(segment, walls[k]) < radius * radius:
            return False
    for k in range(pillars.shape[0]):
        reach = radius + pillars[k, 2]
        if point_to_segment2(pillars[k, 0], pillars[k, 1], segment) < reach * reach:
            return False
    return True


@inner
def to_disc(ox: float, oy: float, ux: float, uy: float, disc: Float) -> float:
    """Distance along a beam of unit direction u to a disc, m; ``FAR`` where it misses.

    A beam from within a disc does not see it.
    """
    wx, wy = disc[0] - ox, disc[1] - oy
    along = wx * ux + wy * uy
    off = wx * uy - wy * ux
    inside = disc[2] * disc[2] - off * off
    if along <= 0.0 or inside <= 0.0:
        return FAR
    first: float = along - math.sqrt(inside)
    return first if first > 0.0 else FAR


@njit
def first_hits(
    pose: Float, angles: Float, segments: Float, discs: Float, ranges: Float, hit: Float
) -> None:
    """Fill ``ranges`` (n,) m and ``hit`` (n,): what the first thing of each beam is, -2 for none.

    The last column of ``segments`` (s, 5) and ``discs`` (d, 4) says whose each is: -1 of the
    building, else a number of a thing.
    """
    for n in range(angles.shape[0]):
        a = pose[2] + angles[n]
        ux, uy = math.cos(a), math.sin(a)
        best, what = FAR, -2.0
        for k in range(segments.shape[0]):
            along, share = meeting(pose[0], pose[1], ux, uy, segments[k])
            if 0.0 < along < best and 0.0 <= share <= 1.0:
                best, what = along, segments[k, 4]
        for k in range(discs.shape[0]):
            along = to_disc(pose[0], pose[1], ux, uy, discs[k])
            if along < best:
                best, what = along, discs[k, 3]
        ranges[n], hit[n] = best, what
