# SPDX-License-Identifier: Apache-2.0
"""The shunting network, Eq. (8): an unbounded plane of neurons, stored where they are alive.

Neurons lie on a square lattice; neuron (i, j) is centred at ((i + 0.5) cell, (j + 0.5) cell). They
are pooled in blocks of 8 x 8; a directory maps a block's place to its slot in the pool. Blocks are
born under an observation and die when every neuron in them is silent.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.errors import InvalidValueError
from slam.shunting.config import ShuntingConfig
from slam.shunting.visibility import View

SIDE = 8  # neurons along a block's edge
SHIFT, MASK = 3, 7  # i >> SHIFT is the block of neuron i, i & MASK its place inside
MAX_BLOCKS_ACROSS = 1 << 15  # directory edge; 7.8 km at 3 cm neurons

FREE_COUNT, TOUCHED_COUNT = 0, 1  # places in ``Cells.counts``


class Cells(NamedTuple):
    """The arrays of the network, as the kernels see them. S slots, T touched blocks.

    directory   (rows, columns) int32: slot of a block, -1 where none lives
    corner      (2,) int64: block index (x, y) of directory[0, 0]
    x           (S, 8, 8) float32: short-term activity, Eq. (8), in [0, 1); indexed [slot, row, col]
    y           (S, 8, 8) float32: long-term trace, the running mean of the input
    age         (S, 8, 8) float32: s of looking that ``y`` averages over
    free        (S,) int32: stack of unused slots
    scratch_of  (S,) int32: row of ``impression`` of a slot the present scan touches, else -1
    impression  (T, 8, 8) float32: I of the present scan
    touched     (T,) int32: slots with an impression
    counts      (2,) int64: unused slots, touched blocks
    """

    directory: NDArray[np.int32]
    corner: NDArray[np.int64]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    age: NDArray[np.float32]
    free: NDArray[np.int32]
    scratch_of: NDArray[np.int32]
    impression: NDArray[np.float32]
    touched: NDArray[np.int32]
    counts: NDArray[np.int64]


class Law(NamedTuple):
    """The constants of one update.

    step        h, s: how long the present input acts on x
    look        s: what this look adds to a trace's age
    pace        s: prior age of a trace, so that its first looks do not count fully
    oldest      s: age at which a trace stops growing stiffer
    decay       A, 1/s
    threshold   sigma
    mu          w = mu / d
    reach       r0, cells
    trace       whether a long-term trace is kept
    """

    step: float
    look: float
    pace: float
    oldest: float
    decay: float
    threshold: float
    mu: float
    reach: float
    trace: bool


def lateral_mu(total: float, reach: float) -> float:
    """mu such that the weights mu / d over 0 < d < reach sum to ``total``."""
    inverse_distances = 0.0
    edge = math.ceil(reach)
    for dj in range(-edge, edge + 1):
        for di in range(-edge, edge + 1):
            d = math.sqrt(di * di + dj * dj)
            if 0.0 < d < reach:
                inverse_distances += 1.0 / d
    return total / inverse_distances if inverse_distances else 0.0


@njit
def _activity(cells: Cells, i: int, j: int) -> float:
    """x of neuron (i, j); 0 where no block lives."""
    row, column = (j >> SHIFT) - cells.corner[1], (i >> SHIFT) - cells.corner[0]
    rows, columns = cells.directory.shape
    if row < 0 or column < 0 or row >= rows or column >= columns:
        return 0.0
    slot = cells.directory[row, column]
    if slot < 0:
        return 0.0
    return float(cells.x[slot, j & MASK, i & MASK])


@njit
def lateral(cells: Cells, law: Law, i: int, j: int) -> float:
    """Sum of w_ij d(x_j) over the neighbours of neuron (i, j), d(x) = max(x - sigma, 0)."""
    edge = math.ceil(law.reach)
    total = 0.0
    for dj in range(-edge, edge + 1):
        for di in range(-edge, edge + 1):
            d = math.sqrt(di * di + dj * dj)
            if 0.0 < d < law.reach:
                above = _activity(cells, i + di, j + dj) - law.threshold
                if above > 0.0:
                    total += law.mu / d * above
    return total


@njit
def seen_empty(view: View, dx: float, dy: float) -> bool:
    """True where a beam passed by (dx, dy) (m, from the laser, laser axes) without stopping."""
    r = math.sqrt(dx * dx + dy * dy)
    if r >= view.farthest - view.margin:
        return False
    bins = len(view.limit)
    turns = math.atan2(dy, dx) / view.step
    k = math.floor(turns + 0.5)
    if r >= view.limit[k % bins] - view.margin:
        return False
    nearest = math.inf
    for m in (k - 1, k, k + 1):
        nearest = min(nearest, abs(turns - m - view.offset[m % bins]))
    return nearest * view.step * r <= view.gate


@njit
def block_is_hidden(view: View, dx: float, dy: float, half: float) -> bool:
    """True when no neuron within ``half`` m of (dx, dy) can be in view."""
    r = math.sqrt(dx * dx + dy * dy)
    if r - half >= view.farthest:
        return True
    if r <= 2.0 * half:
        return False
    bins = len(view.limit)
    k = math.floor(math.atan2(dy, dx) / view.step + 0.5)
    spread = int(half / r / view.step * 1.1) + 2
    if 2 * spread + 1 >= bins:
        return False
    highest = 0.0
    for m in range(k - spread, k + spread + 1):
        highest = max(highest, view.limit[m % bins])
    return highest <= r - half


@njit
def integrate(
    cells: Cells, view: View, T_map_laser: NDArray[np.float64], cell: float, law: Law, write: bool
) -> tuple[float, float, int]:
    """One semi-implicit Gauss-Seidel sweep of Eq. (8) over the neurons in view.

    Returns the long-term trace confirmed by the present scan, that contradicted by it (its sums
    over neurons) and the number of neurons visited. ``write`` False only looks. Impressions are
    consumed (their scratch is released) when written.
    """
    confirmed, contradicted, visited = 0.0, 0.0, 0
    ox, oy = T_map_laser[0], T_map_laser[1]
    c, s = math.cos(T_map_laser[2]), math.sin(T_map_laser[2])
    size = SIDE * cell
    half = 0.71 * size
    rows, columns = cells.directory.shape
    first_row = max(0, math.floor((oy - view.farthest) / size) - cells.corner[1] - 1)
    last_row = min(rows, math.floor((oy + view.farthest) / size) - cells.corner[1] + 2)
    first_column = max(0, math.floor((ox - view.farthest) / size) - cells.corner[0] - 1)
    last_column = min(columns, math.floor((ox + view.farthest) / size) - cells.corner[0] + 2)
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            slot = cells.directory[row, column]
            if slot < 0:
                continue
            scratch = cells.scratch_of[slot]
            i0, j0 = (column + cells.corner[0]) * SIDE, (row + cells.corner[1]) * SIDE
            bx, by = (i0 + 0.5 * SIDE) * cell - ox, (j0 + 0.5 * SIDE) * cell - oy
            if scratch < 0 and block_is_hidden(view, c * bx + s * by, c * by - s * bx, half):
                continue
            alive = False
            for jj in range(SIDE):
                for ii in range(SIDE):
                    x, y = cells.x[slot, jj, ii], cells.y[slot, jj, ii]
                    given = cells.impression[scratch, jj, ii] if scratch >= 0 else np.float32(0.0)
                    if x == 0.0 and y == 0.0 and given == 0.0:
                        continue
                    if given == 0.0:
                        px = (i0 + ii + 0.5) * cell - ox
                        py = (j0 + jj + 0.5) * cell - oy
                        if not seen_empty(view, c * px + s * py, c * py - s * px):
                            alive = True
                            continue
                        contradicted += y
                    else:
                        confirmed += y * given
                    visited += 1
                    if not write:
                        continue
                    # Eq. (8), implicit in x: stays in [0, 1) for any step
                    E = float(given)
                    if law.mu > 0.0:
                        E += lateral(cells, law, i0 + ii, j0 + jj)
                    x = np.float32((x + law.step * E) / (1.0 + law.step * (law.decay + E)))
                    # Silent is what is small and does not rise: at 37.5 Hz one step is tiny.
                    if x < law.threshold and law.threshold * (law.decay + E) > E:
                        x = np.float32(0.0)
                    cells.x[slot, jj, ii] = x
                    if law.trace:
                        age = cells.age[slot, jj, ii]
                        y = np.float32(y + (given - y) * law.look / (age + law.look + law.pace))
                        age = np.float32(min(age + law.look, law.oldest))
                        if y < 0.004 and given < 0.01:
                            y, age = np.float32(0.0), np.float32(0.0)
                        cells.y[slot, jj, ii] = y
                        cells.age[slot, jj, ii] = age
                    if x > 0.0 or y > 0.0:
                        alive = True
            if write and not alive:
                cells.directory[row, column] = -1
                cells.free[cells.counts[FREE_COUNT]] = slot
                cells.counts[FREE_COUNT] += 1
    return confirmed, contradicted, visited


@njit
def _window(
    cells: Cells, i0: int, j0: int, out_x: NDArray[np.float32], out_y: NDArray[np.float32]
) -> None:
    """Copy activities of neurons (i0 + column, j0 + row) into the dense arrays."""
    rows, columns = cells.directory.shape
    for a in range(out_x.shape[0]):
        for b in range(out_x.shape[1]):
            i, j = i0 + b, j0 + a
            row, column = (j >> SHIFT) - cells.corner[1], (i >> SHIFT) - cells.corner[0]
            if 0 <= row < rows and 0 <= column < columns:
                slot = cells.directory[row, column]
                if slot >= 0:
                    out_x[a, b] = cells.x[slot, j & MASK, i & MASK]
                    out_y[a, b] = cells.y[slot, j & MASK, i & MASK]


class Network:
    """Holds the arrays and keeps them large enough."""

    def __init__(self, config: ShuntingConfig) -> None:
        self.config = config
        self.cell = config.cell_m
        self.mu = lateral_mu(config.lateral_sum, config.lateral_reach_cells)
        slots, scratch = 256, 256
        shape = (slots, SIDE, SIDE)
        self.cells = Cells(
            directory=np.full((64, 64), -1, np.int32),
            corner=np.array([-32, -32], np.int64),
            x=np.zeros(shape, np.float32),
            y=np.zeros(shape, np.float32),
            age=np.zeros(shape, np.float32),
            free=np.arange(slots, dtype=np.int32)[::-1].copy(),
            scratch_of=np.full(slots, -1, np.int32),
            impression=np.zeros((scratch, SIDE, SIDE), np.float32),
            touched=np.zeros(scratch, np.int32),
            counts=np.array([slots, 0], np.int64),
        )

    def law(self, step: float) -> Law:
        """Constants of an update whose input acts for ``step`` s (the time since the last scan)."""
        pace = max(self.config.trace_s, 5.0 * step)
        return Law(
            step=step,
            look=step,
            pace=pace,
            oldest=13.0 * pace,
            decay=self.config.decay_per_s,
            threshold=self.config.threshold,
            mu=self.mu,
            reach=self.config.lateral_reach_cells,
            trace=self.config.trace_s > 0.0,
        )

    def cover(self, xmin: float, ymin: float, xmax: float, ymax: float) -> None:
        """Grow the directory so that blocks may be born anywhere in the rectangle (m)."""
        size = SIDE * self.cell
        rows, columns = self.cells.directory.shape
        cx, cy = (int(v) for v in self.cells.corner)
        low = (min(cx, math.floor(xmin / size) - 1), min(cy, math.floor(ymin / size) - 1))
        high = (
            max(cx + columns, math.floor(xmax / size) + 2),
            max(cy + rows, math.floor(ymax / size) + 2),
        )
        if low == (cx, cy) and high == (cx + columns, cy + rows):
            return
        # Grow by half of the present extent on the side that asks, so that growing stays rare.
        low = (
            low[0] - columns // 2 if low[0] < cx else cx,
            low[1] - rows // 2 if low[1] < cy else cy,
        )
        high = (
            high[0] + columns // 2 if high[0] > cx + columns else cx + columns,
            high[1] + rows // 2 if high[1] > cy + rows else cy + rows,
        )
        if max(high[0] - low[0], high[1] - low[1]) > MAX_BLOCKS_ACROSS:
            raise InvalidValueError(
                f"the map would be more than {MAX_BLOCKS_ACROSS * size:.0f} m across; "
                f"cell_m = {self.cell} is too small for this stream, or its poses jump"
            )
        grown = np.full((high[1] - low[1], high[0] - low[0]), -1, np.int32)
        grown[cy - low[1] : cy - low[1] + rows, cx - low[0] : cx - low[0] + columns] = (
            self.cells.directory
        )
        self.cells = self.cells._replace(directory=grown, corner=np.array(low, np.int64))

    def grow(self) -> None:
        """Double what ran out: the pool of slots, or the scratch for impressions."""
        old = self.cells
        slots, unused = len(old.free), int(old.counts[FREE_COUNT])
        if unused == 0:
            free = np.zeros(2 * slots, np.int32)
            free[:slots] = np.arange(2 * slots - 1, slots - 1, -1)
            self.cells = self.cells._replace(
                x=_doubled(old.x, 0),
                y=_doubled(old.y, 0),
                age=_doubled(old.age, 0),
                free=free,
                scratch_of=_doubled(old.scratch_of, -1),
            )
            self.cells.counts[FREE_COUNT] = slots
        if int(old.counts[TOUCHED_COUNT]) == len(old.touched):
            self.cells = self.cells._replace(
                impression=_doubled(old.impression, 0), touched=_doubled(old.touched, 0)
            )

    def release(self) -> None:
        """Forget the present impressions."""
        count = int(self.cells.counts[TOUCHED_COUNT])
        self.cells.scratch_of[self.cells.touched[:count]] = -1
        self.cells.counts[TOUCHED_COUNT] = 0

    def prune(self) -> None:
        """Let blocks die that were born under impressions which were then forgotten."""
        cells = self.cells
        rows, columns = np.nonzero(cells.directory >= 0)
        slots = cells.directory[rows, columns]
        silent = ~(cells.x[slots] != 0.0).any(axis=(1, 2))
        silent &= ~(cells.age[slots] != 0.0).any(axis=(1, 2))
        count, unused = int(silent.sum()), int(cells.counts[FREE_COUNT])
        cells.directory[rows[silent], columns[silent]] = -1
        cells.free[unused : unused + count] = slots[silent]
        cells.counts[FREE_COUNT] = unused + count

    def integrate(
        self, view: View, T_map_laser: NDArray[np.float64], step: float, *, write: bool
    ) -> tuple[float, float, int]:
        """Take the present impressions in for ``step`` s; see the kernel of the same name."""
        result = integrate(self.cells, view, T_map_laser, self.cell, self.law(step), write)
        if write:
            self.release()
        return result

    def window(
        self, xmin: float, ymin: float, xmax: float, ymax: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Dense short-term x and long-term y of the neurons whose centres lie in the rectangle (m).

        Row 0 is the lowest y. Both are 0 where nothing lives.
        """
        slack = 1e-6  # cells: an edge on a centre counts as reaching it
        i0 = math.ceil(xmin / self.cell - 0.5 - slack)
        j0 = math.ceil(ymin / self.cell - 0.5 - slack)
        shape = (
            max(0, math.floor(ymax / self.cell - 0.5 + slack) - j0 + 1),
            max(0, math.floor(xmax / self.cell - 0.5 + slack) - i0 + 1),
        )
        x, y = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        _window(self.cells, i0, j0, x, y)
        return x, y

    def extent(self) -> tuple[int, int, int, int] | None:
        """First and past-the-last neuron index (i0, j0, i1, j1) of the living blocks."""
        rows, columns = np.nonzero(self.cells.directory >= 0)
        if rows.size == 0:
            return None
        cx, cy = (int(v) for v in self.cells.corner)
        return (
            (int(columns.min()) + cx) * SIDE,
            (int(rows.min()) + cy) * SIDE,
            (int(columns.max()) + cx + 1) * SIDE,
            (int(rows.max()) + cy + 1) * SIDE,
        )


def _doubled(array: NDArray[Any], fill: float) -> NDArray[Any]:
    return np.concatenate([array, np.full_like(array, fill)])
