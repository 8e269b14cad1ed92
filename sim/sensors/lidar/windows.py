# SPDX-License-Identifier: Apache-2.0
"""Which beams of a scan can meet which geom: the bounds that make the caster fast.

Each geom is turned into the interval of azimuth in which beams can meet it and the distance from
which on it can be met (design note, world section 1.2), so a beam is left with one or two exact
tests instead of one for every geom. Bounds are generous by ``SLACK``; the exact tests are in
``sim.sensors.lidar.ray_shapes``.
"""

import math
from typing import Any, NamedTuple

from sim.sensors.lidar import columns as col
from sim.sensors.lidar.fan import SLACK, Int, Vec3, row_of
from slam._jit import inner, uncounted
from slam.frames import Float

BUCKETS = 64


class Noted(NamedTuple):
    """Where things were at some moments of a scan.

    ids        (n,) geoms of the caster
    runs       (bodies, 4) in the columns of ``sim.sensors.lidar.columns``
    places     (bodies, 7) position and quaternion of each at the scan's first note
    xpos...    ``xpos``, ``xquat``, ``geom_xpos``, ``geom_xmat``, ``site_xpos``, ``site_xmat`` of
               the model's data
    site       of the laser, -1 for none
    poses      (slots, n, 12); what has not moved since the first slot stands in that one alone
    lasers     (slots, 3)
    filled     (1,) number of slots
    """

    ids: Int
    runs: Int
    places: Float
    xpos: Float
    xquat: Float
    geom_xpos: Float
    geom_xmat: Float
    site_xpos: Float
    site_xmat: Float
    site: int
    poses: Float
    lasers: Float
    filled: Int


@inner
def _stands(place: Float, position: Float, quaternion: Float) -> bool:
    """Whether a body is where it was, to the last bit."""
    for i in range(3):
        if place[i] != position[i]:
            return False
    for i in range(4):  # noqa: SIM110 (kernel)
        if place[3 + i] != quaternion[i]:
            return False
    return True


@inner
def _keep(place: Float, position: Float, quaternion: Float) -> None:
    """Number by number, as all below: an assignment of a slice compiles its error messages."""
    for i in range(3):
        place[i] = position[i]
    for i in range(4):
        place[3 + i] = quaternion[i]


@uncounted
def note(noted: Any) -> None:  # noqa: C901 (kernel)
    """Take over where geoms and laser are now, into the next slot of a packed ``Noted``."""
    runs, places, poses, lasers = noted.runs, noted.places, noted.poses, noted.lasers
    xpos, xquat, site = noted.xpos, noted.xquat, noted.site
    slot = noted.filled[0]
    noted.filled[0] += 1
    for k in range(runs.shape[0]):
        body, first, end = runs[k, col.RUN_BODY], runs[k, col.RUN_FIRST], runs[k, col.RUN_END]
        if runs[k, col.RUN_STATE] != col.MOVES:
            if _stands(places[k], xpos[body], xquat[body]):
                continue
            for before in range(1, slot):
                for j in range(first, end):
                    for i in range(poses.shape[2]):
                        poses[before, j, i] = poses[0, j, i]
        runs[k, col.RUN_STATE] = col.MOVES
        if slot == 0:
            runs[k, col.RUN_STATE] = col.PLACED
            _keep(places[k], xpos[body], xquat[body])
        for j in range(first, end):
            geom = noted.ids[j]
            for i in range(3):
                poses[slot, j, col.PX + i] = noted.geom_xpos[geom, i]
            for i in range(9):
                poses[slot, j, col.R00 + i] = noted.geom_xmat[geom, i]
    if site >= 0:
        lasers[slot, col.LASER_X] = noted.site_xpos[site, 0]
        lasers[slot, col.LASER_Y] = noted.site_xpos[site, 1]
        lasers[slot, col.LASER_YAW] = math.atan2(noted.site_xmat[site, 3], noted.site_xmat[site, 0])


@inner
def _horizontal_bound(table: Float, j: int, poses: Float, slot: int) -> float:
    """Radius of a vertical cylinder about the geom's centre that contains it."""
    kind = int(table[j, col.KIND])
    s0, s1, s2 = table[j, col.SIZE_X], table[j, col.SIZE_Y], table[j, col.SIZE_Z]
    if kind == col.SPHERE:
        return float(s0)
    if kind in (col.CAPSULE, col.CYLINDER):
        lean_x, lean_y = poses[slot, j, col.R02], poses[slot, j, col.R12]
        return float(s0 + s1 * math.sqrt(lean_x * lean_x + lean_y * lean_y))
    if kind == col.ELLIPSOID:
        return float(max(s0, s1, s2))
    if kind == col.PLANE:
        return math.inf
    if table[j, col.UPRIGHT] > 0.0:
        return math.sqrt(s0 * s0 + s1 * s1)
    return math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)


@uncounted
def enclose(table: Float, runs: Int, poses: Float, slots: int, bounds: Float) -> None:
    """Renew the bounds of what does not rest as before from its poses in the first ``slots``."""
    for k in range(runs.shape[0]):
        if runs[k, col.RUN_STATE] == col.RESTS:
            continue
        moves = runs[k, col.RUN_STATE] == col.MOVES
        last = slots - 1 if moves else 0
        if not moves:
            runs[k, col.RUN_STATE] = col.RESTS
        for j in range(runs[k, col.RUN_FIRST], runs[k, col.RUN_END]):
            radius, half = _horizontal_bound(table, j, poses, last), table[j, col.HALF_HEIGHT]
            x, y, z = poses[last, j, col.PX], poses[last, j, col.PY], poses[last, j, col.PZ]
            if moves:
                x, y = 0.5 * (x + poses[0, j, col.PX]), 0.5 * (y + poses[0, j, col.PY])
                radius, lift = 0.0, 0.0
                for s in range(slots):
                    dx, dy = poses[s, j, col.PX] - x, poses[s, j, col.PY] - y
                    reach = _horizontal_bound(table, j, poses, s) + math.sqrt(dx * dx + dy * dy)
                    radius, lift = max(radius, reach), max(lift, abs(poses[s, j, col.PZ] - z))
                half += lift
            bounds[j, col.DISC_X], bounds[j, col.DISC_Y], bounds[j, col.DISC_Z] = x, y, z
            bounds[j, col.DISC_RADIUS], bounds[j, col.DISC_HALF] = radius, half
            bounds[j, col.MOVED] = 1.0 if moves else 0.0


@inner
def _azimuth(y: float, x: float) -> float:
    """atan2 to 1.2e-5 rad (Abramowitz and Stegun 4.4.49), four times faster; only for bounds."""
    ax, ay = abs(x), abs(y)
    t = min(ax, ay) / max(ax, ay) if ax > 0.0 or ay > 0.0 else 0.0
    u = t * t
    angle = t * (0.9998660 + u * (-0.3302995 + u * (0.1801410 + u * (-0.0851330 + u * 0.0208351))))
    if ay > ax:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return angle if y >= 0.0 else -angle


@inner
def _half_angle(radius: float, distance: float) -> float:
    """Half the angle a disc fills from ``distance`` > ``radius``, or a little more."""
    ratio = radius / distance
    if ratio < 0.3:
        return ratio + 0.19 * ratio * ratio * ratio  # above the arc sine, by 4e-4 at most
    return _azimuth(radius, math.sqrt((distance - radius) * (distance + radius)))


@inner
def _box_extent(table: Float, poses: Float, j: int, dx: float, dy: float, spread: float) -> Vec3:
    """(nearest distance, lowest, highest azimuth) of an upright box whose centre is at (dx, dy).

    Azimuths are in (-pi, 2 pi), high above low; both widened for origins up to ``spread`` away.
    All around when the box may contain such an origin.
    """
    ux, uy = poses[0, j, col.R00], poses[0, j, col.R10]
    wx, wy = poses[0, j, col.R01], poses[0, j, col.R11]
    half_x, half_y = table[j, col.SIZE_X], table[j, col.SIZE_Y]
    across = max(abs(dx * ux + dy * uy) - half_x, 0.0)
    along = max(abs(dx * wx + dy * wy) - half_y, 0.0)
    clear = math.sqrt(across * across + along * along)
    if clear <= spread + SLACK:
        return 0.0, -math.pi, math.pi
    sx, sy = half_x, half_y
    low_x, low_y = dx + sx * ux + sy * wx, dy + sx * uy + sy * wy
    high_x, high_y = low_x, low_y
    for i in range(3):
        if i == 1:
            sx = -sx
        else:
            sy = -sy
        x, y = dx + sx * ux + sy * wx, dy + sx * uy + sy * wy
        if low_x * y - low_y * x < 0.0:
            low_x, low_y = x, y
        if high_x * y - high_y * x > 0.0:
            high_x, high_y = x, y
    low, high = _azimuth(low_y, low_x), _azimuth(high_y, high_x)
    if high < low:
        high += math.tau
    # Every corner is at least ``clear`` away, so this is the largest shift of any of them.
    widen = _half_angle(spread, clear) if spread > 0.0 else 0.0
    return clear - spread, low - widen, high + widen


@inner
def _origins(fan: Float) -> Vec3:
    """(mid x, mid y, largest distance of any beam's origin from there)."""
    last, spread = fan.shape[0] - 1, 0.0
    mid_x = 0.5 * (fan[0, col.ORIGIN_X] + fan[last, col.ORIGIN_X])
    mid_y = 0.5 * (fan[0, col.ORIGIN_Y] + fan[last, col.ORIGIN_Y])
    for i in range(last + 1):
        x, y = fan[i, col.ORIGIN_X] - mid_x, fan[i, col.ORIGIN_Y] - mid_y
        spread = max(spread, x * x + y * y)
    return mid_x, mid_y, math.sqrt(spread)


@inner
def find_windows(  # noqa: PLR0913 (kernel)
    table: Float,
    poses: Float,
    bounds: Float,
    fan: Float,
    wedge: tuple[float, float],
    optics: Vec3,
    windows: Float,
    owners: Int,
) -> int:
    """Where the beams of a scan can meet which geom.

    wedge    lowest and highest azimuth of any ray
    optics   height of the scan plane m, aperture radius m and half divergence rad of the spot
    windows  (3 n, 4), filled; ``owners`` (3 n,) the geom of each

    Returns how many.
    """
    height, aperture, slope = optics
    mid_x, mid_y, spread = _origins(fan)
    spread, found = spread + aperture + SLACK, 0
    first, last = wedge
    left_c, left_s = math.cos(last), math.sin(last)
    right_c, right_s = math.cos(first), math.sin(first)
    span = last - first
    for j in range(bounds.shape[0]):
        dx, dy = bounds[j, col.DISC_X] - mid_x, bounds[j, col.DISC_Y] - mid_y
        reach = bounds[j, col.DISC_RADIUS] + spread
        # Outside the wedge of the scan: no trigonometry needed to know it.
        left, right = left_c * dy - left_s * dx > reach, right_s * dx - right_c * dy > reach
        if (left or right) if span < math.pi else (left and right and span < math.tau):
            continue
        distance = math.sqrt(dx * dx + dy * dy)
        gap = abs(bounds[j, col.DISC_Z] - height) - bounds[j, col.DISC_HALF] - aperture
        if not gap <= slope * (distance + reach) + SLACK:  # nor where one is not a number
            continue
        if (
            table[j, col.KIND] == col.BOX
            and table[j, col.UPRIGHT] > 0.0
            and bounds[j, col.MOVED] == 0.0
        ):
            near, low, high = _box_extent(table, poses, j, dx, dy, spread)
        elif distance <= reach:
            near, low, high = 0.0, -math.pi, math.pi
        else:
            half, centre = _half_angle(reach, distance), _azimuth(dy, dx)
            near, low, high = distance - reach, centre - half, centre + half
        if gap > SLACK:
            near = max(near, (gap - SLACK) / slope)  # a ray that leaves the plane needs that far
        for lap in (-math.tau, 0.0, math.tau):
            if low - slope + lap <= last and high + slope + lap >= first:
                owners[found] = j
                windows[found, col.NEAR], windows[found, col.FAR] = near, distance + reach
                windows[found, col.LOW], windows[found, col.HIGH] = low + lap, high + lap
                found += 1
    return found


@inner
def nearest_first(windows: Float, found: int, order: Int) -> None:
    """Order of the first ``found`` windows by distance, to 0.25 m: enough, and three times faster
    than a sort. Its end is for counting."""
    starts = order[len(order) - BUCKETS - 1 :]
    starts[:] = 0
    for row in range(found):
        starts[1 + row_of(4.0 * windows[row, col.NEAR], BUCKETS - 1)] += 1
    for k in range(BUCKETS):
        starts[k + 1] += starts[k]
    for row in range(found):
        k = row_of(4.0 * windows[row, col.NEAR], BUCKETS - 1)
        order[starts[k]] = row
        starts[k] += 1
