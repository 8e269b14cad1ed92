# SPDX-License-Identifier: Apache-2.0
"""Exact tests of one ray against MuJoCo's primitive geoms.

The intersection formulas are those of MuJoCo's ``engine_ray.c``, evaluated in the same order, so
that ranges agree with ``mj_multiRay`` to the last bit.
"""

import math

from sim.sensors.lidar import columns as col
from sim.sensors.lidar.fan import Vec3
from slam._jit import inlined, inner

MINVAL = 1e-15  # mjMINVAL
# In the columns of a pose.
Pose = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
Hit = tuple[float, float]  # distance, -1 for a miss; |cos| of the angle to the surface normal
MISS = (-1.0, 0.0)
# m inside the rim of a face, and its least slope to the ray, from which on no rounding can let
# another face of the same geom be met before it: its other faces need not be tested.
INSIDE = 1e-6
SLOPE = 1e-3


@inner
def _quadratic(a: float, b: float, c: float) -> tuple[float, float]:
    """Both roots of a x^2 + 2 b x + c in ascending order, (-1, -1) without real ones."""
    det = b * b - a * c
    if det < MINVAL:
        return -1.0, -1.0
    det = math.sqrt(det)
    return (-b - det) / a, (-b + det) / a


@inner
def _first(low: float, high: float) -> float:
    """The nearest root in front, -1 when both lie behind."""
    if low >= 0.0:
        return low
    return high if high >= 0.0 else -1.0


@inner
def _sphere(dif: Vec3, vec: Vec3, radius_squared: float) -> float:
    a = vec[0] * vec[0] + vec[1] * vec[1] + vec[2] * vec[2]
    b = vec[0] * dif[0] + vec[1] * dif[1] + vec[2] * dif[2]
    c = dif[0] * dif[0] + dif[1] * dif[1] + dif[2] * dif[2] - radius_squared
    low, high = _quadratic(a, b, c)
    return _first(low, high)


@inner
def _passes(dif: Vec3, vec: Vec3, radius_squared: float) -> bool:
    """Whether ``_sphere`` misses; the sign of its roots needs no division."""
    a = vec[0] * vec[0] + vec[1] * vec[1] + vec[2] * vec[2]
    b = vec[0] * dif[0] + vec[1] * dif[1] + vec[2] * dif[2]
    c = dif[0] * dif[0] + dif[1] * dif[1] + dif[2] * dif[2] - radius_squared
    det = b * b - a * c
    return det < MINVAL or (b > 0.0 and math.sqrt(det) < b)


@inner
def _tube(pnt: Vec3, vec: Vec3, radius: float, half: float) -> float:
    """Round side of a cylinder or capsule along local z, between its flat ends."""
    a = vec[0] * vec[0] + vec[1] * vec[1]
    b = vec[0] * pnt[0] + vec[1] * pnt[1]
    c = pnt[0] * pnt[0] + pnt[1] * pnt[1] - radius * radius
    low, high = _quadratic(a, b, c)
    x = _first(low, high)
    return x if x >= 0.0 and abs(pnt[2] + x * vec[2]) <= half else -1.0


@inner
def _nearer(x: float, candidate: float) -> float:
    return candidate if candidate >= 0.0 and (x < 0.0 or candidate < x) else x


@inner
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


@inner
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


@inner
def _ellipsoid(pnt: Vec3, vec: Vec3, size: Vec3) -> float:
    s0, s1, s2 = 1.0 / (size[0] * size[0]), 1.0 / (size[1] * size[1]), 1.0 / (size[2] * size[2])
    a = s0 * vec[0] * vec[0] + s1 * vec[1] * vec[1] + s2 * vec[2] * vec[2]
    b = s0 * vec[0] * pnt[0] + s1 * vec[1] * pnt[1] + s2 * vec[2] * pnt[2]
    c = s0 * pnt[0] * pnt[0] + s1 * pnt[1] * pnt[1] + s2 * pnt[2] * pnt[2] - 1.0
    low, high = _quadratic(a, b, c)
    return _first(low, high)


@inner
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


@inner
def _box(pnt: Vec3, vec: Vec3, size: Vec3) -> Hit:
    best, cos = _slab(pnt, vec, size), abs(vec[0])
    x = _slab((pnt[1], pnt[0], pnt[2]), (vec[1], vec[0], vec[2]), (size[1], size[0], size[2]))
    if x >= 0.0 and (best < 0.0 or x < best):
        best, cos = x, abs(vec[1])
    x = _slab((pnt[2], pnt[0], pnt[1]), (vec[2], vec[0], vec[1]), (size[2], size[0], size[1]))
    if x >= 0.0 and (best < 0.0 or x < best):
        best, cos = x, abs(vec[2])
    return best, min(cos, 1.0)


@inner
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


@inner
def _to_local(pose: Pose, dif: Vec3) -> Vec3:
    """A world difference in the frame of a geom."""
    return (
        pose[col.R00] * dif[0] + pose[col.R10] * dif[1] + pose[col.R20] * dif[2],
        pose[col.R01] * dif[0] + pose[col.R11] * dif[1] + pose[col.R21] * dif[2],
        pose[col.R02] * dif[0] + pose[col.R12] * dif[1] + pose[col.R22] * dif[2],
    )


@inner
def _round_cos(kind: int, pnt: Vec3, ray: Vec3, size: Vec3, x: float) -> float:
    """|cos| between a unit ray and the surface of anything but a box or plane, where it hit."""
    n0, n1, n2 = pnt[0] + x * ray[0], pnt[1] + x * ray[1], pnt[2] + x * ray[2]
    if kind == col.CAPSULE:
        n2 -= min(max(n2, -size[1]), size[1])
    elif kind == col.CYLINDER:
        if abs(abs(n2) - size[1]) < abs(math.sqrt(n0 * n0 + n1 * n1) - size[0]):
            return min(abs(ray[2]), 1.0)
        n2 = 0.0
    elif kind == col.ELLIPSOID:
        n0, n1, n2 = n0 / (size[0] * size[0]), n1 / (size[1] * size[1]), n2 / (size[2] * size[2])
    length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if length < MINVAL:
        return 1.0
    return min(abs(n0 * ray[0] + n1 * ray[1] + n2 * ray[2]) / length, 1.0)


@inner
def _meet_fully(kind: int, size: Vec3, pose: Pose, dif: Vec3, vec: Vec3, limit: float) -> Hit:
    """As ``meet``, of a ray from ``dif`` off the middle, by every face and side there is."""
    if kind == col.SPHERE:
        x = _sphere(dif, vec, size[0] * size[0])
        return x, _round_cos(kind, dif, vec, size, x) if 0.0 <= x <= limit else 0.0
    # MuJoCo tests a bounding sphere first; at a corner it decides, so it is part of the formula.
    if kind == col.BOX:
        if _passes(dif, vec, size[0] * size[0] + size[1] * size[1] + size[2] * size[2]):
            return MISS
        return _box(_to_local(pose, dif), _to_local(pose, vec), size)
    if kind == col.CAPSULE:
        if _passes(dif, vec, (size[0] + size[1]) * (size[0] + size[1])):
            return MISS
    elif kind == col.CYLINDER and _passes(dif, vec, size[0] * size[0] + size[1] * size[1]):
        return MISS
    pnt, ray = _to_local(pose, dif), _to_local(pose, vec)
    if kind == col.CAPSULE:
        x = _capsule(pnt, ray, size[0], size[1])
    elif kind == col.CYLINDER:
        x = _cylinder(pnt, ray, size[0], size[1])
    elif kind == col.ELLIPSOID:
        x = _ellipsoid(pnt, ray, size)
    else:
        return _plane(pnt, ray, size), min(abs(ray[2]), 1.0)
    return x, _round_cos(kind, pnt, ray, size, x) if 0.0 <= x <= limit else 0.0


@inner
def _enters(pnt: Vec3, vec: Vec3, size: Vec3) -> float:
    """Where a ray surely enters a box by a face of axis 0, as ``_slab`` has it; else -1."""
    if abs(vec[0]) > SLOPE and abs(pnt[0]) > size[0]:
        root = ((-size[0] if vec[0] > 0.0 else size[0]) - pnt[0]) / vec[0]
        if (
            root >= 0.0
            and abs(pnt[1] + root * vec[1]) <= size[1] - INSIDE
            and abs(pnt[2] + root * vec[2]) <= size[2] - INSIDE
        ):
            return root
    return -1.0


@inner
def _enters_side(pnt: Vec3, vec: Vec3, radius: float, half: float) -> Hit:
    """Where a ray surely enters a cylinder by its round side, as ``_tube`` has it; else a miss."""
    a = vec[0] * vec[0] + vec[1] * vec[1]
    b = vec[0] * pnt[0] + vec[1] * pnt[1]
    c = pnt[0] * pnt[0] + pnt[1] * pnt[1] - radius * radius
    det = b * b - a * c
    if b < 0.0 and c > 0.0 and det > INSIDE and a > SLOPE:
        x = (-b - math.sqrt(det)) / a
        if abs(pnt[2] + x * vec[2]) <= half - INSIDE:
            n0, n1 = pnt[0] + x * vec[0], pnt[1] + x * vec[1]
            length = math.sqrt(n0 * n0 + n1 * n1)
            return x, min(abs(n0 * vec[0] + n1 * vec[1]) / length, 1.0)
    return MISS


@inlined
def meet(kind: int, size: Vec3, pose: Pose, origin: Vec3, vec: Vec3, limit: float) -> Hit:
    """Where a ray meets a geom, by MuJoCo's formulas; beyond ``limit`` the cosine is not made.

    Numbers, not arrays: to pass arrays costs more than the whole calculation.
    """
    dif = (origin[0] - pose[col.PX], origin[1] - pose[col.PY], origin[2] - pose[col.PZ])
    if kind == col.BOX:
        pnt, ray = _to_local(pose, dif), _to_local(pose, vec)
        x = _enters(pnt, ray, size)
        if x >= 0.0:
            return x, min(abs(ray[0]), 1.0)
        x = _enters((pnt[1], pnt[0], pnt[2]), (ray[1], ray[0], ray[2]), (size[1], size[0], size[2]))
        if x >= 0.0:
            return x, min(abs(ray[1]), 1.0)
    elif kind == col.CYLINDER:
        pnt, ray = _to_local(pose, dif), _to_local(pose, vec)
        x, cos = _enters_side(pnt, ray, size[0], size[1])
        if x >= 0.0:
            return x, cos
    return _meet_fully(kind, size, pose, dif, vec, limit)


@inner
def face_normal(size: Vec3, pose: Pose, at: Vec3) -> Vec3:
    """Axis, in the world, of the face of a box that a point on it is nearest to."""
    pnt = _to_local(pose, (at[0] - pose[col.PX], at[1] - pose[col.PY], at[2] - pose[col.PZ]))
    gap0, gap1 = abs(abs(pnt[0]) - size[0]), abs(abs(pnt[1]) - size[1])
    gap2 = abs(abs(pnt[2]) - size[2])
    if gap0 <= gap1 and gap0 <= gap2:
        return pose[col.R00], pose[col.R10], pose[col.R20]
    if gap1 <= gap2:
        return pose[col.R01], pose[col.R11], pose[col.R21]
    return pose[col.R02], pose[col.R12], pose[col.R22]
