# SPDX-License-Identifier: Apache-2.0
"""Search of the whole map for places that look like what is in view, by branch and bound.

On a lattice of about 0.12 m, over every heading. Several answers, well apart: rooms look alike, and
one scan seldom tells which it is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.frames import Float
from slam.shunting.cells import SIDE
from slam.shunting.network import Network
from slam.shunting.search import bounds_of, descend, field_of, levels_of, place

PITCH_M = 0.12  # neurons are pooled up to this edge
BESIDE = 0.7  # what a place beside structure is worth: poses are only tried every PITCH_M
FAR_M = 20.0  # returns beyond turn too fast with the heading
FEW = 120  # returns are enough
APART_M, APART_RAD = 1.0, 0.5  # between two answers, at least one of them
WORTH = 0.6  # answers worse than this share of the best are dropped
MAX_ACROSS = 40  # coarsest blocks along the map


@njit
def pooled(fine: NDArray[np.uint8], pool: int, out: NDArray[np.uint8]) -> None:
    """out = the largest of ``pool`` x ``pool`` neighbouring values."""
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            value = 0
            for a in range(r * pool, (r + 1) * pool):
                for b in range(c * pool, (c + 1) * pool):
                    value = max(value, int(fine[a, b]))
            out[r, c] = value


@njit
def spread(source: NDArray[np.uint8], beside: float, out: NDArray[np.uint8]) -> None:
    """out = source, or ``beside`` times the largest of the eight values around."""
    rows, columns = source.shape
    for r in range(rows):
        for c in range(columns):
            around = 0
            for a in range(max(r - 1, 0), min(r + 2, rows)):
                for b in range(max(c - 1, 0), min(c + 2, columns)):
                    around = max(around, int(source[a, b]))
            out[r, c] = max(int(source[r, c]), int(beside * around))


def _pooling(cell: float) -> int:
    pool = 1
    while pool < SIDE and 2 * pool * cell <= 1.01 * PITCH_M:
        pool *= 2
    return pool


def _coarse_field(network: Network, short_term: float, pool: int) -> NDArray[np.uint8]:
    """The whole map, pooled; row 0, column 0 at the corner of ``network.extent()``."""
    extent = network.extent()
    if extent is None:
        return np.zeros((0, 0), np.uint8)
    i0, j0, i1, j1 = extent
    coarse = np.zeros(((j1 - j0) // pool, (i1 - i0) // pool), np.uint8)
    for row in range(0, j1 - j0, SIDE):  # one row of blocks at a time keeps it small
        fine = field_of(network, short_term, i0, j0 + row, SIDE, i1 - i0)
        pooled(fine, pool, coarse[row // pool : (row + SIDE) // pool])
    out = np.empty_like(coarse)
    spread(coarse, BESIDE, out)
    return out


def _headings(points: Float, pitch: float) -> Float:
    distances = np.sort(np.sqrt((points * points).sum(axis=1)))
    far = float(distances[(3 * len(distances)) // 4])
    count = math.ceil(math.tau / min(max(pitch / max(far, pitch), 0.01), 0.1))
    return np.asarray(np.arange(count) * (math.tau / count), dtype=np.float64)


def places(
    network: Network,
    short_term: float,
    points_robot: Float,
    most: int,
    about: tuple[Float, float, float] | None = None,
) -> list[Float]:
    """Up to ``most`` poses T_map_robot, the best first, from which the points would fit the map.

    ``about`` limits the search to a pose, so many m and so many rad around it. Answers are good to
    about 0.1 m and 1 degree; to be refined by climbing.
    """
    near = points_robot[(points_robot * points_robot).sum(axis=1) < FAR_M**2]
    extent = network.extent()
    if extent is None or len(near) == 0:
        return []
    chosen = np.ascontiguousarray(near[:: math.ceil(len(near) / FEW)])
    pool = _pooling(network.cell)
    pitch = pool * network.cell
    field = _coarse_field(network, short_term, pool)
    i0, j0, i1, j1 = extent
    middle = np.array([0.5 * (i0 + i1) * network.cell, 0.5 * (j0 + j1) * network.cell, 0.0])
    reach = math.ceil(0.5 * max(field.shape))
    turns = _headings(chosen, pitch)
    if about is not None:
        middle, reach = np.array(about[0]), math.ceil(about[1] / pitch)
        step = float(turns[1])
        half = math.ceil(about[2] / step)
        turns = np.asarray(np.arange(-half, half + 1) * step, dtype=np.float64)
    depth = 2
    while (2 * reach) >> depth > MAX_ACROSS:
        depth += 1
    # Cut out, or pad, so that no point falls outside wherever the robot is tried.
    radius = math.ceil(math.sqrt(float((chosen * chosen).sum(axis=1).max())) / pitch)
    edge = radius + reach + (1 << depth) + 2
    column = math.floor(float(middle[0]) / pitch) - i0 // pool - edge
    row = math.floor(float(middle[1]) / pitch) - j0 // pool - edge
    levels = levels_of(_cut(field, row, column, 2 * edge), depth)
    bases = np.empty((len(turns), len(chosen), 2), np.int32)
    place(chosen, middle, turns, pitch, column + i0 // pool, row + j0 // pool, bases)
    return _answers(levels, bases, turns, (reach, pitch), middle, most)


def _cut(field: NDArray[np.uint8], row: int, column: int, side: int) -> NDArray[np.uint8]:
    """(side, side) of the field from (row, column) on, 0 where it has nothing."""
    out = np.zeros((side, side), np.uint8)
    r0, r1 = max(row, 0), min(row + side, field.shape[0])
    c0, c1 = max(column, 0), min(column + side, field.shape[1])
    if r0 < r1 and c0 < c1:
        out[r0 - row : r1 - row, c0 - column : c1 - column] = field[r0:r1, c0:c1]
    return out


def _answers(
    levels: NDArray[np.uint8],
    bases: NDArray[np.int32],
    turns: Float,
    lattice: tuple[int, float],
    middle: Float,
    most: int,
) -> list[Float]:
    reach, pitch = lattice
    free = np.zeros((3, 3))  # no prior
    costs = np.zeros(len(turns))
    gain = 1.0 / (255.0 * bases.shape[1])
    bounds = bounds_of(levels[-1], bases, costs, reach, 1 << (len(levels) - 1), gain)
    order = np.argsort(-bounds.ravel(), kind="stable")
    taken = np.zeros((0, 3))
    found: list[Float] = []
    floor, best = -math.inf, np.zeros(3, np.int64)
    for _ in range(most):
        apart = (taken, APART_M / pitch, APART_RAD)
        score, _ = descend(
            levels, bases, turns, costs, reach, pitch, free, gain, bounds, order, best, floor, apart
        )
        if score <= floor:
            break
        floor = max(floor, WORTH * score)
        turn = float(turns[best[0]])
        taken = np.vstack([taken, [float(best[1]), float(best[2]), turn]])
        found.append(middle + np.array([best[1] * pitch, best[2] * pitch, turn]))
    return found
