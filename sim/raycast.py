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
SLACK = 1e-7  # rad and m by which bounds are widened, far above rounding

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
def _to_local(pose: Float, dif: Vec3) -> Vec3:
    """A world difference in the frame of a geom; ``pose`` is (12,) position then matrix by rows."""
    return (
        pose[3] * dif[0] + pose[6] * dif[1] + pose[9] * dif[2],
        pose[4] * dif[0] + pose[7] * dif[1] + pose[10] * dif[2],
        pose[5] * dif[0] + pose[8] * dif[1] + pose[11] * dif[2],
    )


@njit
def _distance(geom: Float, pose: Float, origin: Vec3, vec: Vec3) -> float:
    """Distance from ``origin`` along ``vec`` to one geom, -1 for a miss (MuJoCo's formulas)."""
    kind = int(geom[KIND])
    size = (geom[SIZE_X], geom[SIZE_Y], geom[SIZE_Z])
    dif = (origin[0] - pose[0], origin[1] - pose[1], origin[2] - pose[2])
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
    pnt, ray = _to_local(pose, dif), _to_local(pose, vec)
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
def _cos_incidence(geom: Float, pose: Float, origin: Vec3, vec: Vec3, distance: float) -> float:
    """|cos| of the angle between a ray and the surface normal where it hit."""
    kind = int(geom[KIND])
    s0, s1, s2 = geom[SIZE_X], geom[SIZE_Y], geom[SIZE_Z]
    dif = (origin[0] - pose[0], origin[1] - pose[1], origin[2] - pose[2])
    pnt, ray = _to_local(pose, dif), _to_local(pose, vec)
    x, y, z = pnt[0] + distance * ray[0], pnt[1] + distance * ray[1], pnt[2] + distance * ray[2]
    n0, n1, n2 = x, y, z
    if kind == BOX:
        gap0, gap1, gap2 = abs(abs(x) - s0), abs(abs(y) - s1), abs(abs(z) - s2)
        n0 = 1.0 if gap0 <= gap1 and gap0 <= gap2 else 0.0
        n1 = 1.0 if n0 == 0.0 and gap1 <= gap2 else 0.0
        n2 = 1.0 if n0 == 0.0 and n1 == 0.0 else 0.0
    elif kind == CAPSULE:
        n2 = z - min(max(z, -s1), s1)
    elif kind == CYLINDER:
        if abs(abs(z) - s1) < abs(math.sqrt(x * x + y * y) - s0):
            n0, n1, n2 = 0.0, 0.0, 1.0
        else:
            n2 = 0.0
    elif kind == ELLIPSOID:
        n0, n1, n2 = x / (s0 * s0), y / (s1 * s1), z / (s2 * s2)
    elif kind == PLANE:
        n0, n1, n2 = 0.0, 0.0, 1.0
    length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    length *= math.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2])
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
def _box_extent(geom: Float, pose: Float, dx: float, dy: float, spread: float) -> Vec3:
    """(nearest distance, azimuth low, azimuth high) of an upright box seen from (-dx, -dy).

    The azimuths are relative to that of the box's centre; widened for origins up to ``spread``
    away. All around when the box may contain such an origin.
    """
    ux, uy, wx, wy = pose[3], pose[6], pose[4], pose[7]
    across = max(abs(dx * ux + dy * uy) - geom[SIZE_X], 0.0)
    along = max(abs(dx * wx + dy * wy) - geom[SIZE_Y], 0.0)
    nearest = math.sqrt(across * across + along * along) - spread
    if nearest <= SLACK:
        return 0.0, -math.pi, math.pi
    low, high = 0.0, 0.0
    for i in range(4):
        sx = geom[SIZE_X] if i & 1 else -geom[SIZE_X]
        sy = geom[SIZE_Y] if i & 2 else -geom[SIZE_Y]
        cx, cy = dx + sx * ux + sy * wx, dy + sx * uy + sy * wy
        angle = math.atan2(dx * cy - dy * cx, dx * cx + dy * cy)
        low, high = min(low, angle), max(high, angle)
    # Every corner is farther than ``nearest``, so this is the largest shift of any of them.
    widen = math.asin(spread / (nearest + spread)) if spread > 0.0 else 0.0
    return nearest, low - widen, high + widen


# Columns of the fan: azimuth, origin, direction, time within the step.
AZIMUTH, ORIGIN_X, ORIGIN_Y, COS, SIN, TAU = range(6)


@njit
def _wrapped(angle: float) -> float:
    return angle - math.tau * math.floor(angle / math.tau + 0.5)


@njit
def _lay_fan(angles: Float, taus: Float, start: Float, end: Float) -> Float:
    """(m, 6) table of the beams in the world; the laser moves evenly from ``start`` to ``end``."""
    fan = np.empty((angles.size, 6))
    turn = _wrapped(end[2] - start[2])
    for i in range(angles.size):
        tau = taus[i]
        azimuth = start[2] + tau * turn + angles[i]
        fan[i, AZIMUTH] = azimuth
        fan[i, ORIGIN_X] = start[0] + tau * (end[0] - start[0])
        fan[i, ORIGIN_Y] = start[1] + tau * (end[1] - start[1])
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
def _pose_at(now: Float, before: Float, moves: bool, tau: float, out: Float) -> None:
    """Pose of a geom at ``tau``; exactly ``now`` where it rests.

    Linear in the matrix too: at the 0.01 rad a body turns in one step the error is 1e-5 of its
    size.
    """
    for j in range(12):
        out[j] = before[j] + tau * (now[j] - before[j]) if moves else now[j]


@njit
def _fan_frame(fan: Float) -> tuple[float, float, float, float]:
    """(mid x, mid y, spread of the origins m, largest unevenness of the azimuths rad)."""
    last = fan.shape[0] - 1
    mid_x = 0.5 * (fan[0, ORIGIN_X] + fan[last, ORIGIN_X])
    mid_y = 0.5 * (fan[0, ORIGIN_Y] + fan[last, ORIGIN_Y])
    step = (fan[last, AZIMUTH] - fan[0, AZIMUTH]) / max(last, 1)
    spread, uneven = 0.0, 0.0
    for i in range(last + 1):
        x, y = fan[i, ORIGIN_X] - mid_x, fan[i, ORIGIN_Y] - mid_y
        spread = max(spread, x * x + y * y)
        uneven = max(uneven, abs(fan[i, AZIMUTH] - fan[0, AZIMUTH] - i * step))
    return mid_x, mid_y, math.sqrt(spread), uneven


@njit
def _extent(
    geom: Float, now: Float, dx: float, dy: float, radius: float, moves: bool, spread: float
) -> Vec3:
    """(nearest distance, azimuth low, azimuth high) of a geom, relative to its centre's azimuth."""
    if geom[KIND] == BOX and geom[UPRIGHT] > 0.0 and not moves:
        return _box_extent(geom, now, dx, dy, spread)
    distance = math.sqrt(dx * dx + dy * dy)
    reach = radius + spread
    if distance <= reach + SLACK:
        return 0.0, -math.pi, math.pi
    half = math.asin(reach / distance)
    return distance - reach, -half, half


@njit
def _cast_geom(
    geom: Float,
    geom_id: int,
    poses: tuple[Float, Float],
    moves: bool,
    window: tuple[int, int, float],
    fan: Float,
    optics: tuple[float, float, Float],
    beams: Int,
    ranges: Float,
    geoms: Int,
    pose: Float,
) -> None:
    """Exact tests of one geom against beams first..last that do not end before ``nearest``."""
    first, last, nearest = window
    height, aperture, rays = optics
    if not moves:
        _pose_at(poses[0], poses[1], False, 0.0, pose)
    for i in range(first, last + 1):
        beam = beams[i]
        if moves:
            _pose_at(poses[0], poses[1], True, fan[i, TAU], pose)
        for k in range(rays.shape[0]):
            best = ranges[beam, k]
            if nearest > best:
                continue
            origin, vec = _ray(fan, i, height, rays, k, aperture)
            x = _distance(geom, pose, origin, vec)
            # Equal distances go to the lower id, as in MuJoCo's loop over ascending ids.
            if x >= 0.0 and (x < best or (x == best and geom_id < geoms[beam, k])):
                ranges[beam, k] = x
                geoms[beam, k] = geom_id


@njit
def _first_beam(low: float, start: float, step: float) -> int:
    return max(math.ceil((low - start) / step), 0)


@njit
def _last_beam(high: float, start: float, step: float, count: int) -> int:
    return min(math.floor((high - start) / step), count - 1)


@njit
def remember(ids: Int, xpos: Float, xmat: Float, before: Float) -> None:
    """Keep the poses of the candidate geoms: ``before`` (n, 12) is position then matrix by rows."""
    for j in range(ids.size):
        g = ids[j]
        for i in range(3):
            before[j, i] = xpos[g, i]
        for i in range(9):
            before[j, 3 + i] = xmat[g, i]


@njit
def cast_fan(
    table: Float,
    ids: Int,
    before: Float,
    xpos: Float,
    xmat: Float,
    beams: Int,
    angles: Float,
    taus: Float,
    laser: Float,
    rays: Float,
    spot: tuple[float, float],
    ranges: Float,
    geoms: Int,
    cosines: Float,
) -> None:
    """Cast the beams of one physics step; then ``before`` holds the poses at its end.

    table    (n, 6) of the candidate geoms ``ids`` (n,)
    before   (n, 12) their poses at the start of the step; xpos, xmat: all geoms at its end
    beams    (m,) rows of the outputs; angles (m,) rad in the laser frame, ascending by even steps;
             taus (m,) time within the step, 0..1
    laser    (7,) x, y, yaw at the start, the same at the end, height
    rays     (k, 5) place u, v on the disc of the spot and unit direction in the beam's frame
    spot     aperture radius m, half divergence rad
    Outputs, of shape (all beams, k): ranges m (inf for a miss), geoms id (-1), cosines of
    incidence (NaN for a miss).
    """
    fan = _lay_fan(angles, taus, laser[0:3], laser[3:6])
    count, height = beams.size, laser[6]
    mid_x, mid_y, spread, uneven = _fan_frame(fan)
    aperture, slope = spot
    spread += aperture
    start = fan[0, AZIMUTH]
    step = (fan[count - 1, AZIMUTH] - start) / (count - 1) if count > 1 else 1.0
    half = 0.5 * step * (count - 1)
    middle, widen = start + half, uneven + slope + SLACK
    wedge = half + widen < 0.5 * math.pi
    left_c, left_s = math.cos(middle + half + widen), math.sin(middle + half + widen)
    right_c, right_s = math.cos(middle - half - widen), math.sin(middle - half - widen)
    now, pose = np.empty(12), np.empty(12)
    optics = (height, aperture, rays)
    for j in range(ids.size):
        g = ids[j]
        now[0], now[1], now[2] = xpos[g, 0], xpos[g, 1], xpos[g, 2]
        moves, lift = False, 0.0
        for i in range(9):
            now[3 + i] = xmat[g, i]
        for i in range(12):
            moves = moves or now[i] != before[j, i]
        dx, dy = now[0] - mid_x, now[1] - mid_y
        radius = _horizontal_bound(table[j], now)
        if moves:
            sx, sy = 0.5 * (now[0] - before[j, 0]), 0.5 * (now[1] - before[j, 1])
            dx, dy = dx - sx, dy - sy
            radius = max(radius, _horizontal_bound(table[j], before[j]))
            radius += math.sqrt(sx * sx + sy * sy)
            lift = abs(now[2] - before[j, 2])
        reach = radius + spread
        # Outside the wedge of this fan: no trigonometry needed to know it.
        if wedge and (
            left_c * dy - left_s * dx > reach + SLACK or right_s * dx - right_c * dy > reach + SLACK
        ):
            continue
        gap = abs(now[2] - height) - table[j, HALF_HEIGHT] - aperture - lift
        if gap > slope * (math.sqrt(dx * dx + dy * dy) + reach) + SLACK:
            continue
        nearest, low, high = _extent(table[j], now, dx, dy, radius, moves, spread)
        centre = middle + _wrapped(math.atan2(dy, dx) - middle)
        for lap in (-math.tau, 0.0, math.tau):
            first = _first_beam(centre + lap + low - widen, start, step)
            last = _last_beam(centre + lap + high + widen, start, step, count)
            if first <= last:
                window = (first, last, nearest)
                _cast_geom(
                    table[j], g, (now, before[j]), moves, window, fan, optics, beams,
                    ranges, geoms, pose,
                )  # fmt: skip
    _fill_incidence(table, ids, before, xpos, xmat, fan, optics, beams, ranges, geoms, cosines)
    remember(ids, xpos, xmat, before)


@njit
def _fill_incidence(
    table: Float,
    ids: Int,
    before: Float,
    xpos: Float,
    xmat: Float,
    fan: Float,
    optics: tuple[float, float, Float],
    beams: Int,
    ranges: Float,
    geoms: Int,
    cosines: Float,
) -> None:
    """Second pass: cosine of incidence at each hit."""
    height, aperture, rays = optics
    now, pose = np.empty(12), np.empty(12)
    for i in range(beams.size):
        for k in range(rays.shape[0]):
            g = geoms[beams[i], k]
            if g < 0:
                continue
            j = np.searchsorted(ids, g)
            for axis in range(3):
                now[axis] = xpos[g, axis]
            for entry in range(9):
                now[3 + entry] = xmat[g, entry]
            _pose_at(now, before[j], True, fan[i, TAU], pose)
            origin, vec = _ray(fan, i, height, rays, k, aperture)
            x = ranges[beams[i], k]
            cosines[beams[i], k] = _cos_incidence(table[j], pose, origin, vec, x)


@njit
def arccos(cosines: Float) -> Float:
    """Elementwise, by libm: NumPy's own changes its last bit with the CPU."""
    out = np.empty(cosines.size)
    for i in range(cosines.size):
        out[i] = math.acos(cosines[i])
    return out
