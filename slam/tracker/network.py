# SPDX-License-Identifier: Apache-2.0
"""The shunting network, Eq. (8): a map whose cells are neurons, and a running mean of their input.

The short-term mean is the activity x of Eq. (8), which leaks; the long-term one is no part of it.
It is the map of "shunting"; the loops of "occupancy" draw their key frames in one, too. Blocks of
neurons are born under an observation and die when every neuron in them is silent.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from slam._jit import inner, uncounted
from slam.arrays import Float
from slam.frontend.surfaces import opposite
from slam.frontend.visibility import View, seen_empty
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import (
    MASK,
    SIDE,
    Cells,
    Look,
    crossed,
    dies,
    free_at,
    in_reach,
    lasting,
    released,
    slot_of,
    stamped,
)  # fmt: skip
from slam.tracker.config import TrackerConfig

SURE = 0.35  # share: w (``cells.Look``) from which on a cell is long known; by hand


class Law(NamedTuple):
    """The constants of one update.

    step        h, s: how long the present input acts on x, and what it adds to a trace's age
    pace        s: prior age of a trace, so that its first looks do not count fully
    oldest      s: age at which a trace stops growing stiffer
    decay       A, 1/s
    threshold   sigma
    mu          w = mu / d; 0: no lateral weights
    reach       r0, cells
    trace       whether a long-term trace is kept
    faded       a trace below ends where the input is below ``unseen``
    known_s     s of looking after which half of a trace counts as long known
    off         cm, ``Cells.off`` of what becomes long known now
    """

    step: float
    pace: float
    oldest: float
    decay: float
    threshold: float
    mu: float
    reach: float
    trace: bool
    faded: float
    unseen: float
    known_s: float
    off: int


@inner
def lateral(cells: Cells, law: Law, i: int, j: int) -> float:
    """Sum of w_ij d(x_j) over the neighbours of neuron (i, j), d(x) = max(x - sigma, 0)."""
    edge = math.ceil(law.reach)
    total = 0.0
    for b in range(j - edge, j + edge + 1):
        for a in range(i - edge, i + edge + 1):
            d = math.sqrt((a - i) * (a - i) + (b - j) * (b - j))
            if 0.0 < d < law.reach:
                slot = slot_of(cells, a, b)
                above = cells.x[slot, b & MASK, a & MASK] - law.threshold if slot >= 0 else 0.0
                if above > 0.0:
                    total += law.mu / d * above
    return total


@uncounted
def integrate(  # noqa: C901, PLR0912, PLR0915 (kernel)
    arrays: tuple[Any, ...],
    plain_view: tuple[Any, ...],
    T_map_laser: Float,
    cell: float,
    numbers: tuple[Any, ...],
    write: bool,
) -> Look:
    """One semi-implicit Gauss-Seidel sweep of Eq. (8) over the neurons in view.

    ``write`` False only looks. Impressions are consumed (their scratch is released) when written.
    ``arrays`` of ``Cells``, ``View`` and the ``numbers`` of a
    ``Law`` as plain tuples: those get here sooner.
    """
    cells, view, law = Cells(*arrays), View(*plain_view), Law(*numbers)
    confirmed, contradicted, visited = 0.0, 0.0, 0
    known, through = 0.0, 0.0
    ox, oy = T_map_laser[0], T_map_laser[1]
    c, s = math.cos(T_map_laser[2]), math.sin(T_map_laser[2])
    first_row, last_row, first_column, last_column = in_reach(cells, view, T_map_laser, SIDE * cell)
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            slot = cells.directory[row, column]
            if slot < 0:
                continue
            scratch = cells.scratch_of[slot]
            free = free_at(cells, view, (ox, oy, c, s), cell, row, column)
            if scratch < 0 and free < 0.0:
                continue
            i0, j0 = (column + cells.corner[0]) * SIDE, (row + cells.corner[1]) * SIDE
            alive = False
            for jj in range(SIDE):
                for ii in range(SIDE):
                    x, y = cells.x[slot, jj, ii], cells.y[slot, jj, ii]
                    given = cells.impression[scratch, jj, ii] if scratch >= 0 else np.float32(0.0)
                    if x == 0.0 and y == 0.0 and given == 0.0:
                        continue
                    age, facing = cells.age[slot, jj, ii], cells.facing[slot, jj, ii]
                    faced = cells.faced[scratch, jj, ii] if scratch >= 0 else 0
                    behind = given > 0.0 and opposite(int(faced), facing)
                    if behind and given <= y:  # the back of a known surface is hidden
                        alive = True
                        continue
                    if given == 0.0:
                        px = (i0 + ii + 0.5) * cell - ox
                        py = (j0 + jj + 0.5) * cell - oy
                        if not seen_empty(view, c * px + s * py, c * py - s * px, free):
                            alive = True
                            continue
                        contradicted += y
                        through += lasting(y, age, law.known_s) * crossed(facing, px, py)
                    elif not behind:
                        confirmed += y * given
                        weight = lasting(y, age, law.known_s)
                        known += weight * given
                        if write:
                            before = cells.off[slot, jj, ii]
                            cells.off[slot, jj, ii] = stamped(before, weight, SURE, law.off)
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
                        y = np.float32(y + (given - y) * law.step / (age + law.step + law.pace))
                        age = np.float32(min(age + law.step, law.oldest))
                        if y < law.faded and given < law.unseen:
                            y, age = np.float32(0.0), np.float32(0.0)
                        cells.y[slot, jj, ii] = y
                        cells.age[slot, jj, ii] = age
                        if faced != 0 or y == 0.0:
                            cells.facing[slot, jj, ii] = faced
                    if x > 0.0 or y > 0.0:
                        alive = True
            if write and not alive:
                dies(cells, row, column)
    if write:
        released(cells)
    return Look(confirmed, contradicted, visited, known * cell, through * cell)


class Network(CellMap):
    """The plane of neurons; the loops of the occupancy grid draw key frames in one without weights.

    mu  scale of the lateral weights w = mu / d of Eq. (8); 0: none
    """

    def __init__(self, config: TrackerConfig, *, lateral: bool = True) -> None:
        super().__init__(config)
        reach = config.lateral_reach_cells
        self.mu = lateral_mu(config.lateral_sum, reach) if lateral else 0.0

    def integrate(self, view: View, T_map_laser: Float, step: float, *, write: bool) -> Look:
        """Take the present impressions in for ``step`` s; see the kernel of the same name."""
        config, numbers, pace = self.config, self.config.map, self.pace(step)
        law = Law(
            step=step,
            pace=pace,
            oldest=numbers.oldest_paces * pace,
            decay=config.decay_per_s,
            threshold=config.threshold,
            mu=self.mu,
            reach=config.lateral_reach_cells,
            trace=config.trace_s > 0.0,
            faded=numbers.faded,
            unseen=numbers.unseen,
            known_s=numbers.known_s,
            off=self.off_cm,
        )
        arrays = tuple(self.cells)
        return integrate(arrays, tuple(view), T_map_laser, self.cell, tuple(law), write)


def lateral_mu(total: float, reach: float) -> float:
    """mu such that the weights mu / d over 0 < d < reach sum to ``total``."""
    edge = math.ceil(reach)
    inverse_distances = 0.0
    for dj in range(-edge, edge + 1):
        for di in range(-edge, edge + 1):
            d = math.sqrt(di * di + dj * dj)
            if 0.0 < d < reach:
                inverse_distances += 1.0 / d
    return total / inverse_distances if inverse_distances else 0.0
