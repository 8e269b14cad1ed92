# SPDX-License-Identifier: Apache-2.0
"""Where a map's cells are kept: blocks of 8 x 8 in a pool, found through a directory.

A cell costs memory only where its block lives; a block is born under an impression and dies when
every cell in it is silent.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam._jit import inlined, inner
from slam.arrays import Bytes, Float, Float32, Int32, Ints
from slam.frontend.surfaces import FACES
from slam.frontend.visibility import View, free_around

SIDE = 8  # cells along a block's edge
SHIFT, MASK = 3, 7  # i >> SHIFT is the block of cell i, i & MASK its place inside

MOST_OFF = 255  # cm
FREE_COUNT, TOUCHED_COUNT = 0, 1  # places in ``Cells.counts``
FIRST, _FIRST_ACROSS = 64, 64  # blocks that there is room for, and their directory's edge


class Cells(NamedTuple):
    """The arrays of the map, as the kernels see them. S slots, T touched blocks.

    directory   (rows, columns) int32: slot of a block, -1 where none lives
    corner      (2,) int64: block index (x, y) of directory[0, 0]
    x           (S, 8, 8) float32: short-term activity in [0, 1); indexed [slot, row, col]
    y           (S, 8, 8) float32: long-term trace, the running mean of the input
    age         (S, 8, 8) float32: s of looking that ``y`` averages over
    facing      (S, 8, 8) uint8: the way the surface faces that was traced there (``surfaces.face``)
    off         (S, 8, 8) uint8: cm, deviation by which the map was off when the surface became long
                known; ``MOST_OFF``: more, or unknown, as in a map of a file
    free        (S,) int32: stack of unused slots
    scratch_of  (S,) int32: row of ``impression`` of a slot the present scan touches, else -1
    impression  (T, 8, 8) float32: I of the present scan
    faced       (T, 8, 8) uint8: the way the surface faces that makes the impression
    touched     (T, 4) int32: slot with an impression, block index (x, y), 1 if it was born for it
    counts      (2,) int64: unused slots, touched blocks
    """

    directory: Int32
    corner: Ints
    x: Float32
    y: Float32
    age: Float32
    facing: Bytes
    off: Bytes
    free: Int32
    scratch_of: Int32
    impression: Float32
    faced: Bytes
    touched: Int32
    counts: Ints


class Field(NamedTuple):
    """The arrays of ``Cells`` that overlaps need: all thirteen would be copied at every call."""

    directory: Int32
    corner: Ints
    x: Float32
    y: Float32
    facing: Bytes


class Look(NamedTuple):
    """What one scan says of the map in view, by sums over its cells.

    confirmed     trace that it confirms; ``contradicted``: that it sees through
    visited       cells that it says something of
    known         m of long-known surface that it confirms: a trace y that was looked at for ``age``
                  s counts w = y age / (age + known_s)
    through       the same that it sees through, by w c, c as of ``crossed``
    """

    confirmed: float
    contradicted: float
    visited: int
    known: float
    through: float


LEAST_M = 1e-6  # m; a shorter beam has no direction: numerical guard


@inner
def crossed(facing: int, x: float, y: float) -> float:
    """Cosine of the angle of incidence (1: head on) of a beam of direction (x, y), map axes; 1
    where the way a surface faces is unknown.

    A beam along a wall passes through metres of it where the pose is off by centimetres.
    """
    if facing == 0:
        return 1.0
    way = math.tau / FACES * (facing & (FACES - 1))
    return abs(x * math.cos(way) + y * math.sin(way)) / max(math.sqrt(x * x + y * y), LEAST_M)


@inner
def stamped(before: int, weight: float, sure: float, now: int) -> int:
    """``Cells.off`` of a cell that a scan confirms: that of when its weight became ``sure``.

    Or less, where it is seen again while the map is off by less.
    """
    return min(before, now) if weight >= sure else now


@inlined
def lasting(y: Any, age: Any, known_s: float) -> Any:
    """w of ``Look``: the long-known part of a trace."""
    return y * age / (age + known_s)


@inlined
def activity(cells: Cells | Field, short_term: float, slot: int, j: int, i: int) -> float:
    """v = y + (1 - y) short_term x of a cell of a block: what observations are matched to."""
    x, y = cells.x[slot, j, i], cells.y[slot, j, i]
    return float(y + (1.0 - y) * short_term * x)


@inlined
def slot_of(cells: Cells, i: int, j: int) -> int:
    """Of the block in which cell (i, j) lies; -1 where none lives."""
    row, column = (j >> SHIFT) - cells.corner[1], (i >> SHIFT) - cells.corner[0]
    rows, columns = cells.directory.shape
    if 0 <= row < rows and 0 <= column < columns:
        return int(cells.directory[row, column])
    return -1


@inner
def born(cells: Cells, row: int, column: int) -> int:
    """The slot of a block that begins to live at a place of the directory; -1: no room is left."""
    if cells.counts[FREE_COUNT] == 0:
        return -1
    cells.counts[FREE_COUNT] -= 1
    slot = cells.free[cells.counts[FREE_COUNT]]
    cells.directory[row, column] = slot
    cells.scratch_of[slot] = -1
    for j in range(SIDE):
        for i in range(SIDE):
            cells.x[slot, j, i] = cells.y[slot, j, i] = cells.age[slot, j, i] = 0.0
            cells.facing[slot, j, i] = cells.off[slot, j, i] = 0
    return int(slot)


@inner
def dies(cells: Cells, row: int, column: int) -> None:
    """The block at a place of the directory lives no more."""
    cells.free[cells.counts[FREE_COUNT]] = cells.directory[row, column]
    cells.counts[FREE_COUNT] += 1
    cells.directory[row, column] = -1


@inlined
def free_at(
    cells: Cells, view: View, laser: tuple[float, float, float, float], cell: float, row: int,
    column: int,
) -> float:  # fmt: skip
    """Longest free range, m, in the bins of a block: ``free_around``; -1 where it is hidden.

    ``laser``: its place in the map, and cosine and sine of its heading.
    """
    ox, oy, c, s = laser
    bx = (column + cells.corner[0] + 0.5) * SIDE * cell - ox
    by = (row + cells.corner[1] + 0.5) * SIDE * cell - oy
    dx, dy, half = c * bx + s * by, c * by - s * bx, 0.71 * SIDE * cell
    free = free_around(view, dx, dy, half)
    return free if free > math.sqrt(dx * dx + dy * dy) - half else -1.0


def no_cells(slots: int = FIRST, scratch: int = FIRST) -> Cells:
    """A plane on which nothing lives yet, with room for so many blocks and impressions."""
    shape, rows = (slots, SIDE, SIDE), (scratch, SIDE, SIDE)
    return Cells(
        directory=np.full((_FIRST_ACROSS, _FIRST_ACROSS), -1, np.int32),
        corner=np.array([-_FIRST_ACROSS // 2, -_FIRST_ACROSS // 2], np.int64),
        x=np.zeros(shape, np.float32),
        y=np.zeros(shape, np.float32),
        age=np.zeros(shape, np.float32),
        facing=np.zeros(shape, np.uint8),
        off=np.zeros(shape, np.uint8),
        free=np.arange(slots, dtype=np.int32)[::-1].copy(),
        scratch_of=np.full(slots, -1, np.int32),
        impression=np.zeros(rows, np.float32),
        faced=np.zeros(rows, np.uint8),
        touched=np.zeros((scratch, 4), np.int32),
        counts=np.array([slots, 0], np.int64),
    )


def used(cells: Cells) -> int:
    """Blocks that live."""
    return len(cells.free) - int(cells.counts[FREE_COUNT])


def with_room(old: Cells) -> Cells:
    """More of what ran out: slots in the pool, or scratch for impressions.

    The pool grows by a sixteenth, so that little of it is ever unused.
    """
    cells = old
    if old.counts[FREE_COUNT] == 0:
        slots = len(old.free)
        more = max(32, slots // 16)
        free = np.zeros(slots + more, np.int32)
        free[:more] = np.arange(slots + more - 1, slots - 1, -1)
        cells = cells._replace(
            x=_longer(old.x, more, 0),
            y=_longer(old.y, more, 0),
            age=_longer(old.age, more, 0),
            facing=_longer(old.facing, more, 0),
            off=_longer(old.off, more, 0),
            free=free,
            scratch_of=_longer(old.scratch_of, more, -1),
        )
        cells.counts[FREE_COUNT] = more
    if old.counts[TOUCHED_COUNT] == len(old.touched):
        more = len(old.touched) // 8
        cells = cells._replace(
            impression=_longer(old.impression, more, 0),
            faced=_longer(old.faced, more, 0),
            touched=_longer(old.touched, more, 0),
        )
    return cells


def _longer(array: NDArray[Any], more: int, fill: float) -> NDArray[Any]:
    longer = np.zeros((len(array) + more, *array.shape[1:]), array.dtype)
    longer[: len(array)] = array
    if fill:
        longer[len(array) :] = fill
    return longer


def living(cells: Cells) -> tuple[Int32, Ints]:
    """Slots (n,) of the living blocks and their block indices (n, 2: x, y), by rows."""
    rows, columns = np.nonzero(cells.directory >= 0)
    return cells.directory[rows, columns], np.stack([columns, rows], axis=1) + cells.corner


@inner
def in_reach(
    cells: Cells, view: View, T_map_laser: Float, size: float
) -> tuple[int, int, int, int]:
    """Directory rows and columns (first, past the last, each) of the blocks that are touched, or
    not hidden from the view: their centres are at most half a block beyond a free range, and that
    and two bins beside it.
    """
    half = 0.71 * size
    x0 = y0 = -2.0 * half
    x1 = y1 = 2.0 * half
    c, s = math.cos(T_map_laser[2]), math.sin(T_map_laser[2])
    cos_step, sin_step = math.cos(view.step), math.sin(view.step)
    for k in range(len(view.limit)):
        r = view.limit[k] + half
        x, y, aside = r * c, r * s, 1.1 * half + 2.5 * view.step * r
        x0, x1 = min(x0, x - aside), max(x1, x + aside)
        y0, y1 = min(y0, y - aside), max(y1, y + aside)
        c, s = c * cos_step - s * sin_step, s * cos_step + c * sin_step
    column0 = math.floor((T_map_laser[0] + x0) / size) - 1
    column1 = math.floor((T_map_laser[0] + x1) / size) + 2
    row0 = math.floor((T_map_laser[1] + y0) / size) - 1
    row1 = math.floor((T_map_laser[1] + y1) / size) + 2
    for k in range(cells.counts[TOUCHED_COUNT]):
        column0 = min(column0, cells.touched[k, 1])
        column1 = max(column1, cells.touched[k, 1] + 1)
        row0, row1 = min(row0, cells.touched[k, 2]), max(row1, cells.touched[k, 2] + 1)
    rows, columns = cells.directory.shape
    return (
        max(0, row0 - cells.corner[1]),
        min(rows, row1 - cells.corner[1]),
        max(0, column0 - cells.corner[0]),
        min(columns, column1 - cells.corner[0]),
    )


@inner
def released(cells: Cells) -> None:
    """Release the scratch of the present impressions; blocks that never came to life die."""
    for k in range(cells.counts[TOUCHED_COUNT]):
        slot, born = cells.touched[k, 0], cells.touched[k, 3]
        cells.scratch_of[slot] = -1
        row, column = cells.touched[k, 2] - cells.corner[1], cells.touched[k, 1] - cells.corner[0]
        if born == 0 or cells.directory[row, column] != slot:
            continue  # what died in the update is free already
        alive = False
        for j in range(SIDE):
            for i in range(SIDE):
                alive |= cells.x[slot, j, i] != 0.0 or cells.age[slot, j, i] != 0.0
        if not alive:
            dies(cells, row, column)
    cells.counts[TOUCHED_COUNT] = 0
