# SPDX-License-Identifier: Apache-2.0
"""Search of the whole map for places that look like what is in view, by branch and bound.

On a lattice of about 0.12 m, over every heading. Several answers, well apart: rooms look alike, and
one scan seldom shows which it is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam.frames import Float
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import SIDE
from slam.tracker.matching.branch_and_bound import Lattice, Search, levels_of
from slam.tracker.matching.config import GlobalConfig
from slam.tracker.matching.local_search import field_of, place

STRIP = 16 * SIDE  # cells pooled at a time, so that little of the map is ever laid out
MAX_ACROSS = 40  # coarsest blocks along the map


def pooled(fine: NDArray[np.uint8], pool: int) -> NDArray[np.uint8]:
    """The largest of ``pool`` x ``pool`` neighbouring values."""
    rows, columns = fine.shape
    blocks = fine.reshape(rows // pool, pool, columns // pool, pool)
    largest: NDArray[np.uint8] = blocks.max(axis=(1, 3))
    return largest


def spread(source: NDArray[np.uint8], beside: float) -> NDArray[np.uint8]:
    """The source, or ``beside`` times the largest of the eight values around."""
    padded = np.pad(source, 1)
    wide = np.maximum(np.maximum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
    around = np.maximum(np.maximum(wide[:-2], wide[1:-1]), wide[2:])
    return np.maximum(source, (beside * around).astype(np.uint8))


def pooling(cell: float, pitch_m: float) -> int:
    """Cells that are pooled each way, a power of 2."""
    pool = 1
    while pool < SIDE and 2 * pool * cell <= 1.01 * pitch_m:
        pool *= 2
    return pool


def coarse_field(cell_map: CellMap, short_term: float) -> NDArray[np.uint8]:
    """The whole map, pooled; row 0, column 0 at the corner of ``cell_map.extent()``."""
    config = cell_map.config.matching.whole
    extent, pool = cell_map.extent(), pooling(cell_map.cell, config.pitch_m)
    if extent is None:
        return np.zeros((0, 0), np.uint8)
    i0, j0, i1, j1 = extent
    coarse = np.zeros(((j1 - j0) // pool, (i1 - i0) // pool), np.uint8)
    for row in range(0, j1 - j0, STRIP):
        rows = min(STRIP, j1 - j0 - row)
        fine = field_of(cell_map, short_term, i0, j0 + row, rows, i1 - i0)
        coarse[row // pool : (row + rows) // pool] = pooled(fine, pool)
    return spread(coarse, config.beside)


def headings(points: Float, pitch: float, config: GlobalConfig) -> Float:
    """Turns to try, rad: all round, so that a far point moves by about one pitch between two."""
    distances = np.sort(np.sqrt((points * points).sum(axis=1)))
    far = float(distances[(3 * len(distances)) // 4])
    step = min(max(pitch / max(far, pitch), config.finest_rad), config.coarsest_rad)
    count = math.ceil(math.tau / step)
    return np.asarray(np.arange(count) * (math.tau / count), dtype=np.float64)


def places(
    cell_map: CellMap,
    short_term: float,
    points_robot: Float,
    most: int,
    about: tuple[Float, float, float] | None = None,
    field: NDArray[np.uint8] | None = None,
) -> list[Float]:
    """Up to ``most`` poses T_map_robot, the best first, from which the points would fit the map.

    ``about`` limits the search to a pose, so many m and so many rad around it; ``field`` is the
    ``coarse_field`` of the map where that is at hand. Answers are good to
    about 0.1 m and 1 degree; to be refined by climbing.
    """
    config = cell_map.config.matching.whole
    near = points_robot[(points_robot * points_robot).sum(axis=1) < config.far_m**2]
    extent = cell_map.extent()
    if extent is None or len(near) == 0:
        return []
    chosen = np.ascontiguousarray(near[:: math.ceil(len(near) / config.points)])
    pool = pooling(cell_map.cell, config.pitch_m)
    pitch = pool * cell_map.cell
    if field is None:
        field = coarse_field(cell_map, short_term)
    i0, j0, i1, j1 = extent
    middle = np.array([0.5 * (i0 + i1) * cell_map.cell, 0.5 * (j0 + j1) * cell_map.cell, 0.0])
    reach = math.ceil(0.5 * max(field.shape))
    turns = headings(chosen, pitch, config)
    if about is not None:
        middle, reach = np.array(about[0]), math.ceil(about[1] / pitch)
        step = float(turns[1])
        half = math.ceil(about[2] / step)
        turns = np.asarray(np.arange(-half, half + 1) * step, dtype=np.float64)
    depth = 3
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
    lattice = Lattice(
        levels=levels,
        bases=bases,
        turns=turns,
        reach=reach,
        pitch=pitch,
        precision=np.zeros((3, 3)),
        gain=1.0 / (255.0 * len(chosen)),
        apart=(config.apart_m / pitch, config.apart_rad),
    )
    return _answers(Search(lattice), lattice, middle, most, config.worth)


def _cut(field: NDArray[np.uint8], row: int, column: int, side: int) -> NDArray[np.uint8]:
    """(side, side) of the field from (row, column) on, 0 where it has nothing."""
    out = np.zeros((side, side), np.uint8)
    r0, r1 = max(row, 0), min(row + side, field.shape[0])
    c0, c1 = max(column, 0), min(column + side, field.shape[1])
    if r0 < r1 and c0 < c1:
        out[r0 - row : r1 - row, c0 - column : c1 - column] = field[r0:r1, c0:c1]
    return out


def _answers(
    search: Search, lattice: Lattice, middle: Float, most: int, worth: float
) -> list[Float]:
    found: list[Float] = []
    floor, taken = -math.inf, np.zeros((0, 3))
    for _ in range(most):
        best = search.best(floor, taken)
        if best.heading < 0:
            break
        floor = max(floor, worth * best.score)
        turn = float(lattice.turns[best.heading])
        taken = np.vstack([taken, [float(best.column), float(best.row), turn]])
        pitch = lattice.pitch
        found.append(middle + np.array([best.column * pitch, best.row * pitch, turn]))
    return found
