# SPDX-License-Identifier: Apache-2.0
"""Multi-resolution search for the pose in a wide window (section 3.4), by branch and bound.

A field of smoothed activities in small integers is built once; its sliding maxima over 8 x 8 cells
bound the overlap of whole blocks of offsets from above. The prior enters a bound with what
its heading alone costs, so no bound is ever too low and the result equals exhaustive search.
"""

import functools
import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from slam._jit import njit, uncounted
from slam.arrays import Bytes, Float, Int32
from slam.frontend.observations import Observations
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import MASK, SHIFT, SIDE, Cells, activity, slot_of
from slam.tracker.matching.branch_and_bound import SPAN, Lattice, best_of, look_ahead
from slam.tracker.matching.config import GlobalConfig, LocalConfig

KEPT = 1 << 23  # bytes of a field that are kept for the next one
FULL = 255.0  # integer that stands for the field's value 1


@dataclass(frozen=True, kw_only=True)
class SearchWindow:
    """Half widths about the prediction: ``reach_m`` along x and y, ``turn_rad`` in heading."""

    reach_m: float
    turn_rad: float

    @classmethod
    def about(cls, prior: Float, config: LocalConfig) -> "SearchWindow":
        """Some standard deviations of a (3, 3) prior, within the widest."""
        reach_m = config.sigmas * math.sqrt(max(prior[0, 0], prior[1, 1]))
        turn_rad = config.sigmas * math.sqrt(prior[2, 2])
        return cls(
            reach_m=min(max(reach_m, config.least_m), config.reach_m),
            turn_rad=min(max(turn_rad, config.least_rad), config.turn_rad),
        )

    @classmethod
    def widest(cls, config: LocalConfig) -> "SearchWindow":
        """As far as is ever searched around a prediction."""
        return cls(reach_m=config.reach_m, turn_rad=config.turn_rad)


@uncounted
def _field(  # noqa: C901, PLR0912, PLR0913 (kernel)
    cells: Cells, short_term: float, i0: int, j0: int, kernel: Float, out: Bytes, room: Float
) -> None:
    """Activities smoothed by the (5,) kernel along both axes, in ``out[j - j0, i - i0]``.

    (i0, j0) is the corner of a block, ``out`` a whole number of blocks. Zero where no block lives.
    ``room`` (2, 12, 12): to work in.
    """
    padded, smooth = room[0], room[1]
    for block_row in range(out.shape[0] >> SHIFT):
        for block_column in range(out.shape[1] >> SHIFT):
            left, low = i0 + block_column * SIDE, j0 + block_row * SIDE
            if slot_of(cells, left, low) < 0:
                continue
            for a in range(SIDE + 4):
                for beside in (-1, 0, 1):  # a block: two of its columns, all, two
                    first, last = max(beside * SIDE + 2, 0), min(beside * SIDE + 2, 4) + SIDE
                    slot = slot_of(cells, left + beside * SIDE, low + a - 2)
                    for b in range(first, last):
                        padded[a, b] = 0.0
                        if slot >= 0:
                            j, i = (a - 2) & MASK, (b - 2) & MASK
                            padded[a, b] = activity(cells, short_term, slot, j, i)
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
def place(  # noqa: PLR0913 (kernel)
    points: Float, prediction: Float, turns: Float, cell: float, i0: int, j0: int, out: Int32
) -> None:
    """Column and row of each point at each heading, for the predicted position."""
    for h in range(len(turns)):
        c, s = math.cos(prediction[2] + turns[h]), math.sin(prediction[2] + turns[h])
        for k in range(len(points)):
            x = c * points[k, 0] - s * points[k, 1] + prediction[0]
            y = s * points[k, 0] + c * points[k, 1] + prediction[1]
            out[h, k, 0] = math.floor(x / cell) - i0
            out[h, k, 1] = math.floor(y / cell) - j0


@functools.cache
def _kernel(sigma: float) -> Float:
    """Gaussian taps such that a lone landmark's field is 1 at its centre."""
    taps = np.array([math.exp(-0.5 * (m / sigma) ** 2) for m in (-2, -1, 0, 1, 2)])
    return taps / math.sqrt(math.pi * sigma**2)


def field_of(cell_map: CellMap, short_term: float, i0: int, j0: int, field: Bytes) -> Bytes:
    """``field``, which is all 0, filled with smoothed activities from cell (i0, j0) on, which
    begins a block."""
    sigma = cell_map.config.frontend.sigma_cells
    room = np.empty((2, SIDE + 4, SIDE + 4))
    _field(cell_map.cells, short_term, i0, j0, _kernel(sigma), field, room)
    return field


class Around:
    """The map around a robot as one search after another wants it, while nothing is written."""

    def __init__(self, short_term: float) -> None:
        self._short_term = short_term
        self._room = np.empty(0, np.uint8)  # used again: new pages take longer than the search

    def of(self, cell_map: CellMap) -> Self:
        """Of this map, as it is now."""
        self._cell_map = cell_map
        self._low, self._high = np.zeros(2, np.int64), np.zeros(2, np.int64)
        return self

    def fields(self, low: Int32, high: Int32) -> tuple[Int32, Bytes]:
        """Corner of a field that holds the cells from ``low`` to ``high`` (column, row); the field
        and its maxima ahead (2, rows, columns)."""
        if (low < self._low).any() or (high >= self._high).any():
            first = low >> SHIFT
            blocks = (high >> SHIFT) + 1 - first
            self._low, self._high = first * SIDE, (first + blocks) * SIDE
            (i0, j0), (columns, rows) = self._low.tolist(), (blocks * SIDE).tolist()
            room = self._room
            if len(room) < 2 * rows * columns:
                room = np.empty(2 * rows * columns, np.uint8)
                self._room = room if len(room) <= KEPT else self._room
            self._fields = room[: 2 * rows * columns].reshape(2, rows, columns)
            self._fields[:] = 0
            field_of(self._cell_map, self._short_term, i0, j0, self._fields[0])
            look_ahead(*self._fields)
        return self._low.astype(np.int32), self._fields


def heading_step(
    points: Float, step_m: float, least_m: float, config: LocalConfig | GlobalConfig
) -> float:
    """Rad between two headings, with which a far point moves by ``step_m``.

    Far: farther than three quarters of them, and ``least_m``.
    """
    distances = np.sort(np.sqrt((points * points).sum(axis=1)))
    far = float(distances[(3 * len(distances)) // 4])
    return min(max(step_m / max(far, least_m), config.finest_rad), config.coarsest_rad)


def search(  # noqa: PLR0913 (arrays of one problem)
    cell_map: CellMap,
    around: Around,
    observations: Observations,
    prediction: Float,
    precision: Float,
    window: SearchWindow,
    gain: float,
) -> tuple[Float, int]:
    """Best pose on the lattice of the window, and how many candidates were scored.

    ``around``: what searches of the same frame laid out before.
    """
    cell, config = cell_map.cell, cell_map.config.matching.local
    points = observations.points_robot
    if len(points) == 0:
        return prediction, 0
    every = math.ceil(len(points) / config.points)
    chosen = np.ascontiguousarray(points[::every])
    step = heading_step(chosen, config.heading_cells * cell, cell, config)
    half = math.ceil(window.turn_rad / step)
    turns = np.arange(-half, half + 1, dtype=np.float64) * step
    reach = math.ceil(window.reach_m / cell)
    bases = np.empty((len(turns), len(chosen), 2), np.int32)
    place(chosen, prediction, turns, cell, 0, 0, bases)
    edge = reach + SPAN + 2  # offsets may overshoot by a block
    columns, rows = bases[..., 0], bases[..., 1]  # one by one: a sixth of the time
    low = np.array([columns.min(), rows.min()]) - edge
    high = np.array([columns.max(), rows.max()]) + edge
    corner, (field, ahead) = around.fields(low, high)
    bases -= corner
    scale = gain * float(observations.shares.mean()) * len(points) / len(chosen) / FULL
    lattice = Lattice(
        field=field,
        ahead=ahead,
        bases=bases,
        turns=turns,
        reach=reach,
        pitch=cell,
        precision=precision,
        gain=scale,
    )
    found = best_of(lattice)
    offset = np.array([found.column * cell, found.row * cell, turns[found.heading]])
    return prediction + offset, found.evaluations
