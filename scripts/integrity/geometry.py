# SPDX-License-Identifier: Apache-2.0
"""Distances, sight and beams in the plane: kernels over walls, pillars, and discs."""

from __future__ import annotations

import math

from slam._jit import inner, njit
from slam.frames import Float

FAR = 1e30


@inner
def point_to_segment2(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Squared distance of a point from a segment, m^2."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    t = 0.0
    if length2 > 0.0:
        t = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / length2))
    ex, ey = px - ax - t * dx, py - ay - t * dy
    return ex * ex + ey * ey


@inner
def crossing(  # noqa: PLR0913 (kernel)
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> bool:
    """Whether the segments a-b and c-d have a point in common (parallel ones do not)."""
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    det = ux * vy - uy * vx
    if det == 0.0:
        return False
    s = ((cx - ax) * vy - (cy - ay) * vx) / det
    t = ((cx - ax) * uy - (cy - ay) * ux) / det
    return 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0


@inner
def segments2(  # noqa: PLR0913 (kernel)
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> float:
    """Squared distance of two segments, m^2."""
    if crossing(ax, ay, bx, by, cx, cy, dx, dy):
        return 0.0
    first = min(
        point_to_segment2(ax, ay, cx, cy, dx, dy), point_to_segment2(bx, by, cx, cy, dx, dy)
    )
    second = min(
        point_to_segment2(cx, cy, ax, ay, bx, by), point_to_segment2(dx, dy, ax, ay, bx, by)
    )
    return min(first, second)


@inner
def sees(ax: float, ay: float, bx: float, by: float, walls: Float) -> bool:
    """Whether no wall stands between two points."""
    for k in range(walls.shape[0]):
        if crossing(ax, ay, bx, by, walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3]):
            return False
    return True


@inner
def clear_of_building(  # noqa: PLR0913 (kernel)
    ax: float, ay: float, bx: float, by: float, radius: float, walls: Float, pillars: Float
) -> bool:
    """Whether a segment with a radius (m) touches no wall and no pillar."""
    for k in range(walls.shape[0]):
        x0, y0, x1, y1 = walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3]
        if segments2(ax, ay, bx, by, x0, y0, x1, y1) < radius * radius:
            return False
    for k in range(pillars.shape[0]):
        reach = radius + pillars[k, 2]
        if point_to_segment2(pillars[k, 0], pillars[k, 1], ax, ay, bx, by) < reach * reach:
            return False
    return True


@inner
def to_segment(  # noqa: PLR0913 (kernel)
    ox: float, oy: float, ux: float, uy: float, ax: float, ay: float, bx: float, by: float
) -> float:
    """Distance along a beam of unit direction u to a segment, m; ``FAR`` where it misses."""
    vx, vy = bx - ax, by - ay
    det = ux * vy - uy * vx
    if det == 0.0:
        return FAR
    wx, wy = ax - ox, ay - oy
    along = (wx * vy - wy * vx) / det
    share = (wx * uy - wy * ux) / det
    if along > 0.0 and 0.0 <= share <= 1.0:
        return along
    return FAR


@inner
def to_disc(  # noqa: PLR0913 (kernel)
    ox: float, oy: float, ux: float, uy: float, cx: float, cy: float, radius: float
) -> float:
    """Distance along a beam of unit direction u to a disc, m; ``FAR`` where it misses.

    A beam from within a disc does not see it.
    """
    wx, wy = cx - ox, cy - oy
    along = wx * ux + wy * uy
    off = wx * uy - wy * ux
    inside = radius * radius - off * off
    if along <= 0.0 or inside <= 0.0:
        return FAR
    first = along - math.sqrt(inside)
    return first if first > 0.0 else FAR


@njit
def first_hits(  # noqa: PLR0913 (kernel)
    pose: Float,
    angles: Float,
    segments: Float,
    of_segment: Float,
    discs: Float,
    of_disc: Float,
    ranges: Float,
    hit: Float,
) -> None:
    """Fill ``ranges`` (n,) m and ``hit`` (n,): what the first thing of each beam is, -2 for none.

    ``of_segment`` (s,) and ``of_disc`` (d,) say whose each segment and each disc is: -1 of the
    building, else a number of a thing.
    """
    ox, oy = pose[0], pose[1]
    for n in range(angles.shape[0]):
        a = pose[2] + angles[n]
        ux, uy = math.cos(a), math.sin(a)
        best, what = FAR, -2.0
        for k in range(segments.shape[0]):
            d = to_segment(
                ox, oy, ux, uy, segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
            )
            if d < best:
                best, what = d, of_segment[k]
        for k in range(discs.shape[0]):
            d = to_disc(ox, oy, ux, uy, discs[k, 0], discs[k, 1], discs[k, 2])
            if d < best:
                best, what = d, of_disc[k]
        ranges[n], hit[n] = best, what
