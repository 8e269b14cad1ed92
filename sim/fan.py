# SPDX-License-Identifier: Apache-2.0
"""Which beams of a fan can meet which geom: the bounds that make the caster fast.

A fan is a set of beams at even steps of azimuth. Every beam has its own time within one physics
step, hence its own origin and direction, because the robot moves; and so do the things. Each geom
is turned into the interval of beams that can meet it and the distance from which on it can be met
(design note, world section 1.2), so a beam is left with about one exact test instead of one for
every geom. Bounds are generous by ``SLACK``; the exact tests are in ``sim.raycast``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Vec3 = tuple[float, float, float]

# mjtGeom
PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 0, 2, 3, 4, 5, 6
PRIMITIVES = (PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX)
SLACK = 5e-5  # rad and m by which bounds are widened: above what ``_azimuth`` and rounding miss

# Columns of the geom table.
KIND, SIZE_X, SIZE_Y, SIZE_Z, HALF_HEIGHT, UPRIGHT = range(6)

# Columns of the fan: azimuth, origin, direction, time within the step.
AZIMUTH, ORIGIN_X, ORIGIN_Y, COS, SIN, TAU = range(6)

# Columns of the bounds: a disc that contains the geom during the whole step, its height above the
# ground and half its vertical extent; and whether the geom moved in the step.
DISC_X, DISC_Y, DISC_RADIUS, DISC_Z, DISC_HALF, MOVED = range(6)


@njit
def _horizontal_bound(geom: Float, pose: Float) -> float:
    """Radius of a vertical cylinder about the geom's centre that contains it."""
    kind = int(geom[KIND])
    if kind == SPHERE:
        return float(geom[SIZE_X])
    if kind in (CAPSULE, CYLINDER):
        lean = math.sqrt(pose[5] * pose[5] + pose[8] * pose[8])
        return float(geom[SIZE_X] + geom[SIZE_Y] * lean)
    if kind == ELLIPSOID:
        return float(max(geom[SIZE_X], geom[SIZE_Y], geom[SIZE_Z]))
    if kind == PLANE:
        return math.inf
    s0, s1, s2 = geom[SIZE_X], geom[SIZE_Y], geom[SIZE_Z]
    if geom[UPRIGHT] > 0.0:
        return math.sqrt(s0 * s0 + s1 * s1)
    return math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)


@njit
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


@njit
def _half_angle(radius: float, distance: float) -> float:
    """Half the angle a disc fills from ``distance`` > ``radius``, as exact as ``_azimuth``."""
    return _azimuth(radius, math.sqrt((distance - radius) * (distance + radius)))


@njit
def _box_extent(table: Float, end: Float, j: int, dx: float, dy: float, spread: float) -> Vec3:
    """(nearest distance, lowest, highest azimuth) of an upright box whose centre is at (dx, dy).

    Azimuths are in (-pi, 2 pi), high above low; both widened for origins up to ``spread`` away.
    All around when the box may contain such an origin.
    """
    ux, uy, wx, wy = end[j, 3], end[j, 6], end[j, 4], end[j, 7]
    half_x, half_y = table[j, SIZE_X], table[j, SIZE_Y]
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


@njit
def _bound(geom: Float, was: Float, now: Float, moved: bool, out: Float) -> None:
    out[DISC_X], out[DISC_Y], out[DISC_Z] = now[0], now[1], now[2]
    out[DISC_HALF], out[MOVED] = geom[HALF_HEIGHT], 0.0
    radius = _horizontal_bound(geom, now)
    if moved:
        sx, sy, lift = 0.5 * (now[0] - was[0]), 0.5 * (now[1] - was[1]), abs(now[2] - was[2])
        out[DISC_X], out[DISC_Y] = now[0] - sx, now[1] - sy
        radius = max(radius, _horizontal_bound(geom, was)) + math.sqrt(sx * sx + sy * sy)
        out[DISC_HALF] += lift
        out[MOVED] = 1.0
    out[DISC_RADIUS] = radius


@njit
def follow(
    table: Float,
    ids: Int,
    movable: Int,
    views: tuple[Float, Float],
    poses: tuple[Float, Float],
    bounds: Float,
    restart: bool,
) -> None:
    """Take over the poses at the end of a physics step; what was the end becomes the start.

    movable  rows of ``ids`` that can move at all
    views    ``geom_xpos`` and ``geom_xmat`` of all geoms
    poses    (n, 12) at the start and at the end of the step: position, then matrix by rows
    bounds   (n, 6) renewed where something changed
    restart  forget the start: everything rests in the step that ends now
    """
    xpos, xmat = views
    start, end = poses
    for row in range(movable.size):
        j = movable[row]
        g = ids[j]
        changed = False
        for i in range(3):
            changed = changed or end[j, i] != xpos[g, i]
        for i in range(9):
            changed = changed or end[j, 3 + i] != xmat[g, i]
        if not changed and bounds[j, MOVED] == 0.0:
            continue
        for i in range(12):
            value = xpos[g, i] if i < 3 else xmat[g, i - 3]
            start[j, i] = value if restart else end[j, i]
            end[j, i] = value
        _bound(table[j], start[j], end[j], changed and not restart, bounds[j])


@njit
def _wrapped(angle: float) -> float:
    return angle - math.tau * math.floor(angle / math.tau + 0.5)


@njit
def _lay_fan(angles: Float, taus: Float, laser: Float) -> Float:
    """(m, 6) table of the beams in the world; the laser moves evenly from start to end."""
    fan = np.empty((angles.size, 6))
    yaw, turn = _wrapped(laser[2]), _wrapped(laser[5] - laser[2])
    for i in range(angles.size):
        tau = taus[i]
        azimuth = yaw + tau * turn + angles[i]
        fan[i, AZIMUTH] = azimuth
        fan[i, ORIGIN_X] = laser[0] + tau * (laser[3] - laser[0])
        fan[i, ORIGIN_Y] = laser[1] + tau * (laser[4] - laser[1])
        fan[i, COS], fan[i, SIN] = math.cos(azimuth), math.sin(azimuth)
        fan[i, TAU] = tau
    return fan


@njit
def _fan_frame(fan: Float) -> Float:
    """(mid x, mid y, spread of the origins m, unevenness of the azimuths rad, first azimuth, step).

    The unevenness is the largest departure of an azimuth from even steps.
    """
    last = fan.shape[0] - 1
    mid_x = 0.5 * (fan[0, ORIGIN_X] + fan[last, ORIGIN_X])
    mid_y = 0.5 * (fan[0, ORIGIN_Y] + fan[last, ORIGIN_Y])
    step = (fan[last, AZIMUTH] - fan[0, AZIMUTH]) / last if last > 0 else 1.0
    spread, uneven = 0.0, 0.0
    for i in range(last + 1):
        x, y = fan[i, ORIGIN_X] - mid_x, fan[i, ORIGIN_Y] - mid_y
        spread = max(spread, x * x + y * y)
        uneven = max(uneven, abs(fan[i, AZIMUTH] - fan[0, AZIMUTH] - i * step))
    return np.array([mid_x, mid_y, math.sqrt(spread), uneven, fan[0, AZIMUTH], step])


@njit
def _windows(
    table: Float,
    end: Float,
    bounds: Float,
    fan: Float,
    height: float,
    spot: tuple[float, float],
    windows: Int,
    nearest: Float,
) -> int:
    """Which beams can meet which geom.

    Fills rows (candidate, first beam, last beam) and the least distance at which one can; returns
    how many rows.
    """
    frame = _fan_frame(fan)
    mid_x, mid_y, start, step = frame[0], frame[1], frame[4], frame[5]
    aperture, slope = spot
    spread, widen = frame[2] + aperture + SLACK, frame[3] + slope + SLACK
    count = fan.shape[0]
    stop = start + step * (count - 1)
    wedge = stop - start + 2.0 * widen < math.pi
    left_c, left_s = math.cos(stop + widen), math.sin(stop + widen)
    right_c, right_s = math.cos(start - widen), math.sin(start - widen)
    per_step, lap_steps, found = 1.0 / step, math.tau / step, 0
    for j in range(bounds.shape[0]):
        dx, dy = bounds[j, DISC_X] - mid_x, bounds[j, DISC_Y] - mid_y
        reach = bounds[j, DISC_RADIUS] + spread
        # Outside the wedge of this fan: no trigonometry needed to know it.
        if wedge and (left_c * dy - left_s * dx > reach or right_s * dx - right_c * dy > reach):
            continue
        distance = math.sqrt(dx * dx + dy * dy)
        gap = abs(bounds[j, DISC_Z] - height) - bounds[j, DISC_HALF] - aperture
        if gap > slope * (distance + reach) + SLACK:
            continue
        if table[j, KIND] == BOX and table[j, UPRIGHT] > 0.0 and bounds[j, MOVED] == 0.0:
            near, low, high = _box_extent(table, end, j, dx, dy, spread)
        elif distance <= reach:
            near, low, high = 0.0, -math.pi, math.pi
        else:
            half, centre = _half_angle(reach, distance), _azimuth(dy, dx)
            near, low, high = distance - reach, centre - half, centre + half
        if gap > SLACK:
            near = max(near, (gap - SLACK) / slope)  # a ray that leaves the plane needs that far
        low, high = (low - widen - start) * per_step, (high + widen - start) * per_step
        for lap in (-lap_steps, 0.0, lap_steps):
            if low + lap < count and high + lap >= 0.0:
                windows[found, 0] = j
                windows[found, 1] = max(math.ceil(low + lap), 0)
                windows[found, 2] = min(math.floor(high + lap), count - 1)
                nearest[found] = near
                found += 1
    return found


@njit
def prepare(
    table: Float,
    end: Float,
    bounds: Float,
    angles: Float,
    taus: Float,
    laser: Float,
    spot: tuple[float, float],
) -> tuple[Float, Int, Float]:
    """Lay out a fan and find what it can meet, near things first.

    table    (n, 6) the candidate geoms, ``end`` (n, 12) their poses at the end of the step and
             ``bounds`` (n, 6) as ``follow`` left them
    angles   (m,) rad in the laser frame, ascending by even steps; taus (m,) time of each beam
             within the step, 0..1
    laser    (7,) x, y, yaw at the start of the step, the same at its end, height
    spot     aperture radius m and half divergence rad

    Returns the fan (m, 6); rows (candidate, first beam, last beam), a geom that spans the whole
    circle may have two; and for each row the least distance at which the geom can be met.
    """
    fan = _lay_fan(angles, taus, laser)
    windows = np.empty((3 * table.shape[0], 3), dtype=np.int64)
    nearest = np.empty(3 * table.shape[0])
    found = _windows(table, end, bounds, fan, laser[6], spot, windows, nearest)
    order = np.argsort(nearest[:found])
    return fan, windows[order], nearest[order]
