# SPDX-License-Identifier: Apache-2.0
"""Kernels that cast a fan of laser beams on MuJoCo's primitive geoms.

The intersection formulas are those of MuJoCo's ``engine_ray.c``, evaluated in the same order, so
that ranges and geom ids agree with ``mj_multiRay`` to the last bit. What makes it fast is the
order of work: each geom is turned into the interval of beams that can meet it, so a beam meets
about two exact tests instead of one for every geom (design note, world section 1.2).

A fan is a set of beams at even steps of azimuth. Every beam has its own time within one physics
step, hence its own origin and direction (the robot moves) and its own pose of each moving geom
(linear between the start and the end of the step). A beam is K rays over the disc of its spot; an
ideal beam is the one ray (0, 0).

All kernels live in this one module because the compile cache does not see edits in a callee of
another module.
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
MINVAL = 1e-15  # mjMINVAL
SLACK = 5e-5  # rad and m by which bounds are widened: above what ``_azimuth`` and rounding miss

# Columns of the geom table.
KIND, SIZE_X, SIZE_Y, SIZE_Z, HALF_HEIGHT, UPRIGHT = range(6)


@njit
def _quadratic(a: float, b: float, c: float) -> tuple[float, float]:
    """Both roots of a x^2 + 2 b x + c in ascending order, (-1, -1) without real ones."""
    det = b * b - a * c
    if det < MINVAL:
        return -1.0, -1.0
    det = math.sqrt(det)
    return (-b - det) / a, (-b + det) / a


@njit
def _first(low: float, high: float) -> float:
    """The nearest root in front, -1 when both lie behind."""
    if low >= 0.0:
        return low
    return high if high >= 0.0 else -1.0


@njit
def _sphere(dif: Vec3, vec: Vec3, radius_squared: float) -> float:
    a = vec[0] * vec[0] + vec[1] * vec[1] + vec[2] * vec[2]
    b = vec[0] * dif[0] + vec[1] * dif[1] + vec[2] * dif[2]
    c = dif[0] * dif[0] + dif[1] * dif[1] + dif[2] * dif[2] - radius_squared
    low, high = _quadratic(a, b, c)
    return _first(low, high)


@njit
def _tube(pnt: Vec3, vec: Vec3, radius: float, half: float) -> float:
    """Round side of a cylinder or capsule along local z, between its flat ends."""
    a = vec[0] * vec[0] + vec[1] * vec[1]
    b = vec[0] * pnt[0] + vec[1] * pnt[1]
    c = pnt[0] * pnt[0] + pnt[1] * pnt[1] - radius * radius
    low, high = _quadratic(a, b, c)
    x = _first(low, high)
    return x if x >= 0.0 and abs(pnt[2] + x * vec[2]) <= half else -1.0


@njit
def _nearer(x: float, candidate: float) -> float:
    return candidate if candidate >= 0.0 and (x < 0.0 or candidate < x) else x


@njit
def _capsule(pnt: Vec3, vec: Vec3, radius: float, half: float) -> float:
    x = _tube(pnt, vec, radius, half)
    a = vec[0] * vec[0] + vec[1] * vec[1] + vec[2] * vec[2]
    for side in (1.0, -1.0):
        z = pnt[2] - side * half
        b = vec[0] * pnt[0] + vec[1] * pnt[1] + vec[2] * z
        c = pnt[0] * pnt[0] + pnt[1] * pnt[1] + z * z - radius * radius
        for root in _quadratic(a, b, c):
            if root >= 0.0 and side * (pnt[2] + root * vec[2]) >= half:
                x = _nearer(x, root)
    return x


@njit
def _cylinder(pnt: Vec3, vec: Vec3, radius: float, half: float) -> float:
    x = -1.0
    if abs(vec[2]) > MINVAL:
        for side in (-1.0, 1.0):
            root = (side * half - pnt[2]) / vec[2]
            if root >= 0.0:
                p0 = pnt[0] + root * vec[0]
                p1 = pnt[1] + root * vec[1]
                if p0 * p0 + p1 * p1 <= radius * radius:
                    x = _nearer(x, root)
    return _nearer(x, _tube(pnt, vec, radius, half))


@njit
def _ellipsoid(pnt: Vec3, vec: Vec3, size: Vec3) -> float:
    s0, s1, s2 = 1.0 / (size[0] * size[0]), 1.0 / (size[1] * size[1]), 1.0 / (size[2] * size[2])
    a = s0 * vec[0] * vec[0] + s1 * vec[1] * vec[1] + s2 * vec[2] * vec[2]
    b = s0 * vec[0] * pnt[0] + s1 * vec[1] * pnt[1] + s2 * vec[2] * pnt[2]
    c = s0 * pnt[0] * pnt[0] + s1 * pnt[1] * pnt[1] + s2 * pnt[2] * pnt[2] - 1.0
    low, high = _quadratic(a, b, c)
    return _first(low, high)


@njit
def _slab(pnt: Vec3, vec: Vec3, size: Vec3) -> float:
    """Nearest face of a box whose axis 0 is the face normal (callers permute the axes)."""
    x = -1.0
    if abs(vec[0]) > MINVAL:
        for side in (-1.0, 1.0):
            root = (side * size[0] - pnt[0]) / vec[0]
            if (
                root >= 0.0
                and abs(pnt[1] + root * vec[1]) <= size[1]
                and abs(pnt[2] + root * vec[2]) <= size[2]
            ):
                x = _nearer(x, root)
    return x


@njit
def _box(pnt: Vec3, vec: Vec3, size: Vec3) -> float:
    x = _slab(pnt, vec, size)
    x = _nearer(
        x,
        _slab((pnt[1], pnt[0], pnt[2]), (vec[1], vec[0], vec[2]), (size[1], size[0], size[2])),
    )
    return _nearer(
        x,
        _slab((pnt[2], pnt[0], pnt[1]), (vec[2], vec[0], vec[1]), (size[2], size[0], size[1])),
    )


@njit
def _plane(pnt: Vec3, vec: Vec3, size: Vec3) -> float:
    if vec[2] > -MINVAL:
        return -1.0
    x = -pnt[2] / vec[2]
    if x < 0.0:
        return -1.0
    if size[0] > 0.0 and abs(pnt[0] + x * vec[0]) > size[0]:
        return -1.0
    if size[1] > 0.0 and abs(pnt[1] + x * vec[1]) > size[1]:
        return -1.0
    return x


@njit
def _to_local(poses: Float, row: int, dif: Vec3) -> Vec3:
    """A world difference in the frame of a geom; rows of ``poses``: position, matrix by rows."""
    return (
        poses[row, 3] * dif[0] + poses[row, 6] * dif[1] + poses[row, 9] * dif[2],
        poses[row, 4] * dif[0] + poses[row, 7] * dif[1] + poses[row, 10] * dif[2],
        poses[row, 5] * dif[0] + poses[row, 8] * dif[1] + poses[row, 11] * dif[2],
    )


@njit
def _distance(table: Float, j: int, poses: Float, row: int, origin: Vec3, vec: Vec3) -> float:
    """Distance from ``origin`` along ``vec`` to geom j, -1 for a miss (MuJoCo's formulas)."""
    kind = int(table[j, KIND])
    size = (table[j, SIZE_X], table[j, SIZE_Y], table[j, SIZE_Z])
    dif = (origin[0] - poses[row, 0], origin[1] - poses[row, 1], origin[2] - poses[row, 2])
    if kind == SPHERE:
        return _sphere(dif, vec, size[0] * size[0])
    # MuJoCo tests a bounding sphere first; at a corner it decides, so it is part of the formula.
    if kind == BOX:
        bound = size[0] * size[0] + size[1] * size[1] + size[2] * size[2]
        if _sphere(dif, vec, bound) < 0.0:
            return -1.0
    elif kind == CAPSULE:
        if _sphere(dif, vec, (size[0] + size[1]) * (size[0] + size[1])) < 0.0:
            return -1.0
    elif kind == CYLINDER and _sphere(dif, vec, size[0] * size[0] + size[1] * size[1]) < 0.0:
        return -1.0
    pnt, ray = _to_local(poses, row, dif), _to_local(poses, row, vec)
    if kind == BOX:
        return _box(pnt, ray, size)
    if kind == CAPSULE:
        return _capsule(pnt, ray, size[0], size[1])
    if kind == CYLINDER:
        return _cylinder(pnt, ray, size[0], size[1])
    if kind == ELLIPSOID:
        return _ellipsoid(pnt, ray, size)
    return _plane(pnt, ray, size)


@njit
def _box_cos(pnt: Vec3, ray: Vec3, size: Vec3, x: float) -> float:
    """Of a box: the face it hit is the one its point is nearest to."""
    gap0 = abs(abs(pnt[0] + x * ray[0]) - size[0])
    gap1 = abs(abs(pnt[1] + x * ray[1]) - size[1])
    gap2 = abs(abs(pnt[2] + x * ray[2]) - size[2])
    if gap0 <= gap1 and gap0 <= gap2:
        return abs(ray[0])
    return abs(ray[1]) if gap1 <= gap2 else abs(ray[2])


@njit
def _cos_incidence(
    table: Float, j: int, poses: Float, row: int, origin: Vec3, vec: Vec3, distance: float
) -> float:
    """|cos| of the angle between a unit ray and the surface normal where it hit.

    Tables and rows instead of slices: to slice costs more than the whole calculation.
    """
    kind = int(table[j, KIND])
    s0, s1, s2 = table[j, SIZE_X], table[j, SIZE_Y], table[j, SIZE_Z]
    dif = (origin[0] - poses[row, 0], origin[1] - poses[row, 1], origin[2] - poses[row, 2])
    pnt, ray = _to_local(poses, row, dif), _to_local(poses, row, vec)
    if kind == BOX:
        return min(_box_cos(pnt, ray, (s0, s1, s2), distance), 1.0)
    if kind == PLANE:
        return min(abs(ray[2]), 1.0)
    n0, n1, n2 = pnt[0] + distance * ray[0], pnt[1] + distance * ray[1], pnt[2] + distance * ray[2]
    if kind == CAPSULE:
        n2 -= min(max(n2, -s1), s1)
    elif kind == CYLINDER:
        if abs(abs(n2) - s1) < abs(math.sqrt(n0 * n0 + n1 * n1) - s0):
            return min(abs(ray[2]), 1.0)
        n2 = 0.0
    elif kind == ELLIPSOID:
        n0, n1, n2 = n0 / (s0 * s0), n1 / (s1 * s1), n2 / (s2 * s2)
    length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if length < MINVAL:
        return 1.0
    return min(abs(n0 * ray[0] + n1 * ray[1] + n2 * ray[2]) / length, 1.0)


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


# Columns of the fan: azimuth, origin, direction, time within the step.
AZIMUTH, ORIGIN_X, ORIGIN_Y, COS, SIN, TAU = range(6)


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
def _ray(
    fan: Float, i: int, height: float, rays: Float, k: int, aperture: float
) -> tuple[Vec3, Vec3]:
    """Origin and unit direction of ray k of beam i; ``rays`` rows are (u, v, dx, dy, dz)."""
    c, s = fan[i, COS], fan[i, SIN]
    u, v = aperture * rays[k, 0], aperture * rays[k, 1]
    origin = (fan[i, ORIGIN_X] - s * u, fan[i, ORIGIN_Y] + c * u, height + v)
    dx, dy = rays[k, 2], rays[k, 3]
    return origin, (c * dx - s * dy, s * dx + c * dy, rays[k, 4])


@njit
def _pose_at(start: Float, end: Float, j: int, tau: float, out: Float) -> None:
    """Pose of moving geom j at ``tau``, 0..1, into row 0 of ``out``.

    Linear in the matrix too: at the 0.01 rad a body turns in one step the error is 1e-5 of its
    size.
    """
    for i in range(12):
        out[0, i] = start[j, i] + tau * (end[j, i] - start[j, i])


# Columns of the bounds: a disc that contains the geom during the whole step, its height above the
# ground and half its vertical extent; and whether the geom moved in the step.
DISC_X, DISC_Y, DISC_RADIUS, DISC_Z, DISC_HALF, MOVED = range(6)


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
def cast_fan(
    table: Float,
    poses: tuple[Float, Float],
    bounds: Float,
    fan_of: tuple[Int, Float, Float],
    laser: Float,
    optics: tuple[Float, tuple[float, float]],
    out: tuple[Float, Int, Float],
) -> None:
    """Cast the beams of one physics step.

    table   (n, 6) the candidate geoms
    poses   (n, 12) of them at the start and at the end of the step, and their ``bounds`` (n, 6)
    fan_of  beams (m,) rows of the outputs; angles (m,) rad in the laser frame, ascending by even
            steps; taus (m,) time within the step, 0..1
    laser   (7,) x, y, yaw at the start, the same at the end, height
    optics  rays (k, 5): place u, v on the disc of the spot and unit direction in the beam's frame;
            aperture radius m and half divergence rad
    out     (all beams, k) each: ranges m, inf for a miss; index of the candidate, -1; |cos| of the
            incidence, NaN. Must come in as misses.
    """
    start, end = poses
    beams, angles, taus = fan_of
    rays, spot = optics
    ranges, hits, _ = out
    fan = _lay_fan(angles, taus, laser)
    height, aperture = laser[6], spot[0]
    windows = np.empty((3 * table.shape[0], 3), dtype=np.int64)
    nearest = np.empty(3 * table.shape[0])
    found = _windows(table, end, bounds, fan, height, spot, windows, nearest)
    pose = np.empty((1, 12))
    # Near things first: what they hide needs no exact test.
    for row in np.argsort(nearest[:found]):
        j, near = windows[row, 0], nearest[row]
        moves = bounds[j, MOVED] != 0.0
        for i in range(windows[row, 1], windows[row, 2] + 1):
            beam = beams[i]
            for k in range(rays.shape[0]):
                best = ranges[beam, k]
                if near > best:
                    continue
                origin, vec = _ray(fan, i, height, rays, k, aperture)
                if moves:
                    _pose_at(start, end, j, fan[i, TAU], pose)
                    x = _distance(table, j, pose, 0, origin, vec)
                else:
                    x = _distance(table, j, end, j, origin, vec)
                # Equal distances go to the lower id, as in MuJoCo's loop over ascending ids.
                if x >= 0.0 and (x < best or (x == best and j < hits[beam, k])):
                    ranges[beam, k] = x
                    hits[beam, k] = j
    _fill_incidence(table, poses, bounds, fan, beams, laser[6], optics, out)


@njit
def _fill_incidence(
    table: Float,
    poses: tuple[Float, Float],
    bounds: Float,
    fan: Float,
    beams: Int,
    height: float,
    optics: tuple[Float, tuple[float, float]],
    out: tuple[Float, Int, Float],
) -> None:
    """Second pass: cosine of incidence at each hit."""
    start, end = poses
    rays, spot = optics
    ranges, hits, cosines = out
    pose = np.empty((1, 12))
    for i in range(beams.size):
        for k in range(rays.shape[0]):
            j = hits[beams[i], k]
            if j < 0:
                continue
            origin, vec = _ray(fan, i, height, rays, k, spot[0])
            x = ranges[beams[i], k]
            if bounds[j, MOVED] != 0.0:
                _pose_at(start, end, j, fan[i, TAU], pose)
                cosines[beams[i], k] = _cos_incidence(table, j, pose, 0, origin, vec, x)
            else:
                cosines[beams[i], k] = _cos_incidence(table, j, end, j, origin, vec, x)


@njit
def arccos(cosines: Float) -> Float:
    """Elementwise, by libm: NumPy's own changes its last bit with the CPU."""
    out = np.empty(cosines.size)
    for i in range(cosines.size):
        out[i] = math.acos(cosines[i])
    return out
