# SPDX-License-Identifier: Apache-2.0
"""Exact tests of rays against MuJoCo's primitive geoms.

The intersection formulas are those of MuJoCo's ``engine_ray.c``, evaluated in the same order, so
that ranges and geom ids agree with ``mj_multiRay`` to the last bit. Each beam meets each moving
geom at the beam's own time: poses are linear between the start and the end of a physics step.
A beam is k rays over the disc of its spot; an ideal beam is the one ray in the middle.

No kernel here calls one of another module: the compile cache does not see edits in such a callee.
"""

from __future__ import annotations

import math

import numpy as np

from sim.fan import (
    BOX,
    CAPSULE,
    COS,
    CYLINDER,
    ELLIPSOID,
    KIND,
    MOVED,
    ORIGIN_X,
    ORIGIN_Y,
    PLANE,
    SIN,
    SIZE_X,
    SIZE_Y,
    SIZE_Z,
    SPHERE,
    TAU,
    Float,
    Int,
    Vec3,
)  # fmt: skip
from slam._jit import njit

MINVAL = 1e-15  # mjMINVAL


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
def _cos(
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


@njit
def cast_fan(
    table: Float,
    poses: tuple[Float, Float],
    bounds: Float,
    plan: tuple[Float, Int, Float],
    beams: Int,
    height: float,
    optics: tuple[Float, float],
    out: tuple[Float, Int, Float],
) -> None:
    """Cast the beams of one physics step.

    table   (n, 6) the candidate geoms
    poses   (n, 12) of them at the start and at the end of the step, and their ``bounds`` (n, 6)
    plan    of ``sim.fan.prepare``; ``beams`` (m,) the rows of the outputs its beams go to
    height  m, of the scan plane
    optics  rays (k, 5): place u, v on the disc of the spot and unit direction in the beam's frame;
            aperture radius m
    out     (all beams, k) each: ranges m, inf for a miss; index of the candidate, -1; |cos| of the
            incidence, NaN. Must come in as misses.
    """
    start, end = poses
    fan, windows, nearest = plan
    rays, aperture = optics
    ranges, hits, cosines = out
    pose = np.empty((1, 12))
    for row in range(windows.shape[0]):
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
    for i in range(beams.size):
        beam = beams[i]
        for k in range(rays.shape[0]):
            j = hits[beam, k]
            if j < 0:
                continue
            origin, vec = _ray(fan, i, height, rays, k, aperture)
            if bounds[j, MOVED] != 0.0:
                _pose_at(start, end, j, fan[i, TAU], pose)
                cosines[beam, k] = _cos(table, j, pose, 0, origin, vec, ranges[beam, k])
            else:
                cosines[beam, k] = _cos(table, j, end, j, origin, vec, ranges[beam, k])


@njit
def arccos(cosines: Float) -> Float:
    """Elementwise, by libm: NumPy's own changes its last bit with the CPU."""
    out = np.empty(cosines.size)
    for i in range(cosines.size):
        out[i] = math.acos(cosines[i])
    return out
