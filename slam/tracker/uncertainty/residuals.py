# SPDX-License-Identifier: Apache-2.0
"""What observed surfaces say about the pose, and by how much they lie off the map together.

A match leaves each point of a surface off the mapped one, by the noise of its beam and by what its
neighbours share with it: an error of the scanner that depends on range or slant, a wrong place of
the wall in the map. Products of the offsets of *two* points of one surface, apart by more than the
map is blurred, are free of the first and measure the second, from the data alone.

Chords between such points also give the direction of a surface better than neighbouring hits do,
whose noise alone would make a smooth corridor look rough.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from slam._jit import inner, uncounted
from slam.arrays import Bools, Float
from slam.frontend.observations import Observations
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import MASK, MOST_OFF, Cells, activity, slot_of
from slam.tracker.uncertainty.covariances import whole

# places in the sums of ``_look``
SHARED, PAIRED, FEIGNED, NEW, WEIGHED, NEW_XX, NEW_XY, NEW_YY = range(8)
OLD_S = 8.0  # s for which a surface was looked at, at which it counts half as old; set by hand


NO_WEIGHTS = np.empty(0)


class Pairing(NamedTuple):
    """How points are paired and compared; lengths in m, the others as in ``ResidualConfig``."""

    apart: float
    longest: float
    faint_overlap: float
    bent: float
    sensor_sigma: float


@inner
def _offset(  # noqa: PLR0913 (kernel)
    cells: Cells,
    short_term: float,
    u: float,
    v: float,
    variance: float,
    faint_overlap: float,
    out: Float,
) -> bool:
    """How far the point (u, v) lies off the mapped surface (``out``); False where there is none.

    All in cells. Twice the mean shift: point and surface are equally blurred.
    """
    p = 1.0 / variance
    wide = 3.0 * math.sqrt(variance)
    i0, i1 = math.ceil(u - wide), math.floor(u + wide)
    falling = math.exp(-p)
    m0 = mu = mv = 0.0
    for j in range(math.ceil(v - wide), math.floor(v + wide) + 1):
        dv, du = j - v, i0 - u
        kernel = math.exp(-0.5 * p * (du * du + dv * dv))
        ratio = math.exp(-p * (du + 0.5))
        slot = slot_of(cells, i0, j)
        for i in range(i0, i1 + 1):
            if i & MASK == 0:  # another block
                slot = slot_of(cells, i, j)
            if slot >= 0:
                value = kernel * activity(cells, short_term, slot, j & MASK, i & MASK)
                m0 += value
                mu += value * du
                mv += value * dv
            kernel *= ratio
            ratio *= falling
            du += 1.0
    if m0 < faint_overlap * math.pi * variance:
        return False
    out[0], out[1] = -2.0 * mu / m0, -2.0 * mv / m0
    return True


@inner
def _age(cells: Cells, u: float, v: float) -> float:
    """For how long, s, the cell nearest to (u, v) was looked at; 0 where none lives."""
    i, j = math.floor(u + 0.5), math.floor(v + 0.5)
    slot = slot_of(cells, i, j)
    return float(cells.age[slot, j & MASK, i & MASK]) if slot >= 0 else 0.0


@inner
def _old(cells: Cells, u: float, v: float) -> tuple[float, float]:
    """Share in [0, 1] in which the surface next to (u, v) is an old one: its trace y, by its age.

    Of the cells within one of the nearest, the most: a point lies off the surface by its noise. And
    by how much, m, the map was off when that cell became long known, inf: unknown.
    """
    most, off = 0.0, 0.0
    for j in range(math.floor(v - 0.5), math.floor(v - 0.5) + 3):
        for i in range(math.floor(u - 0.5), math.floor(u - 0.5) + 3):
            slot = slot_of(cells, i, j)
            if slot >= 0:
                age = float(cells.age[slot, j & MASK, i & MASK]) / OLD_S
                share = age * age / (age * age + 1.0)
                share *= float(cells.y[slot, j & MASK, i & MASK])
                if share > most:
                    most, off = share, float(cells.off[slot, j & MASK, i & MASK])
    return most, 0.01 * off if off < MOST_OFF else math.inf


@inner
def _partner(
    points: Float, joined: Bools, laser: Float,
    first: int, pairing: Pairing,
) -> int:  # fmt: skip
    """A point of the same straight surface, far enough from ``first``; -1: there is none."""
    n = len(points)
    ax, ay = points[first, 0] - laser[0], points[first, 1] - laser[1]
    away = math.sqrt(ax * ax + ay * ay)
    if away == 0.0:  # at the laser itself
        return -1
    k, aside, onward, dx, dy = first, 0.0, 0.0, 0.0, 0.0
    # Across the beams: along the wall, the noise of the two would decide which are paired.
    while k + 1 < n and joined[k] and aside < pairing.apart:
        k += 1
        dx, dy = points[k, 0] - points[first, 0], points[k, 1] - points[first, 1]
        aside = abs(ax * dy - ay * dx) / away
    onward = math.sqrt(dx * dx + dy * dy)
    if aside < pairing.apart or onward > pairing.longest:
        return -1
    for m in range(first + 1, k):
        ex, ey = points[m, 0] - points[first, 0], points[m, 1] - points[first, 1]
        if abs(dx * ey - dy * ex) > pairing.bent * onward * onward:
            return -1
    return k


@inner
def _free_standing(points: Float, joined: Bools, laser: Float, k: int) -> bool:
    """Whether point ``k`` is a thing of its own: joined to nothing and nearer than its neighbours.

    Where a wall is seen at so grazing an angle that its hits are far apart, they are neither.
    """
    if joined[k] or (k > 0 and joined[k - 1]):
        return False
    x, y = points[k, 0] - laser[0], points[k, 1] - laser[1]
    here = x * x + y * y
    for m in (k - 1, k + 1):
        if 0 <= m < len(points):
            x, y = points[m, 0] - laser[0], points[m, 1] - laser[1]
            if x * x + y * y <= here:
                return False
    return True


@uncounted
def _look(  # noqa: PLR0913, PLR0915 (kernel)
    arrays: tuple[Any, ...], short_term: float, cell: float,
    points: Float, covariances: Float, shares: Float,
    weights: Float, joined: Bools, laser: Float,
    pose: Float, start: int, step: int, times: tuple[float, float, float],
    numbers: tuple[float, float, float, float, float], off: Float,
    geometry: Float, sums: Float, old: Float,
) -> None:  # fmt: skip
    """Add up what ``Residuals`` holds; ``times``: s of one look, of a trace's prior age, and
    since all directions of position were seen. ``arrays`` of ``Cells``, ``numbers`` of ``Pairing``;
    no ``weights``: all have one. ``off`` (2,): room to work in."""
    cells, pairing = Cells(*arrays), Pairing(*numbers)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    surfaces = False
    for k in range(len(joined)):
        surfaces = surfaces or joined[k]
    for first in range(start, len(points), step):
        u = (c * points[first, 0] - s * points[first, 1] + pose[0]) / cell - 0.5
        v = (s * points[first, 0] + c * points[first, 1] + pose[1]) / cell - 0.5
        variance = covariances[first, 0] / (cell * cell)
        if not _offset(cells, short_term, u, v, variance, pairing.faint_overlap, off):
            continue
        k = _partner(points, joined, laser, first, pairing)
        if k < 0 and surfaces and not _free_standing(points, joined, laser, first):
            continue
        # what moves says nothing of how far the map is off, nor is it new map
        w = shares[first] * weights[first] if len(weights) > 0 else shares[first]
        sums[WEIGHED] += w
        age = _age(cells, u, v) + times[0] + times[1]
        sums[NEW] += w * times[0] / age
        new = (times[0] + times[2]) / (age + times[2])
        rx, ry = (u + 0.5) * cell - pose[0], (v + 0.5) * cell - pose[1]
        a, b, d, (o, old_off) = 1.0, 0.0, 1.0, _old(cells, u, v)
        if k >= 0:
            dx, dy = points[k, 0] - points[first, 0], points[k, 1] - points[first, 1]
            length = math.sqrt(dx * dx + dy * dy)
            nx, ny = -(s * dx + c * dy) / length, (c * dx - s * dy) / length
            a, b, d = nx * nx, nx * ny, ny * ny
            first_off = off[0] * nx + off[1] * ny
            u = (c * points[k, 0] - s * points[k, 1] + pose[0]) / cell - 0.5
            v = (s * points[k, 0] + c * points[k, 1] + pose[1]) / cell - 0.5
            if _offset(cells, short_term, u, v, variance, pairing.faint_overlap, off):
                sums[SHARED] += w * first_off * (off[0] * nx + off[1] * ny) * cell * cell
                sums[PAIRED] += w
            sums[FEIGNED] += w * min(2.0 * (pairing.sensor_sigma / length) ** 2, 0.5)
        a, b, d = w * a, w * b, w * d
        sums[NEW_XX] += new * a
        sums[NEW_XY] += new * b
        sums[NEW_YY] += new * d
        turned = a * ry * ry - 2.0 * b * rx * ry + d * rx * rx
        part = (a, b, b * rx - a * ry, d, d * rx - b * ry, turned)
        for q in range(6):
            geometry[q] += part[q]
            old[q] += o * part[q]
        old[6] += o * w
        if o * w > 0.0:
            old[7] += o * w * old_off * old_off
    for k in range(6):
        old[k] *= step  # of all points in view


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """What a sample of one frame's points shows.

    geometry  (3, 3) weighted sum over matched points of the outer product of their normal's
              (x, y, theta) direction in the map frame, about the robot; both directions of a
              thing that stands free. Ends and corners of surfaces are left out
    weighed   weight of those points
    in_view   weight of all points like them: the sample stands for so many
    shared    m^2, sum over pairs of the weighted product of their offsets from the map
    paired    weight of those pairs
    feigned   what the noise of beams adds to the geometry along surfaces
    new       weighted sum of the share that this look has in the trace it writes
    new_geometry  (3,) xx, xy, yy: the geometry of positions, each point times the share that looks
              have in its trace since all directions were last seen
    old       (6,) xx, xy, xt, yy, yt, tt: the geometry, each point times the share in which its
              surface is an old one; of all points in view
    old_off_m2  m^2, mean over old surface of what the map was off when it became known, squared
    """

    geometry: Float
    weighed: float
    in_view: float
    shared: float
    paired: float
    feigned: float
    new: float
    new_geometry: Float
    old: Float
    old_off_m2: float

    @property
    def recent(self) -> Float:
        """(7,) ``new_geometry``, feigned, weighed, in_view, and 1 look."""
        rest = self.feigned, self.weighed, self.in_view, 1.0
        return np.array([*self.new_geometry.tolist(), *rest])


def residuals_of(
    cell_map: CellMap,
    short_term: float,
    seen: Observations,
    T_map_robot: Float,
    times: tuple[float, float],
    turn: int,
) -> Residuals:
    """Compare a sample of what is ``seen`` from ``T_map_robot`` with the map, before it is written.

    ``times``: s since the last frame, and since all directions of position were seen; ``turn``
    counts frames: others are looked at each time.
    """
    config, cell = cell_map.config.uncertainty.residuals, cell_map.cell
    step = max(1, len(seen.points_robot) // config.samples)
    pairing = (
        config.apart_cells * cell,
        config.longest_cells * cell,
        config.faint_overlap,
        config.bent,
        seen.sensor_sigma_m,
    )
    geometry, sums, old = np.zeros(6), np.zeros(8), np.zeros(8)
    elapsed, since_s = times
    _look(
        tuple(cell_map.cells), short_term, cell, seen.points_robot, seen.covariances, seen.shares,
        NO_WEIGHTS if seen.weights is None else seen.weights, seen.joined, seen.T_robot_laser,
        T_map_robot, turn % step, step, (elapsed, cell_map.pace(elapsed), since_s), pairing,
        np.empty(2), geometry, sums, old,
    )  # fmt: skip
    shared, paired, feigned, new, weighed = sums[:NEW_XX].tolist()
    return Residuals(
        geometry=whole(geometry),
        weighed=weighed,
        in_view=weighed * step,
        shared=shared,
        paired=paired,
        feigned=feigned,
        new=new,
        new_geometry=sums[NEW_XX:],
        old=old[:6],
        old_off_m2=float(old[7] / old[6]) if old[6] > 0.0 else 0.0,
    )
