# SPDX-License-Identifier: Apache-2.0
"""Walls moved to where the returns of a log lie: each face of a box by the median of its beams.

A wall of a plan drawn from cells lies within a cell or two of the real one; the scans know it to a
centimetre. A face moves along its normal and, with many beams, its wall turns a little.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit

Float = NDArray[np.float64]
ROUNDS = 4
NEAR_M = 0.25  # a return farther from a face is of something else
LEAST = 6  # beams on a face, to move it
MOST_M = 0.15  # that a face moves in one round
THIN_M = 0.02  # thickness that is left of a wall, at least
OBLIQUE = 0.17  # cosine of incidence; more oblique beams place a face badly
TURN_LEAST, TURN_SPAN_M, TURN_MOST = 40, 1.0, 0.03  # beams, m along a face, rad, to turn a wall


def moved_to(boxes: Float, lasers: Float, ranges: Float, angles: Float) -> Float:
    """(n, 5) boxes, cx, cy, half sizes m and yaw rad, as the scans see them.

    lasers  (k, 3) poses of the scanner;  ranges  (k, b) m, NaN for none;  angles  (b,) rad
    """
    out = np.array(boxes, dtype=np.float64)
    for _ in range(ROUNDS if len(out) else 0):
        rows, faces, inward, along = _residuals(out, lasers, ranges, angles)
        order = np.argsort(rows * 4 + faces, kind="stable")
        keys = (rows * 4 + faces)[order]
        for part in np.split(order, np.flatnonzero(keys[1:] != keys[:-1]) + 1):
            if len(part) >= LEAST:
                _move(out[rows[part[0]]], int(faces[part[0]]), inward[part], along[part])
    return np.round(out, 4)


def _move(box: Float, face: int, inward: Float, along: Float) -> None:
    """Move one face of a box inward by the median, and turn the box by the slope of the rest."""
    axis, sign = face // 2, 1.0 if face % 2 else -1.0
    by = float(np.clip(np.median(inward), -MOST_M, MOST_M))
    half = box[2 + axis]
    by = min(by, 2.0 * half - THIN_M)
    box[2 + axis] = half - 0.5 * by
    c, s = math.cos(box[4]), math.sin(box[4])
    normal = (c, s) if axis == 0 else (-s, c)
    box[0] -= 0.5 * sign * by * normal[0]
    box[1] -= 0.5 * sign * by * normal[1]
    if len(inward) < TURN_LEAST or np.ptp(along) < TURN_SPAN_M or box[3 - axis] < half:
        return
    middle = along - along.mean()
    slope = float((middle * (inward - inward.mean())).sum() / (middle * middle).sum())
    turn = -sign * slope if axis == 1 else sign * slope
    box[4] += 0.5 * min(max(turn, -TURN_MOST), TURN_MOST)


@njit
def _entered(box: Float, x: float, y: float, heading: float) -> tuple[float, int]:
    """m to where a ray enters a box, and the face, -u, +u, -v, +v; (-1, 0) where it does not."""
    c, s = math.cos(box[4]), math.sin(box[4])
    ox, oy = x - box[0], y - box[1]
    dx, dy = math.cos(heading), math.sin(heading)
    at = (c * ox + s * oy, -s * ox + c * oy)
    way = (c * dx + s * dy, -s * dx + c * dy)
    near, far, face = -1e9, 1e9, 0
    for axis in range(2):
        half = box[2 + axis]
        if abs(way[axis]) < 1e-9:
            if abs(at[axis]) > half:
                return -1.0, 0
            continue
        a, b = (-half - at[axis]) / way[axis], (half - at[axis]) / way[axis]
        if min(a, b) > near:
            near, face = min(a, b), 2 * axis + (0 if way[axis] > 0.0 else 1)
        far = min(far, max(a, b))
    return (near, face) if 0.0 < near < far else (-1.0, 0)


@njit
def _hit(
    boxes: Float, reach: Float, x: float, y: float, heading: float, most: float
) -> tuple[int, int, float]:
    """The first box that a ray enters within ``most`` m, the face and m to it; -1 for none."""
    found, side, best = -1, 0, most
    dx, dy = math.cos(heading), math.sin(heading)
    for j in range(boxes.shape[0]):
        ox, oy = x - boxes[j, 0], y - boxes[j, 1]
        ahead = -(ox * dx + oy * dy)
        passes = abs(ox * dy - oy * dx) > reach[j]
        if passes or ahead < -reach[j] or ahead - reach[j] > best:
            continue
        near, face = _entered(boxes[j], x, y, heading)
        if 0.0 < near < best:
            found, side, best = j, face, near
    return found, side, best


@njit
def _residuals(
    boxes: Float, lasers: Float, ranges: Float, angles: Float
) -> tuple[NDArray[np.int64], NDArray[np.int64], Float, Float]:
    """Of each beam that ends near a face: box, face (-u, +u, -v, +v), m inward, m along it."""
    n, count = ranges.size, 0
    rows, faces = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    inward, along = np.empty(n), np.empty(n)
    reach = np.sqrt(boxes[:, 2] ** 2 + boxes[:, 3] ** 2)
    for k in range(lasers.shape[0]):
        x, y, heading = lasers[k]
        for b in range(ranges.shape[1]):
            r, way = ranges[k, b], heading + angles[b]
            if math.isnan(r):
                continue
            found, side, best = _hit(boxes, reach, x, y, way, r + NEAR_M / OBLIQUE)
            if found < 0:
                continue
            turned = way - boxes[found, 4]
            square = abs(math.cos(turned)) if side < 2 else abs(math.sin(turned))
            deeper = (r - best) * square
            if square < OBLIQUE or abs(deeper) > NEAR_M:
                continue
            px, py = (
                x + r * math.cos(way) - boxes[found, 0],
                y + r * math.sin(way) - boxes[found, 1],
            )
            c, s = math.cos(boxes[found, 4]), math.sin(boxes[found, 4])
            rows[count], faces[count], inward[count] = found, side, deeper
            along[count] = -s * px + c * py if side < 2 else c * px + s * py
            count += 1
    return rows[:count], faces[:count], inward[:count], along[:count]
