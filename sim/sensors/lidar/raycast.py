# SPDX-License-Identifier: Apache-2.0
"""Casts the beams of a sweep on a model's geoms, bit for bit as ``mj_multiRay`` would.

Each beam meets each moving geom at the beam's own time: poses are linear between physics steps. A
beam is k rays over the disc of its spot; an ideal beam is the one ray in the middle.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar.fan import (
    BOX,
    COS,
    DISC_HALF,
    DISC_RADIUS,
    DISC_X,
    DISC_Y,
    DISC_Z,
    FAR,
    HIGH,
    KIND,
    LAYER,
    LOW,
    MOVED,
    NEAR,
    ORIGIN_X,
    ORIGIN_Y,
    PART,
    PER_RADIAN,
    SIN,
    SIZE_X,
    SIZE_Y,
    SIZE_Z,
    SLACK,
    SLOT,
    START,
    UNEVEN,
    Float,
    Int,
    Vec3,
    lay_fans,
    ray_wedge,
)
from sim.sensors.lidar.ray_shapes import Pose, face_normal, meet
from sim.sensors.lidar.windows import enclose, find_windows, nearest_first
from slam._jit import njit

# Columns of the rays of a spot in the beam's frame: place on the disc (left, up), unit direction
# (forward, left, up), and the way up per metre forward.
U, V, FORWARD, LEFT, UP, SLOPE = range(6)

Ray = tuple[Vec3, Vec3]
AWAY = 1e-6  # m from a mirror at which what it shows begins, so that it does not show itself


@njit
def _pose(poses: Float, slot: int, j: int) -> Pose:
    """Pose of geom j in a slot."""
    return (
        poses[slot, j, 0], poses[slot, j, 1], poses[slot, j, 2], poses[slot, j, 3],
        poses[slot, j, 4], poses[slot, j, 5], poses[slot, j, 6], poses[slot, j, 7],
        poses[slot, j, 8], poses[slot, j, 9], poses[slot, j, 10], poses[slot, j, 11],
    )  # fmt: skip


@njit
def _between(a: Pose, b: Pose, t: float) -> Pose:
    """Pose on the way from a to b, ``t`` 0..1.

    Linear in the matrix too: at the 0.01 rad a body turns in one step the error is 1e-5 of its
    size.
    """
    return (
        a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]),
        a[3] + t * (b[3] - a[3]), a[4] + t * (b[4] - a[4]), a[5] + t * (b[5] - a[5]),
        a[6] + t * (b[6] - a[6]), a[7] + t * (b[7] - a[7]), a[8] + t * (b[8] - a[8]),
        a[9] + t * (b[9] - a[9]), a[10] + t * (b[10] - a[10]), a[11] + t * (b[11] - a[11]),
    )  # fmt: skip


@njit
def _ray(c: float, s: float, x: float, y: float, z: float, lever: Vec3, way: Vec3) -> Ray:  # noqa: PLR0913 (kernel)
    """Origin and unit direction in the world of a ray of the beam that leaves (x, y, z).

    c, s   direction of the beam; ``lever`` (_, left m, up m) and ``way`` (forward, left, up) of
           the ray in the beam's frame
    """
    origin = (x - s * lever[1], y + c * lever[1], z + lever[2])
    return origin, (c * way[0] - s * way[1], s * way[0] + c * way[1], way[2])


@njit
def _cast_windows(  # noqa: PLR0913, PLR0915 (kernel)
    table: Float,
    poses: Float,
    bounds: Float,
    ends: Int,
    beams: Int,
    rays: Float,
    optics: Vec3,
    work: tuple[Float, Float, Float, Float, Int, Int],
    found: int,
    out: tuple[Float, Int, Float],
) -> None:
    """Test the rays of each window's beams on its geom, near windows first."""
    fan, frames, farthest, windows, owners, order = work
    height, aperture, slope = optics
    ranges, hits, cosines = out
    count = rays.shape[0]
    for turn in range(found):
        row = order[turn]
        j, near, far = owners[row], windows[row, NEAR], windows[row, FAR]
        kind, layer = int(table[j, KIND]), int(table[j, LAYER])
        size = (table[j, SIZE_X], table[j, SIZE_Y], table[j, SIZE_Z])
        moves, pose = bounds[j, MOVED] != 0.0, _pose(poses, 0, j)
        bottom = bounds[j, DISC_Z] - bounds[j, DISC_HALF] - SLACK
        top = bounds[j, DISC_Z] + bounds[j, DISC_HALF] + SLACK
        for f in range(frames.shape[0]):
            per_step, base = frames[f, PER_RADIAN], ends[f]
            lowest = (windows[row, LOW] - frames[f, UNEVEN] - frames[f, START]) * per_step
            highest = (windows[row, HIGH] + frames[f, UNEVEN] - frames[f, START]) * per_step
            margin = slope * per_step
            first = base + max(math.ceil(lowest - margin), 0)
            last = min(base + math.floor(highest + margin), ends[f + 1] - 1)
            for i in range(first, last + 1):
                if near > farthest[layer, i]:
                    continue
                c, s, x, y = fan[i, COS], fan[i, SIN], fan[i, ORIGIN_X], fan[i, ORIGIN_Y]
                beam, worst, posed = beams[i], 0.0, not moves
                for k in range(count):
                    best = ranges[layer, beam, k]
                    up = aperture * rays[k, V]
                    if count > 1:
                        # Rays of the spot that pass beside, over or under the geom.
                        place = i - base + rays[k, LEFT] * per_step
                        rise = rays[k, SLOPE]
                        low, high = height + up + rise * near, height + up + rise * far
                        if (
                            near > best
                            or place < lowest
                            or place > highest
                            or min(low, high) > top
                            or max(low, high) < bottom
                        ):
                            worst = max(worst, best)
                            continue
                    if not posed:
                        slot = int(fan[i, SLOT])
                        pose = _between(
                            _pose(poses, slot, j), _pose(poses, slot + 1, j), fan[i, PART]
                        )
                        posed = True
                    lever = (0.0, aperture * rays[k, U], up)
                    way = (rays[k, FORWARD], rays[k, LEFT], rays[k, UP])
                    origin, vec = _ray(c, s, x, y, height, lever, way)
                    distance, cos = meet(kind, size, pose, origin, vec, best)
                    # Equal distances go to the lower id, as in MuJoCo's loop over ascending ids.
                    if 0.0 <= distance < best or (distance == best and j < hits[layer, beam, k]):
                        ranges[layer, beam, k] = best = distance
                        hits[layer, beam, k] = j
                        cosines[layer, beam, k] = cos
                    worst = max(worst, best)
                farthest[layer, i] = worst


@njit
def sweep(  # noqa: PLR0913 (kernel)
    table: Float,
    movable: Int,
    poses: Float,
    lasers: Float,
    slots: int,
    bounds: Float,
    plan: Float,
    ends: Int,
    beams: Int,
    rays: Float,
    optics: Vec3,
    work: tuple[Float, Float, Float, Float, Int, Int],
    out: tuple[Float, Int, Float],
) -> None:
    """Cast the beams of one scan.

    table    (n, 8) the candidate geoms; rows ``movable`` of them can move
    poses    (slots, n, 12) of them at the ``slots`` ends of physics steps; lasers (slots, 3)
    bounds   (n, 6), as ``enclose`` left them for what cannot move
    plan     (m, 5) of the beams, fan k in the rows ``ends[k]`` to ``ends[k + 1]``
    beams    (m,) the rows of the outputs they go to
    rays     (k, 6) of a beam
    optics   height of the scan plane m, aperture radius m, half divergence rad
    work     room for the fans (m, 7), their frames (fans, 4), reach of the beams (layers, m),
             windows (3 n, 4), their owners (3 n,) and order (3 n,)
    out      (layers, m, k) each: ranges m, inf for a miss; index of the candidate, -1; |cos| of
             the incidence, NaN
    """
    fan, frames, farthest, windows, owners, order = work
    ranges, hits, cosines = out
    ranges[:] = math.inf
    hits[:] = -1
    cosines[:] = math.nan
    farthest[:] = math.inf
    enclose(table, movable, poses, slots, bounds)
    lay_fans(plan, lasers, ends, fan, frames)
    wedge = ray_wedge(frames, optics[2])
    found = find_windows(table, poses, bounds, fan, wedge, optics, windows, owners)
    nearest_first(windows, found, order)
    _cast_windows(table, poses, bounds, ends, beams, rays, optics, work, found, out)


@njit
def cast_one(  # noqa: PLR0913 (kernel)
    table: Float, poses: Float, bounds: Float, fan: Float, i: int, origin: Vec3, vec: Vec3
) -> tuple[float, int, float]:
    """(distance, candidate, |cos|) of one ray at the time of beam i, (inf, -1, NaN) for a miss.

    Panes are not seen.
    """
    best, hit, cosine = math.inf, -1, math.nan
    slot, part = int(fan[i, SLOT]), fan[i, PART]
    for j in range(table.shape[0]):
        dx, dy = bounds[j, DISC_X] - origin[0], bounds[j, DISC_Y] - origin[1]
        reach = bounds[j, DISC_RADIUS] + SLACK
        along, aside = dx * vec[0] + dy * vec[1], dy * vec[0] - dx * vec[1]
        if abs(aside) > reach or along < -reach or along - reach > best or table[j, LAYER] > 0.0:
            continue
        pose = _pose(poses, slot, j)
        if bounds[j, MOVED] != 0.0:
            pose = _between(pose, _pose(poses, slot + 1, j), part)
        size = (table[j, SIZE_X], table[j, SIZE_Y], table[j, SIZE_Z])
        x, cos = meet(int(table[j, KIND]), size, pose, origin, vec, best)
        if 0.0 <= x < best:
            best, hit, cosine = x, j, cos
    return best, hit, cosine


@njit
def reflect(  # noqa: PLR0913 (kernel)
    table: Float,
    polished: NDArray[np.bool_],
    poses: Float,
    bounds: Float,
    fan: Float,
    beams: Int,
    height: float,
    hits: tuple[Float, Int, Float],
    out: tuple[Float, Int, Float],
) -> None:
    """Follow the middle rays of a scan that meet a pane or a polished face to what they show.

    polished  (n,) True for candidates of the room's layer that mirror; only boxes do, by a face
    hits      as ``sweep`` left them
    out       (all beams,) each: length of the way there m, inf for none; candidate; |cos| there
    """
    ranges, found, _ = hits
    for i in range(beams.size):
        beam = beams[i]
        out[0][beam], out[1][beam], out[2][beam] = math.inf, -1, math.nan
        layer = ranges.shape[0] - 1
        if ranges[layer, beam, 0] >= ranges[0, beam, 0]:
            layer = 0
        j, x = found[layer, beam, 0], ranges[layer, beam, 0]
        if j < 0 or int(table[j, KIND]) != BOX or (layer == 0 and not polished[j]):
            continue
        slot = int(fan[i, SLOT])
        pose = _between(_pose(poses, slot, j), _pose(poses, slot + 1, j), fan[i, PART])
        size = (table[j, SIZE_X], table[j, SIZE_Y], table[j, SIZE_Z])
        vec = (fan[i, COS], fan[i, SIN], 0.0)
        at = (fan[i, ORIGIN_X] + x * vec[0], fan[i, ORIGIN_Y] + x * vec[1], height)
        n = face_normal(size, pose, at)
        along = 2.0 * (vec[0] * n[0] + vec[1] * n[1] + vec[2] * n[2])
        vec = (vec[0] - along * n[0], vec[1] - along * n[1], vec[2] - along * n[2])
        at = (at[0] + AWAY * vec[0], at[1] + AWAY * vec[1], at[2] + AWAY * vec[2])
        further, out[1][beam], out[2][beam] = cast_one(table, poses, bounds, fan, i, at, vec)
        out[0][beam] = x + AWAY + further


@njit
def arccos(cosines: Float) -> Float:
    """Elementwise, by libm: NumPy's own changes its last bit with the CPU."""
    out = np.empty(cosines.size)
    for i in range(cosines.size):
        out[i] = math.acos(cosines[i])
    return out
