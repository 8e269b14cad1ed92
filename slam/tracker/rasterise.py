# SPDX-License-Identifier: Apache-2.0
"""Writes impressions onto the map: the inspiration I that observations give to cells.

I of a cell is the largest of the Gaussians around the observed points there; each has the
analytic peak 1 (not the largest sampled value), as everything else makes structure creep towards
cell centres (pixel locking).
"""

import functools
import math
from typing import Any

import numpy as np

from slam import se2
from slam._jit import inlined, inner, uncounted
from slam.arrays import Bools, Bytes, Float, Float32
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import rotate
from slam.frontend.surfaces import turned_face
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import MASK, SHIFT, SIDE, TOUCHED_COUNT, Cells, Look, born
from slam.tracker.map_config import MapConfig

FINE = MapConfig().bell_steps


@functools.cache
def _bell(ends: float) -> Float32:
    """I by the squared Mahalanobis distance, ``FINE`` entries for each unit of it."""
    entries = range(int(ends * FINE))
    return np.array([math.exp(-0.5 * k / FINE) for k in entries] + [0.0], np.float32)


@inner
def _touch(cells: Cells, column: int, row: int) -> int:
    """Open a place for the impressions of a block, which is born if need be. -1: no room is left.

    The column and row are those of the directory.
    """
    scratch = cells.counts[TOUCHED_COUNT]
    if scratch == len(cells.touched):
        return -1
    slot, new = int(cells.directory[row, column]), 0
    if slot < 0:
        slot, new = born(cells, row, column), 1
        if slot < 0:
            return -1
    cells.counts[TOUCHED_COUNT] += 1
    cells.touched[scratch, 0] = slot
    cells.touched[scratch, 1] = column + cells.corner[0]
    cells.touched[scratch, 2] = row + cells.corner[1]
    cells.touched[scratch, 3] = new
    cells.scratch_of[slot] = scratch
    for j in range(SIDE):
        for i in range(SIDE):
            cells.impression[scratch, j, i] = 0.0
            cells.faced[scratch, j, i] = 0
    return int(scratch)


@inlined
def _rasterise_point(  # noqa: PLR0913 (kernel)
    cells: Cells,
    u: float,
    v: float,
    cov: tuple[float, float, float],
    faced: int,
    ends: float,
    bell: Float32,
) -> bool:
    """Gaussian with covariance ``cov`` (xx, xy, yy) about (u, v), in cells."""
    a, b, d = cov
    det = a * d - b * b
    wide = math.sqrt(ends * max(a, d))
    i0, i1 = math.ceil(u - wide), math.floor(u + wide)
    j0, j1 = math.ceil(v - wide), math.floor(v + wide)
    pa, pb, pd = d / det, -2.0 * b / det, a / det
    cx, cy = cells.corner[0], cells.corner[1]
    for row in range(j0 >> SHIFT, (j1 >> SHIFT) + 1):
        for column in range(i0 >> SHIFT, (i1 >> SHIFT) + 1):  # block by block: looked up once
            first, last = max(i0, column * SIDE), min(i1, column * SIDE + MASK)
            low, high = max(j0, row * SIDE), min(j1, row * SIDE + MASK)
            du, dv = min(max(u, first), last) - u, min(max(v, low), high) - v
            if b == 0.0 and pa * du * du + pd * dv * dv >= ends:
                continue
            # As below; in a function for both, rasterising takes half as long again.
            slot = cells.directory[row - cy, column - cx]
            scratch = cells.scratch_of[slot] if slot >= 0 else -1
            if scratch < 0:
                scratch = _touch(cells, column - cx, row - cy)
                if scratch < 0:
                    return False
            for j in range(low, high + 1):
                dv = j - v
                whole, part = pd * dv * dv, pb * dv
                for i in range(first, last + 1):
                    du = i - u
                    m = min(whole + du * (part + pa * du), ends)
                    value = bell[int(m * FINE)]
                    # Written in any case: a branch here costs more.
                    before = cells.impression[scratch, j & MASK, i & MASK]
                    faced_before = cells.faced[scratch, j & MASK, i & MASK]
                    more = value > before
                    cells.impression[scratch, j & MASK, i & MASK] = value if more else before
                    cells.faced[scratch, j & MASK, i & MASK] = faced if more else faced_before
    return True


@inner
def _rasterise_stretch(  # noqa: PLR0913 (kernel)
    cells: Cells,
    u: float,
    v: float,
    du: float,
    dv: float,
    variance: float,
    faced: int,
    ends: float,
    bell: Float32,
) -> bool:
    """Gaussian ridge about the stretch from (u, v) to (u + du, v + dv), in cells."""
    square = du * du + dv * dv
    flat = abs(du) >= abs(dv)
    slope = dv / du if flat else du / dv
    across = math.sqrt(ends * variance * (1.0 + slope * slope))
    scale = 1.0 / (square * variance)
    cx, cy = cells.corner[0], cells.corner[1]
    start, end = (min(u, u + du), max(u, u + du)) if flat else (min(v, v + dv), max(v, v + dv))
    for along in range(math.ceil(start), math.floor(end) + 1):
        centre = v + slope * (along - u) if flat else u + slope * (along - v)
        column, row, scratch = 0, 0, -1
        for aside in range(math.ceil(centre - across), math.floor(centre + across) + 1):
            i, j = (along, aside) if flat else (aside, along)
            cross = (i - u) * dv - (j - v) * du
            m = cross * cross * scale
            if m >= ends:
                continue
            if scratch < 0 or i >> SHIFT != column or j >> SHIFT != row:
                column, row = i >> SHIFT, j >> SHIFT
                slot = cells.directory[row - cy, column - cx]
                scratch = cells.scratch_of[slot] if slot >= 0 else -1
                if scratch < 0:
                    scratch = _touch(cells, column - cx, row - cy)
                    if scratch < 0:
                        return False
            value = bell[int(m * FINE)]
            if value > cells.impression[scratch, j & MASK, i & MASK]:
                cells.impression[scratch, j & MASK, i & MASK] = value
                cells.faced[scratch, j & MASK, i & MASK] = faced
    return True


@inner
def _moved(
    points_robot: Float, covariances: Float, pose: Float, cell: float, points: Float, box: Float
) -> None:
    """``points`` in the map frame, and the ``box`` (xmin, ymin, xmax, ymax) of their Gaussians."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    largest = 0.0
    box[0] = box[1] = math.inf
    box[2] = box[3] = -math.inf
    for k in range(len(points)):
        x = c * points_robot[k, 0] - s * points_robot[k, 1] + pose[0]
        y = s * points_robot[k, 0] + c * points_robot[k, 1] + pose[1]
        points[k, 0], points[k, 1] = x, y
        box[0], box[1] = min(box[0], x), min(box[1], y)
        box[2], box[3] = max(box[2], x), max(box[3], y)
        largest = max(largest, covariances[k, 0], covariances[k, 2])
    edge = max(3.0 * cell, 4.0 * math.sqrt(largest)) + cell
    box[0], box[1] = box[0] - edge, box[1] - edge
    box[2], box[3] = box[2] + edge, box[3] + edge


@inner
def _is_covered(cells: Cells, box: Float, size: float) -> bool:
    """Whether the directory has the blocks, ``size`` m wide, of the box and those around it."""
    rows, columns = cells.directory.shape
    cx, cy = cells.corner[0], cells.corner[1]
    inside = math.floor(box[0] / size) - 1 >= cx and math.floor(box[1] / size) - 1 >= cy
    inside &= math.floor(box[2] / size) + 2 <= cx + columns
    return bool(inside and math.floor(box[3] / size) + 2 <= cy + rows)


@uncounted
def _stamp(  # noqa: PLR0913 (kernel)
    arrays: tuple[Any, ...],
    points_robot: Float,
    covariances: Float,
    joined: Bools,
    facings: Bytes,
    pose: Float,
    cell: float,
    ends: float,
    bell: Float32,
    start: int,
    points: Float,
    box: Float,
) -> int:
    """Raise I around the points, seen from ``pose``, from ``start`` on; ``arrays`` of ``Cells``.

    Returns the index of the point at which room ran out, n where it did not, and -1 where the
    directory does not cover the ``box`` (4,). ``points`` (n, 2) and that box are filled first.
    """
    cells = Cells(*arrays)
    if start == 0:
        _moved(points_robot, covariances, pose, cell, points, box)
        if not _is_covered(cells, box, SIDE * cell):
            return -1
    theta = pose[2]
    c, s = math.cos(theta), math.sin(theta)
    scale = 1.0 / (cell * cell)
    for k in range(start, len(points)):
        xx, xy, yy = covariances[k, 0], covariances[k, 1], covariances[k, 2]
        a, b, d = rotate(c, s, xx, xy, yy)
        a, b, d = a * scale, b * scale, d * scale
        u, v = points[k, 0] / cell - 0.5, points[k, 1] / cell - 0.5
        faced = turned_face(facings[k], theta)
        if not _rasterise_point(cells, u, v, (a, b, d), faced, ends, bell):
            return k
        if joined[k]:
            du, dv = points[k + 1, 0] / cell - 0.5 - u, points[k + 1, 1] / cell - 0.5 - v
            if du * du + dv * dv > 1.0 and not _rasterise_stretch(
                cells, u, v, du, dv, a, faced, ends, bell
            ):
                return k
    return len(points)


def rasterise(cell_map: CellMap, observations: Observations, T_map_robot: Float) -> None:
    """Write the impressions of ``observations`` seen from ``T_map_robot`` onto the map."""
    n = len(observations.points_robot)
    points_map, box = np.empty((n, 2)), np.empty(4)
    done, ends = 0, cell_map.config.map.bell_ends
    while done < n:
        done = _stamp(
            tuple(cell_map.cells),
            observations.points_robot,
            observations.covariances,
            observations.joined,
            observations.facings,
            T_map_robot,
            cell_map.cell,
            ends,
            _bell(ends),
            done,
            points_map,
            box,
        )
        if done < 0:
            cell_map.cover(*box.tolist())
            done = 0
        elif done < n:
            cell_map.grow()


def seen_at(cell_map: CellMap, observations: Observations, T_map_robot: Float) -> Look:
    """What a scan says of the map from a pose; nothing is written."""
    rasterise(cell_map, observations, T_map_robot)
    T_map_laser = se2.compose(T_map_robot, observations.T_robot_laser)
    look = cell_map.integrate(observations.view, T_map_laser, 0.0, write=False)
    cell_map.release()
    return look
