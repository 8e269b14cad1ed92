# SPDX-License-Identifier: Apache-2.0
"""Multi-resolution search for the pose in a wide window (section 3.4), by branch and bound.

A field of smoothed activities in small integers is built once; its sliding maxima over 2, 4, 8
neurons bound the overlap of whole blocks of offsets from above. The prior enters a bound with what
its heading alone costs, so no bound is ever too low and the result equals exhaustive search.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.frames import Float
from slam.shunting.cells import MASK, SHIFT, SIDE, Cells
from slam.shunting.impressions import SIGMA_CELLS, Observations
from slam.shunting.network import Network

LEVELS = 3  # coarsest block of offsets: 8 x 8 neurons
FULL = 255.0  # integer that stands for the field's value 1
MAX_POINTS = 180  # more add cost, not certainty


@dataclass(frozen=True, kw_only=True)
class SearchWindow:
    """Half widths about the prediction: ``reach_m`` along x and y, ``turn_rad`` in heading."""

    reach_m: float
    turn_rad: float


@njit
def _field(
    cells: Cells,
    short_term: float,
    i0: int,
    j0: int,
    kernel: NDArray[np.float64],
    out: NDArray[np.uint8],
) -> None:
    """Activities smoothed by the (5,) kernel along both axes, in ``out[j - j0, i - i0]``.

    (i0, j0) is the corner of a block, ``out`` a whole number of blocks. Zero where no block lives.
    """
    rows, columns = cells.directory.shape
    padded = np.empty((SIDE + 4, SIDE + 4))
    smooth = np.empty((SIDE + 4, SIDE))
    for block_row in range(out.shape[0] >> SHIFT):
        row = (j0 >> SHIFT) + block_row - cells.corner[1]
        if row < 0 or row >= rows:
            continue
        for block_column in range(out.shape[1] >> SHIFT):
            column = (i0 >> SHIFT) + block_column - cells.corner[0]
            if column < 0 or column >= columns or cells.directory[row, column] < 0:
                continue
            for a in range(SIDE + 4):
                for b in range(SIDE + 4):
                    r, q = row + ((a - 2) >> SHIFT), column + ((b - 2) >> SHIFT)
                    value = 0.0
                    if 0 <= r < rows and 0 <= q < columns:
                        slot = cells.directory[r, q]
                        if slot >= 0:
                            y = cells.y[slot, (a - 2) & MASK, (b - 2) & MASK]
                            x = cells.x[slot, (a - 2) & MASK, (b - 2) & MASK]
                            value = y + (1.0 - y) * short_term * x
                    padded[a, b] = value
            for a in range(SIDE + 4):
                for b in range(SIDE):
                    total = 0.0
                    for m in range(5):
                        total += kernel[m] * padded[a, b + m]
                    smooth[a, b] = total
            for a in range(SIDE):
                for b in range(SIDE):
                    total = 0.0
                    for m in range(5):
                        total += kernel[m] * smooth[a + m, b]
                    out[block_row * SIDE + a, block_column * SIDE + b] = np.uint8(
                        min(255.0, 255.0 * total + 0.5)
                    )


@njit
def _slide(source: NDArray[np.uint8], span: int, out: NDArray[np.uint8]) -> None:
    """out[r, c] = max of source over rows r, r + span and columns c, c + span (inside)."""
    rows, columns = source.shape
    for r in range(rows):
        other = min(r + span, rows - 1)
        for c in range(columns - span):
            a = max(source[r, c], source[r, c + span])
            b = max(source[other, c], source[other, c + span])
            out[r, c] = max(a, b)
        for c in range(columns - span, columns):
            out[r, c] = max(source[r, c], source[other, c])


@njit
def _sum(level: NDArray[np.uint8], base: NDArray[np.int32], di: int, dj: int) -> int:
    """Sum of the level's values under the points (n, 2: column, row) shifted by (di, dj)."""
    total = 0
    for k in range(len(base)):
        total += level[base[k, 1] + dj, base[k, 0] + di]
    return total


@njit
def _mahalanobis(precision: NDArray[np.float64], ex: float, ey: float, et: float) -> float:
    return float(
        precision[0, 0] * ex * ex
        + precision[1, 1] * ey * ey
        + precision[2, 2] * et * et
        + 2.0 * (precision[0, 1] * ex * ey + precision[0, 2] * ex * et + precision[1, 2] * ey * et)
    )


@njit
def _heading_cost(precision: NDArray[np.float64], turn: float) -> float:
    """The least 1/2 e' P^-1 e of a heading, whatever the offset."""
    det = precision[0, 0] * precision[1, 1] - precision[0, 1] * precision[0, 1]
    bx = (precision[0, 1] * precision[1, 2] - precision[1, 1] * precision[0, 2]) / det
    by = (precision[0, 1] * precision[0, 2] - precision[0, 0] * precision[1, 2]) / det
    return 0.5 * _mahalanobis(precision, bx, by, 1.0) * turn * turn * (1.0 - 1e-9)


@njit
def _bound(
    level: NDArray[np.uint8],
    bases: NDArray[np.int32],
    costs: NDArray[np.float64],
    reach: int,
    width: int,
    gain: float,
    bounds: NDArray[np.float64],
) -> None:
    """Upper bounds (headings, rows, columns) of the coarsest blocks of offsets."""
    for h in range(bounds.shape[0]):
        for a in range(bounds.shape[1]):
            for b in range(bounds.shape[2]):
                total = _sum(level, bases[h], b * width - reach, a * width - reach)
                bounds[h, a, b] = gain * total - costs[h]


@njit
def _is_apart(
    apart: tuple[NDArray[np.float64], float, float], di: int, dj: int, turn: float
) -> bool:
    taken, cells, rad = apart
    for k in range(len(taken)):
        off = turn - taken[k, 2]
        off -= math.tau * math.floor(off / math.tau + 0.5)
        di_off, dj_off = di - taken[k, 0], dj - taken[k, 1]
        if abs(off) < rad and di_off * di_off + dj_off * dj_off < cells * cells:
            return False
    return True


@njit
def descend(
    levels: NDArray[np.uint8],
    bases: NDArray[np.int32],
    turns: NDArray[np.float64],
    costs: NDArray[np.float64],
    reach: int,
    cell: float,
    precision: NDArray[np.float64],
    gain: float,
    bounds: NDArray[np.float64],
    order: NDArray[np.int64],
    best_index: NDArray[np.int64],
    floor: float,
    apart: tuple[NDArray[np.float64], float, float],
) -> tuple[float, int]:
    """Depth first through the blocks in falling ``order`` of their bounds.

    Only what scores above ``floor`` counts, and is apart from each of the (n, 3) given offsets di,
    dj and turns by so many cells or so many rad.
    """
    top = len(levels) - 1
    across = bounds.shape[1]
    best, evaluations = floor, 0
    stack = np.empty((4 * (top + 1) + 4, 3), np.int64)  # di, dj, level
    stack_bound = np.empty(4 * (top + 1) + 4)
    children = np.empty(4)
    for entry in order:
        h, rest = entry // (across * across), entry % (across * across)
        if bounds[h, rest // across, rest % across] <= best:
            break
        depth = 1
        stack[0, 0] = (rest % across) * (1 << top) - reach
        stack[0, 1] = (rest // across) * (1 << top) - reach
        stack[0, 2] = top
        stack_bound[0] = bounds[h, rest // across, rest % across]
        while depth > 0:
            depth -= 1
            di, dj, level = stack[depth, 0], stack[depth, 1], stack[depth, 2]
            if stack_bound[depth] <= best:
                continue
            if level == 0:
                if not _is_apart(apart, di, dj, turns[h]):
                    continue
                best = stack_bound[depth]
                best_index[0], best_index[1], best_index[2] = h, di, dj
                continue
            span = 1 << (level - 1)
            for q in range(4):
                i, j = di + (q & 1) * span, dj + (q >> 1) * span
                children[q] = -math.inf
                if i > reach or j > reach:
                    continue
                evaluations += 1
                value = gain * _sum(levels[level - 1], bases[h], i, j)
                if level == 1:
                    children[q] = value - 0.5 * _mahalanobis(
                        precision, i * cell, j * cell, turns[h]
                    )
                else:
                    children[q] = value - costs[h]
            for _ in range(4):  # the best is pushed last
                least = 0
                for q in range(1, 4):
                    if children[q] < children[least]:
                        least = q
                if best < children[least] < math.inf:
                    stack[depth, 0] = di + (least & 1) * span
                    stack[depth, 1] = dj + (least >> 1) * span
                    stack[depth, 2] = level - 1
                    stack_bound[depth] = children[least]
                    depth += 1
                children[least] = math.inf
    return best, evaluations


def branch_and_bound(
    levels: NDArray[np.uint8],
    bases: NDArray[np.int32],
    turns: Float,
    reach: int,
    cell: float,
    precision: Float,
    gain: float,
    best_index: NDArray[np.int64],
) -> tuple[float, int]:
    """Maximise gain * sum - 1/2 e' precision e over headings and offsets -reach..reach cells.

    ``levels`` (L + 1, rows, columns); level l holds maxima over 2^l x 2^l. ``bases`` (headings, n,
    2) columns and rows of the points at offset (0, 0); ``turns`` (headings,) rad from the
    prediction. Fills ``best_index`` with (heading, di, dj); returns the score and how many
    candidates were scored.
    """
    width = 1 << (len(levels) - 1)
    costs = np.array([_heading_cost(precision, float(turn)) for turn in turns])
    bounds = bounds_of(levels[-1], bases, costs, reach, width, gain)
    order = np.argsort(-bounds.ravel(), kind="stable")
    best, evaluations = descend(
        levels, bases, turns, costs, reach, cell, precision, gain, bounds, order, best_index,
        -math.inf, (np.zeros((0, 3)), 0.0, 0.0),
    )  # fmt: skip
    return best, evaluations + bounds.size


def bounds_of(
    level: NDArray[np.uint8],
    bases: NDArray[np.int32],
    costs: Float,
    reach: int,
    width: int,
    gain: float,
) -> Float:
    """Upper bounds (headings, rows, columns) of blocks of ``width`` x ``width`` offsets."""
    across = (2 * reach) // width + 1
    bounds = np.empty((len(bases), across, across))
    _bound(level, bases, costs, reach, width, gain, bounds)
    return bounds


@njit
def place(
    points: NDArray[np.float64],
    prediction: NDArray[np.float64],
    turns: NDArray[np.float64],
    cell: float,
    i0: int,
    j0: int,
    out: NDArray[np.int32],
) -> None:
    """Column and row of each point at each heading, for the predicted position."""
    for h in range(len(turns)):
        c, s = math.cos(prediction[2] + turns[h]), math.sin(prediction[2] + turns[h])
        for k in range(len(points)):
            x = c * points[k, 0] - s * points[k, 1] + prediction[0]
            y = s * points[k, 0] + c * points[k, 1] + prediction[1]
            out[h, k, 0] = math.floor(x / cell) - i0
            out[h, k, 1] = math.floor(y / cell) - j0


def levels_of(field: NDArray[np.uint8], depth: int = LEVELS) -> NDArray[np.uint8]:
    """(depth + 1, rows, columns): level l is the maximum over l's 2^l x 2^l forward neighbours."""
    levels = np.empty((depth + 1, *field.shape), np.uint8)
    levels[0] = field
    for level in range(depth):
        _slide(levels[level], 1 << level, levels[level + 1])
    return levels


def _kernel() -> Float:
    """Gaussian taps such that a lone landmark's field is 1 at its centre."""
    taps = np.array([math.exp(-0.5 * (m / SIGMA_CELLS) ** 2) for m in (-2, -1, 0, 1, 2)])
    return taps / math.sqrt(math.pi * SIGMA_CELLS**2)


def field_of(
    network: Network, short_term: float, i0: int, j0: int, rows: int, columns: int
) -> NDArray[np.uint8]:
    """(rows, columns) smoothed activities from neuron (i0, j0) on, which begins a block."""
    field = np.zeros((rows, columns), np.uint8)
    _field(network.cells, short_term, i0, j0, _kernel(), field)
    return field


def headings(points: Float, window: SearchWindow, cell: float) -> Float:
    """Turns to try, rad: a far point moves at most about 1.5 neurons between two of them."""
    distances = np.sqrt((points * points).sum(axis=1))
    far = float(np.sort(distances)[(3 * len(distances)) // 4])
    step = min(max(1.5 * cell / max(far, cell), 0.003), 0.03)
    half = math.ceil(window.turn_rad / step)
    return np.asarray(np.arange(-half, half + 1) * step, dtype=np.float64)


def search(
    network: Network,
    short_term: float,
    observations: Observations,
    prediction: Float,
    precision: Float,
    window: SearchWindow,
    gain: float,
) -> tuple[Float, int]:
    """Best pose on the lattice of the window, and how many candidates were scored."""
    cell = network.cell
    points = observations.points_robot
    if len(points) == 0:
        return prediction, 0
    every = math.ceil(len(points) / MAX_POINTS)
    chosen = np.ascontiguousarray(points[::every])
    turns = headings(chosen, window, cell)
    reach = math.ceil(window.reach_m / cell)
    radius = math.sqrt(float((chosen * chosen).sum(axis=1).max()))
    # Offsets may overshoot by a block of the coarsest level.
    edge = reach + (1 << LEVELS) + 2
    i0 = ((math.floor((prediction[0] - radius) / cell) - edge) >> SHIFT) * SIDE
    j0 = ((math.floor((prediction[1] - radius) / cell) - edge) >> SHIFT) * SIDE
    across = ((math.ceil(2.0 * radius / cell) + 2 * edge) // SIDE + 3) * SIDE
    field = field_of(network, short_term, i0, j0, across, across)
    bases = np.empty((len(turns), len(chosen), 2), np.int32)
    place(chosen, prediction, turns, cell, i0, j0, bases)
    best = np.zeros(3, np.int64)
    scale = gain * float(observations.weights.mean()) * len(points) / len(chosen) / FULL
    _, evaluations = branch_and_bound(
        levels_of(field), bases, turns, reach, cell, precision, scale, best
    )
    return (
        np.array(
            [
                prediction[0] + best[1] * cell,
                prediction[1] + best[2] * cell,
                prediction[2] + turns[best[0]],
            ]
        ),
        evaluations,
    )
