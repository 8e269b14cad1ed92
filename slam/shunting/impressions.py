# SPDX-License-Identifier: Apache-2.0
"""Observations as Gaussians, and the inspiration I they give to neurons.

Beams and point features enter through one type. I of a neuron is the largest of the Gaussians
around the observed points there; each has the analytic peak 1 (not the largest sampled value), as
everything else makes structure creep towards neuron centres (pixel locking).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam._jit import inner, njit
from slam.frames import Features, Float, Scan
from slam.seen import FREE_WITHOUT_RETURN_M
from slam.shunting.cells import FREE_COUNT, MASK, SHIFT, SIDE, TOUCHED_COUNT, Cells
from slam.shunting.config import ShuntingConfig
from slam.shunting.network import Network
from slam.shunting.surfaces import face, join, turned_face, unveiled
from slam.shunting.visibility import View, view_of_beams, view_of_features

SIGMA_CELLS = 0.8  # least Gaussian the lattice carries without ripple: 2 exp(-pi^2 s^2) = 0.4 %
SENSOR_SIGMA_M = 0.010  # LMS-221 statistical error, 1 sigma
FAINT = 12.0  # squared Mahalanobis distance of I = 0.0025, where an impression ends
FINE = 512  # entries of the table below for each unit of it: 0.1 % of I
BELL = np.array([math.exp(-0.5 * k / FINE) for k in range(int(FAINT) * FINE)] + [0.0], np.float32)
NEAR_JOIN_CELLS = 3.0
SPACING_M, LEAST_WEIGHT = 0.1, 0.3  # beams closer than this share one observation's weight


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """What one frame shows, in the robot frame at the frame's stamp.

    points_robot  (n, 2) m
    covariances   (n, 3) m^2: xx, xy, yy; at least (0.8 cell)^2 along every axis
    weights       (n,) share of a full observation
    tangents      (n, 2) unit direction of the surface where it goes on both ways, else 0
    joined        (n,) bool: the surface goes on to the next point. Without it the dots of a wall
                  seen at a grazing angle match themselves where the robot stood before
    facings       (n,) uint8: the way the surface faces, see ``surfaces.face``; 0: unknown
    view          what is seen to be empty
    T_robot_laser (3,) origin of ``view``
    """

    points_robot: Float
    covariances: Float
    weights: Float
    tangents: Float
    joined: NDArray[np.bool_]
    facings: NDArray[np.uint8]
    view: View
    T_robot_laser: Float


@njit
def _deskew(
    ranges: NDArray[np.float32],
    angles: NDArray[np.float64],
    offsets: NDArray[np.float64],
    T_robot_laser: NDArray[np.float64],
    twist: NDArray[np.float64],
    limits: tuple[float, float, float, float],
    points: NDArray[np.float64],
    beams: NDArray[np.int64],
    bearings: NDArray[np.float64],
    free: NDArray[np.float64],
) -> int:
    """End points in the robot frame of the stamp; bearings and free ranges about that laser.

    ``limits``: range_min, range_max, range of use, free range without a return. Returns how many
    points were written.
    """
    low, high, use, silent = limits
    lx, ly = T_robot_laser[0], T_robot_laser[1]
    lc, ls = math.cos(T_robot_laser[2]), math.sin(T_robot_laser[2])
    count = 0
    for k in range(len(ranges)):
        r = float(ranges[k])
        hit = low <= r <= high
        free[k] = 0.0
        bearings[k] = angles[k]
        if math.isnan(r) or r < low:
            continue
        reach = min(r, use) if hit else silent
        px = lx + reach * math.cos(angles[k] + T_robot_laser[2])
        py = ly + reach * math.sin(angles[k] + T_robot_laser[2])
        turn = twist[2] * offsets[k]
        if offsets[k] != 0.0:
            # Motion since the stamp: mid-point rule, exact to third order in the turned angle.
            c, s = math.cos(0.5 * turn), math.sin(0.5 * turn)
            mx = (c * twist[0] - s * twist[1]) * offsets[k]
            my = (s * twist[0] + c * twist[1]) * offsets[k]
            c, s = math.cos(turn), math.sin(turn)
            px, py = c * px - s * py + mx, s * px + c * py + my
        dx, dy = px - lx, py - ly
        bearings[k] = math.atan2(lc * dy - ls * dx, lc * dx + ls * dy)
        free[k] = math.sqrt(dx * dx + dy * dy)
        if hit and r <= use:
            points[count, 0] = px
            points[count, 1] = py
            beams[count] = k
            count += 1
    return count


def from_scan(scan: Scan, twist: Float, config: ShuntingConfig) -> Observations:
    """Beams, moved to where the robot was at the scan's stamp.

    ``twist`` is the body velocity (vx, vy, omega) over the sweep.
    """
    spec = scan.spec
    n = spec.n_beams
    points, bearings, free = np.empty((n, 2)), np.empty(n), np.empty(n)
    beams = np.empty(n, np.int64)
    use = min(config.range_m, spec.range_max)
    count = _deskew(
        scan.ranges,
        spec.angles,
        spec.beam_time_offsets,
        spec.T_robot_laser,
        twist,
        (spec.range_min, spec.range_max, use, min(use, FREE_WITHOUT_RETURN_M)),
        points,
        beams,
        bearings,
        free,
    )
    points, beams = points[:count], beams[:count]
    if spec.sweep_duration > 0.0 and (bearings[1:] < bearings[:-1]).any():
        # An interlaced scanner that turns: neighbours are those by bearing, not by number.
        rank = np.empty(n, np.int64)
        rank[np.argsort(bearings, kind="stable")] = np.arange(n)
        beams = rank[beams]
        in_order = np.argsort(beams)
        points, beams = points.take(in_order, axis=0), beams[in_order]
    onward, tangents = np.zeros(count, np.bool_), np.zeros((count, 2))
    near = NEAR_JOIN_CELLS * config.cell_m
    join(points, beams, spec.T_robot_laser, near, onward, tangents)
    clear = np.zeros(count, np.bool_)
    if unveiled(points, beams, spec.T_robot_laser, onward, clear) < count:
        kept = np.flatnonzero(clear)  # a mask of rows takes ten times as long
        points, onward = points.take(kept, axis=0), onward.take(kept)
        tangents = tangents.take(kept, axis=0)
    facings = np.zeros(len(points), np.uint8)
    face(points, spec.T_robot_laser, onward, facings)
    variance = max(SIGMA_CELLS * config.cell_m, SENSOR_SIGMA_M) ** 2
    covariances = np.zeros((len(points), 3))
    covariances[:, 0] = covariances[:, 2] = variance
    x, y = points[:, 0], points[:, 1]
    shares = np.sqrt(x * x + y * y) * spec.angle_increment / SPACING_M
    weights = np.minimum(np.maximum(shares, LEAST_WEIGHT), 1.0)
    view = view_of_beams(bearings, free, spec.angle_increment, config.cell_m)
    return Observations(
        points_robot=points,
        covariances=covariances,
        weights=weights,
        tangents=tangents,
        joined=onward,
        facings=facings,
        view=view,
        T_robot_laser=spec.T_robot_laser,
    )


def from_features(features: Features, config: ShuntingConfig) -> Observations:
    """Point features within range; their covariance widened to what the lattice can carry."""
    points = features.points_robot
    near = (points * points).sum(axis=1) <= config.range_m**2
    floor = (SIGMA_CELLS * config.cell_m) ** 2
    given = features.covariances[near]
    covariances = np.stack([given[:, 0, 0] + floor, given[:, 0, 1], given[:, 1, 1] + floor], axis=1)
    return Observations(
        points_robot=points[near].copy(),
        covariances=covariances,
        weights=np.ones(len(covariances)),
        tangents=np.zeros((len(covariances), 2)),
        joined=np.zeros(len(covariances), np.bool_),
        facings=np.zeros(len(covariances), np.uint8),
        view=view_of_features(points[near], config.cell_m),
        T_robot_laser=np.zeros(3),
    )


def joined(first: Observations, second: Observations) -> Observations:
    """Both, seen with the view of the first."""
    return Observations(
        points_robot=np.concatenate([first.points_robot, second.points_robot]),
        covariances=np.concatenate([first.covariances, second.covariances]),
        weights=np.concatenate([first.weights, second.weights]),
        tangents=np.concatenate([first.tangents, second.tangents]),
        joined=np.concatenate([first.joined, second.joined]),
        facings=np.concatenate([first.facings, second.facings]),
        view=first.view,
        T_robot_laser=first.T_robot_laser,
    )


@inner
def _touch(cells: Cells, column: int, row: int) -> int:
    """Open a place for the impressions of a block, which is born if need be. -1: no room is left.

    The column and row are those of the directory.
    """
    scratch = cells.counts[TOUCHED_COUNT]
    if scratch == len(cells.touched):
        return -1
    slot, born = cells.directory[row, column], 0
    if slot < 0:
        if cells.counts[FREE_COUNT] == 0:
            return -1
        cells.counts[FREE_COUNT] -= 1
        slot = cells.free[cells.counts[FREE_COUNT]]
        cells.directory[row, column] = slot
        cells.scratch_of[slot], born = -1, 1
        for j in range(SIDE):
            for i in range(SIDE):
                cells.x[slot, j, i] = cells.y[slot, j, i] = cells.age[slot, j, i] = 0.0
                cells.facing[slot, j, i] = 0
    cells.counts[TOUCHED_COUNT] += 1
    cells.touched[scratch, 0] = slot
    cells.touched[scratch, 1] = column + cells.corner[0]
    cells.touched[scratch, 2] = row + cells.corner[1]
    cells.touched[scratch, 3] = born
    cells.scratch_of[slot] = scratch
    for j in range(SIDE):
        for i in range(SIDE):
            cells.impression[scratch, j, i] = 0.0
            cells.faced[scratch, j, i] = 0
    return int(scratch)


@inner
def _stamp_point(
    cells: Cells, u: float, v: float, a: float, b: float, d: float, faced: int
) -> bool:
    """Gaussian with covariance [[a, b], [b, d]] about (u, v), in cells."""
    det = a * d - b * b
    wide = math.sqrt(FAINT * max(a, d))
    i0, i1 = math.ceil(u - wide), math.floor(u + wide)
    j0, j1 = math.ceil(v - wide), math.floor(v + wide)
    pa, pb, pd = d / det, -2.0 * b / det, a / det
    cx, cy = cells.corner[0], cells.corner[1]
    for row in range(j0 >> SHIFT, (j1 >> SHIFT) + 1):
        for column in range(i0 >> SHIFT, (i1 >> SHIFT) + 1):  # block by block: looked up once
            first, last = max(i0, column * SIDE), min(i1, column * SIDE + MASK)
            low, high = max(j0, row * SIDE), min(j1, row * SIDE + MASK)
            du, dv = min(max(u, first), last) - u, min(max(v, low), high) - v
            if b == 0.0 and pa * du * du + pd * dv * dv >= FAINT:
                continue
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
                    m = min(whole + du * (part + pa * du), FAINT)
                    value = BELL[int(m * FINE)]
                    if value > cells.impression[scratch, j & MASK, i & MASK]:
                        cells.impression[scratch, j & MASK, i & MASK] = value
                        cells.faced[scratch, j & MASK, i & MASK] = faced
    return True


@inner
def _stamp_stretch(
    cells: Cells, u: float, v: float, du: float, dv: float, variance: float, faced: int
) -> bool:
    """Gaussian ridge about the stretch from (u, v) to (u + du, v + dv), in cells."""
    square = du * du + dv * dv
    flat = abs(du) >= abs(dv)
    slope = dv / du if flat else du / dv
    across = math.sqrt(FAINT * variance * (1.0 + slope * slope))
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
            if m >= FAINT:
                continue
            if scratch < 0 or i >> SHIFT != column or j >> SHIFT != row:
                column, row = i >> SHIFT, j >> SHIFT
                slot = cells.directory[row - cy, column - cx]
                scratch = cells.scratch_of[slot] if slot >= 0 else -1
                if scratch < 0:
                    scratch = _touch(cells, column - cx, row - cy)
                    if scratch < 0:
                        return False
            value = BELL[int(m * FINE)]
            if value > cells.impression[scratch, j & MASK, i & MASK]:
                cells.impression[scratch, j & MASK, i & MASK] = value
                cells.faced[scratch, j & MASK, i & MASK] = faced
    return True


@njit
def _stamp(
    cells: Cells,
    points: NDArray[np.float64],
    covariances: NDArray[np.float64],
    joined: NDArray[np.bool_],
    facings: NDArray[np.uint8],
    theta: float,
    cell: float,
    start: int,
) -> int:
    """Raise I around the points (map frame) from ``start`` on; the index where room ran out, or n.

    ``covariances`` are in the robot frame, which is turned by ``theta``.
    """
    c, s = math.cos(theta), math.sin(theta)
    scale = 1.0 / (cell * cell)
    for k in range(start, len(points)):
        xx, xy, yy = covariances[k, 0], covariances[k, 1], covariances[k, 2]
        a = (c * c * xx - 2.0 * c * s * xy + s * s * yy) * scale
        b = (c * s * (xx - yy) + (c * c - s * s) * xy) * scale
        d = (s * s * xx + 2.0 * c * s * xy + c * c * yy) * scale
        u, v = points[k, 0] / cell - 0.5, points[k, 1] / cell - 0.5
        faced = turned_face(facings[k], theta)
        if not _stamp_point(cells, u, v, a, b, d, faced):
            return k
        if joined[k]:
            du, dv = points[k + 1, 0] / cell - 0.5 - u, points[k + 1, 1] / cell - 0.5 - v
            if du * du + dv * dv > 1.0 and not _stamp_stretch(cells, u, v, du, dv, a, faced):
                return k
    return len(points)


def stamp(network: Network, observations: Observations, T_map_robot: Float) -> None:
    """Write the impressions of ``observations`` seen from ``T_map_robot`` onto the network."""
    points_map = se2.transform(T_map_robot, observations.points_robot)
    if len(points_map) == 0:
        return
    largest = float(observations.covariances[:, ::2].max())
    edge = max(3.0 * network.cell, 4.0 * math.sqrt(largest)) + network.cell
    x, y = points_map[:, 0], points_map[:, 1]
    network.cover(
        float(x.min()) - edge, float(y.min()) - edge, float(x.max()) + edge, float(y.max()) + edge
    )
    done = 0
    while done < len(points_map):
        done = _stamp(
            network.cells,
            points_map,
            observations.covariances,
            observations.joined,
            observations.facings,
            float(T_map_robot[2]),
            network.cell,
            done,
        )
        if done < len(points_map):
            network.grow()
