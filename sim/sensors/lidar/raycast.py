# SPDX-License-Identifier: Apache-2.0
"""Casts the beams of a sweep on a model's geoms, bit for bit as ``mj_multiRay`` would.

Each beam meets each moving geom at the beam's own time: poses are linear between physics steps. A
beam is k rays over the disc of its spot; an ideal beam is the one ray in the middle.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar import columns as col
from sim.sensors.lidar.fan import SLACK, Int, Vec3, lay_fans, ray_wedge, row_of
from sim.sensors.lidar.ray_shapes import Pose, face_normal, meet
from sim.sensors.lidar.windows import enclose, find_windows, nearest_first
from slam._jit import inner, uncounted
from slam.frames import Float

Ray = tuple[Vec3, Vec3]
AWAY = 1e-6  # m from a mirror at which what it shows begins, so that it does not show itself


@inner
def _pose(poses: Float, slot: int, j: int) -> Pose:
    """Pose of geom j in a slot."""
    return (
        poses[slot, j, 0], poses[slot, j, 1], poses[slot, j, 2], poses[slot, j, 3],
        poses[slot, j, 4], poses[slot, j, 5], poses[slot, j, 6], poses[slot, j, 7],
        poses[slot, j, 8], poses[slot, j, 9], poses[slot, j, 10], poses[slot, j, 11],
    )  # fmt: skip


@inner
def _size(table: Float, j: int) -> Vec3:
    return table[j, col.SIZE_X], table[j, col.SIZE_Y], table[j, col.SIZE_Z]


@inner
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


@inner
def _pose_at(poses: Float, bounds: Float, j: int, slot: int, part: float) -> Pose:
    """Pose of geom j a ``part`` of the way from one slot to the next."""
    if bounds[j, col.MOVED] == 0.0:
        return _pose(poses, 0, j)
    return _between(_pose(poses, slot, j), _pose(poses, slot + 1, j), part)


@inner
def _ray(c: float, s: float, x: float, y: float, z: float, lever: Vec3, way: Vec3) -> Ray:  # noqa: PLR0913 (kernel)
    """Origin and unit direction in the world of a ray of the beam that leaves (x, y, z).

    c, s   direction of the beam; ``lever`` (_, left m, up m) and ``way`` (forward, left, up) of
           the ray in the beam's frame
    """
    origin = (x - s * lever[1], y + c * lever[1], z + lever[2])
    return origin, (c * way[0] - s * way[1], s * way[0] + c * way[1], way[2])


@inner
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
        j, near, far = owners[row], windows[row, col.NEAR], windows[row, col.FAR]
        kind, layer = int(table[j, col.KIND]), int(table[j, col.LAYER])
        size = _size(table, j)
        moves, pose = bounds[j, col.MOVED] != 0.0, _pose(poses, 0, j)
        bottom = bounds[j, col.DISC_Z] - bounds[j, col.DISC_HALF] - SLACK
        top = bounds[j, col.DISC_Z] + bounds[j, col.DISC_HALF] + SLACK
        for f in range(frames.shape[0]):
            per_step, base = frames[f, col.PER_RADIAN], ends[f]
            start, uneven = frames[f, col.START], frames[f, col.UNEVEN]
            lowest = (windows[row, col.LOW] - uneven - start) * per_step
            highest = (windows[row, col.HIGH] + uneven - start) * per_step
            margin, end = slope * per_step, ends[f + 1] - base
            first = base + row_of(np.ceil(lowest - margin), end)
            last = base + row_of(np.floor(highest + margin) + 1.0, end)
            for i in range(first, last):
                if near > farthest[layer, i]:
                    continue
                c, s = fan[i, col.COS], fan[i, col.SIN]
                x, y = fan[i, col.ORIGIN_X], fan[i, col.ORIGIN_Y]
                beam, worst, posed = beams[i], 0.0, not moves
                for k in range(count):
                    best = ranges[layer, beam, k]
                    up = aperture * rays[k, col.V]
                    if count > 1:
                        # Rays of the spot that pass beside, over or under the geom.
                        place = i - base + rays[k, col.LEFT] * per_step
                        rise = rays[k, col.RISE]
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
                        slot = int(fan[i, col.SLOT])
                        pose = _between(
                            _pose(poses, slot, j), _pose(poses, slot + 1, j), fan[i, col.PART]
                        )
                        posed = True
                    lever = (0.0, aperture * rays[k, col.U], up)
                    way = (rays[k, col.FORWARD], rays[k, col.LEFT], rays[k, col.UP])
                    origin, vec = _ray(c, s, x, y, height, lever, way)
                    distance, cos = meet(kind, size, pose, origin, vec, best)
                    # Equal distances go to the lower id, as in MuJoCo's loop over ascending ids.
                    if 0.0 <= distance < best or (distance == best and j < hits[layer, beam, k]):
                        ranges[layer, beam, k] = best = distance
                        hits[layer, beam, k] = j
                        cosines[layer, beam, k] = cos
                    worst = max(worst, best)
                farthest[layer, i] = worst


@uncounted
def sweep(  # noqa: PLR0913 (kernel)
    table: Float,
    runs: Int,
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

    table    the candidate geoms; ``runs`` of them can move
    poses    of them at the ``slots`` ends of physics steps, and of the laser
    bounds   as ``enclose`` left them for what cannot move
    plan     of the beams, fan k in the rows ``ends[k]`` to ``ends[k + 1]``
    beams    (m,) the rows of the outputs they go to
    rays     of a beam
    optics   height of the scan plane m, aperture radius m, half divergence rad
    work     room for the fans, their frames, reach of the beams (layers, m), windows, their owners
             (3 n,) and order (3 n + BUCKETS + 1,)
    out      (layers, m, k) each: ranges m, inf for a miss; index of the candidate, -1; |cos| of
             the incidence, NaN
    """
    fan, frames, farthest, windows, owners, order = work
    ranges, hits, cosines = out
    ranges[:] = math.inf
    hits[:] = -1
    cosines[:] = math.nan
    farthest[:] = math.inf
    enclose(table, runs, poses, slots, bounds)
    lay_fans(plan, lasers, ends, fan, frames)
    wedge = ray_wedge(frames, optics[2])
    found = find_windows(table, poses, bounds, fan, wedge, optics, windows, owners)
    nearest_first(windows, found, order)
    _cast_windows(table, poses, bounds, ends, beams, rays, optics, work, found, out)


@inner
def cast_one(  # noqa: PLR0913 (kernel)
    table: Float, poses: Float, bounds: Float, fan: Float, i: int, origin: Vec3, vec: Vec3
) -> tuple[float, int, float]:
    """(distance, candidate, |cos|) of one ray at the time of beam i, (inf, -1, NaN) for a miss.

    Panes are not seen.
    """
    best, hit, cosine = math.inf, -1, math.nan
    slot, part = int(fan[i, col.SLOT]), fan[i, col.PART]
    for j in range(table.shape[0]):
        dx, dy = bounds[j, col.DISC_X] - origin[0], bounds[j, col.DISC_Y] - origin[1]
        reach = bounds[j, col.DISC_RADIUS] + SLACK
        along, aside = dx * vec[0] + dy * vec[1], dy * vec[0] - dx * vec[1]
        if abs(aside) > reach or along < -reach or along - reach > best:
            continue
        if table[j, col.LAYER] > 0.0:
            continue
        pose = _pose_at(poses, bounds, j, slot, part)
        size = _size(table, j)
        x, cos = meet(int(table[j, col.KIND]), size, pose, origin, vec, best)
        if 0.0 <= x < best:
            best, hit, cosine = x, j, cos
    return best, hit, cosine


@uncounted
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
    lengths, shown, cosines = out
    for i in range(beams.size):
        beam = beams[i]
        lengths[beam], shown[beam], cosines[beam] = math.inf, -1, math.nan
        layer = ranges.shape[0] - 1
        if ranges[layer, beam, 0] >= ranges[0, beam, 0]:
            layer = 0
        j, x = found[layer, beam, 0], ranges[layer, beam, 0]
        if j < 0 or int(table[j, col.KIND]) != col.BOX or (layer == 0 and not polished[j]):
            continue
        pose = _pose_at(poses, bounds, j, int(fan[i, col.SLOT]), fan[i, col.PART])
        size = _size(table, j)
        vec = (fan[i, col.COS], fan[i, col.SIN], 0.0)
        at = (fan[i, col.ORIGIN_X] + x * vec[0], fan[i, col.ORIGIN_Y] + x * vec[1], height)
        n = face_normal(size, pose, at)
        along = 2.0 * (vec[0] * n[0] + vec[1] * n[1] + vec[2] * n[2])
        vec = (vec[0] - along * n[0], vec[1] - along * n[1], vec[2] - along * n[2])
        at = (at[0] + AWAY * vec[0], at[1] + AWAY * vec[1], at[2] + AWAY * vec[2])
        further, shown[beam], cosines[beam] = cast_one(table, poses, bounds, fan, i, at, vec)
        lengths[beam] = x + AWAY + further
