# SPDX-License-Identifier: Apache-2.0
"""Branch and bound over headings and offsets on a lattice.

Of equally good candidates the one of the lowest heading, then row, then column is taken.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from llvmlite.ir import IntType
from numba import uint64
from numba.extending import intrinsic

from slam._jit import inner, njit
from slam.arrays import Bytes, Float, Int32, Ints, Words

SPAN = 8  # a block of 8 x 8 offsets is bounded, and scored, at once
FULL = 257  # bytes of which 16 bits hold the sum
LOW = np.uint64(0x00FF00FF00FF00FF)


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """What is searched.

    field      (rows, columns) uint8; ``ahead`` its maxima over the 8 x 8 neighbours from each on
    bases      (headings, n, 2) int32 columns and rows of the points at offset (0, 0)
    turns      (headings,) rad from the prediction
    reach      offsets go from -reach to reach, cells
    pitch      m between two offsets
    precision  (3, 3) of the prior
    gain       score of a sum of 1
    """

    field: Bytes
    ahead: Bytes
    bases: Int32
    turns: Float
    reach: int
    pitch: float
    precision: Float
    gain: float


@dataclass(frozen=True, kw_only=True)
class Found:
    """The best candidate, and how many were scored or bounded."""

    score: float
    heading: int
    column: int
    row: int
    evaluations: int


def look_ahead(field: Bytes, ahead: Bytes) -> Bytes:
    """``ahead``, which is all 0, with the largest of the 8 x 8 values of ``field`` from each one
    on; the last rows and columns have fewer.

    ``field`` has a whole number of blocks of columns. Where it is empty, no work is done.
    """
    _look_ahead(field, field.view(np.uint64), ahead)
    return ahead


@njit
def _look_ahead(  # noqa: C901 (kernel)
    field: Bytes, words: Words, ahead: Bytes
) -> None:
    """``words``: eight values of ``field`` in one, which show at once where nothing is."""
    rows = len(field)
    strip = np.empty((SPAN, 2 * SPAN - 1), np.uint8)
    for top in range(0, rows, SPAN):
        high = min(SPAN, rows - top)
        for word in range(words.shape[1]):
            some = words[top, word]
            for r in range(top + 1, top + high):
                some |= words[r, word]
            if some == 0:
                continue
            left = word * SPAN
            for r in range(high):  # along the rows: from 7 columns before the block to its last
                row, largest = field[top + r], np.uint8(0)
                for c in range(SPAN):
                    largest = max(largest, row[left + c])
                    strip[r, c] = largest
                largest = np.uint8(0)
                for c in range(SPAN - 1, 0, -1):
                    largest = max(largest, row[left + c])
                    strip[r, SPAN - 1 + c] = largest
            for c in range(max(0, SPAN - 1 - left), 2 * SPAN - 1):
                column = left + c - SPAN + 1
                largest = np.uint8(0)
                for r in range(SPAN - 1):  # down to each row that looks at the block's first ones
                    if r < high:
                        largest = max(largest, strip[r, c])
                    into = top + r - SPAN + 1
                    if into >= 0:
                        ahead[into, column] = max(ahead[into, column], largest)
                largest = np.uint8(0)
                for r in range(high - 1, -1, -1):
                    largest = max(largest, strip[r, c])
                    ahead[top + r, column] = max(ahead[top + r, column], largest)


@intrinsic  # type: ignore[untyped-decorator]  # numba has no types
def _eight(_: Any, array: Any, at: Any) -> Any:
    """Eight neighbouring values of a flat array of bytes in one number, the first in its lowest."""

    def load(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        first = builder.gep(data, [args[1]])
        return builder.load(builder.bitcast(first, IntType(64).as_pointer()), align=1)

    return uint64(array, at), load


@inner
def open_block(
    field: Bytes, flat: Words, first: int, columns: int,
    sums: Ints,
) -> None:  # fmt: skip
    """``sums`` (8, 8) of ``field``, which is flat and has so many ``columns``, under the points.

    ``flat`` (n,) their places in it, to which ``first`` is added, and the offsets from 0 to 7 each
    way. Eight values are added at once, each in 16 bits, which hold the sum of ``FULL`` of them:
    one by one takes five times as long. Places are unsigned, so that no index can be negative.
    """
    for a in range(SPAN):
        down = np.uint64(first + a * columns)
        sums[a] = 0
        for start in range(0, len(flat), FULL):
            some, even, odd = flat[start : start + FULL], np.uint64(0), np.uint64(0)
            for k in range(len(some)):
                values = _eight(field, some[k] + down)
                even += values & LOW
                odd += (values >> np.uint64(8)) & LOW
            for b in range(0, SPAN, 2):
                sums[a, b] += np.int64((even >> np.uint64(8 * b)) & np.uint64(0xFFFF))
                sums[a, b + 1] += np.int64((odd >> np.uint64(8 * b)) & np.uint64(0xFFFF))


@njit
def _bound(
    ahead: Bytes, bases: Int32, costs: Float, reach: int, gain: float, bounds: Float
) -> None:
    """Upper bounds (headings, rows, columns) of the blocks of offsets."""
    columns, cells = ahead.shape[1], ahead.ravel()  # places as in ``open_block``
    flat = np.empty(bases.shape[1], np.uint64)
    for h in range(bounds.shape[0]):
        for k in range(len(flat)):
            flat[k] = bases[h, k, 1] * columns + bases[h, k, 0]
        for a in range(bounds.shape[1]):
            for b in range(bounds.shape[2]):
                first, total = np.uint64((a * SPAN - reach) * columns + b * SPAN - reach), 0
                for k in range(len(flat)):
                    total += cells[flat[k] + first]
                bounds[h, a, b] = gain * total - costs[h]


@inner
def _first(index: Ints, heading: int, row: int, column: int) -> bool:
    """Whether a candidate comes before that of the index."""
    if heading != index[0]:
        return bool(heading < index[0])
    return bool(row < index[1] or (row == index[1] and column < index[2]))


@inner
def _cost(precision: Float, pitch: float, column: int, row: int, turn: float) -> float:
    """1/2 e' P^-1 e of a candidate."""
    ex, ey, et = column * pitch, row * pitch, turn
    cross = precision[0, 1] * ex * ey
    cross += precision[0, 2] * ex * et + precision[1, 2] * ey * et
    square = precision[0, 0] * ex * ex + precision[1, 1] * ey * ey
    square += precision[2, 2] * et * et
    return float(0.5 * (square + 2.0 * cross))


@njit
def _descend(  # noqa: PLR0913 (kernel)
    field: Bytes,
    bases: Int32,
    turns: Float,
    reach: int,
    pitch: float,
    precision: Float,
    gain: float,
    bounds: Float,
    order: Ints,
    index: Ints,
) -> tuple[float, int]:
    """Open blocks in falling ``order`` of their bounds, as long as one may hold a better candidate.

    Returns the best score, and how many candidates were scored; ``index`` (3,) becomes the
    heading, row and column of the best.
    """
    across, columns = bounds.shape[1], field.shape[1]
    best, evaluations = -math.inf, 0
    cells = field.ravel()
    flat, sums = np.empty(bases.shape[1], np.uint64), np.empty((SPAN, SPAN), np.int64)
    for entry in order:
        h, rest = entry // (across * across), entry % (across * across)
        if bounds[h, rest // across, rest % across] < best:
            break
        di, dj = rest % across * SPAN - reach, rest // across * SPAN - reach
        for k in range(bases.shape[1]):
            flat[k] = bases[h, k, 1] * columns + bases[h, k, 0]
        open_block(cells, flat, dj * columns + di, columns, sums)
        evaluations += SPAN * SPAN
        for a in range(min(SPAN, reach - dj + 1)):
            for b in range(min(SPAN, reach - di + 1)):
                i, j = di + b, dj + a
                score = gain * sums[a, b] - _cost(precision, pitch, i, j, turns[h])
                if score > best or (score == best and _first(index, h, j, i)):
                    best = score
                    index[0], index[1], index[2] = h, j, i
    return best, evaluations


def _heading_costs(precision: Float, turns: Float) -> Float:
    """The least 1/2 e' P^-1 e of each heading, whatever the offset."""
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = precision.tolist()
    det = xx * yy - xy * xy
    if det <= 0.0:  # no prior
        return np.zeros(len(turns))
    bx, by = (xy * yt - yy * xt) / det, (xy * xt - xx * yt) / det
    square = xx * bx * bx + yy * by * by + tt + 2.0 * (xy * bx * by + xt * bx + yt * by)
    costs: Float = 0.5 * max(square, 0.0) * turns * turns * (1.0 - 1e-9)
    return costs


def best_of(of: Lattice) -> Found:
    """The best candidate of a lattice."""
    across, index = 2 * of.reach // SPAN + 1, np.zeros(3, np.int64)
    bounds = np.empty((len(of.turns), across, across))
    costs = _heading_costs(of.precision, of.turns)
    _bound(of.ahead, of.bases, costs, of.reach, of.gain, bounds)
    order = np.argsort(-bounds.ravel())  # alike ones are all opened, or none
    score, scored = _descend(
        of.field, of.bases, of.turns, of.reach, of.pitch, of.precision, of.gain,
        bounds, order, index,
    )  # fmt: skip
    heading, row, column = index.tolist()
    return Found(
        score=score, heading=heading, row=row, column=column, evaluations=bounds.size + scored
    )
