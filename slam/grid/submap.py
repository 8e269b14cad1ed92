# SPDX-License-Identifier: Apache-2.0
"""What a few key frames saw, for the loops of an occupancy grid: means of what hit each cell.

Log-odds of the few looks at a key frame's surroundings say little. A short-term mean x that leaks,
and a running mean y of the same input, hold more of it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.frontend.surfaces import opposite
from slam.frontend.visibility import View, block_is_hidden, seen_empty
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import FREE_COUNT, SIDE, Cells, in_reach


class Means(NamedTuple):
    """The constants of one update.

    step, look  s that the present input acts on x, and adds to the age of y
    pace        s: prior age of y, so that its first looks do not count fully
    oldest      s: age at which y stops growing stiffer
    decay       1/s, of x; below ``threshold`` it ends
    trace       whether y is kept
    faded       a y below ends where the input is below ``unseen``
    """

    step: float
    look: float
    pace: float
    oldest: float
    decay: float
    threshold: float
    trace: bool
    faded: float
    unseen: float


@njit
def average(  # noqa: C901, PLR0912, PLR0915 (kernel)
    cells: Cells, view: View, T_map_laser: NDArray[np.float64], cell: float, law: Means, write: bool
) -> tuple[float, float, int]:
    """Take the present impressions into both means of every cell in view.

    Returns confirmed and contradicted y and the cells visited, as ``CellMap.integrate``.
    """
    confirmed, contradicted, visited = 0.0, 0.0, 0
    ox, oy = T_map_laser[0], T_map_laser[1]
    c, s = math.cos(T_map_laser[2]), math.sin(T_map_laser[2])
    size = SIDE * cell
    half = 0.71 * size
    first_row, last_row, first_column, last_column = in_reach(cells, view, ox, oy, size)
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
                    faced = cells.faced[scratch, jj, ii] if scratch >= 0 else 0
                    behind = given > 0.0 and opposite(int(faced), cells.facing[slot, jj, ii])
                    if behind and given <= y:  # the back of a known surface is hidden
                        alive = True
                        continue
                    if given == 0.0:
                        px = (i0 + ii + 0.5) * cell - ox
                        py = (j0 + jj + 0.5) * cell - oy
                        if not seen_empty(view, c * px + s * py, c * py - s * px):
                            alive = True
                            continue
                        contradicted += y
                    elif not behind:
                        confirmed += y * given
                    visited += 1
                    if not write:
                        continue
                    E = float(given)  # implicit in x: stays in [0, 1) for any step
                    x = np.float32((x + law.step * E) / (1.0 + law.step * (law.decay + E)))
                    # Silent is what is small and does not rise: at 37.5 Hz one step is tiny.
                    if x < law.threshold and law.threshold * (law.decay + E) > E:
                        x = np.float32(0.0)
                    cells.x[slot, jj, ii] = x
                    if law.trace:
                        age = cells.age[slot, jj, ii]
                        y = np.float32(y + (given - y) * law.look / (age + law.look + law.pace))
                        age = np.float32(min(age + law.look, law.oldest))
                        if y < law.faded and given < law.unseen:
                            y, age = np.float32(0.0), np.float32(0.0)
                        cells.y[slot, jj, ii] = y
                        cells.age[slot, jj, ii] = age
                        if faced != 0 or y == 0.0:
                            cells.facing[slot, jj, ii] = faced
                    if x > 0.0 or y > 0.0:
                        alive = True
            if write and not alive:
                cells.directory[row, column] = -1
                cells.free[cells.counts[FREE_COUNT]] = slot
                cells.counts[FREE_COUNT] += 1
    return confirmed, contradicted, visited


class Submap(CellMap):
    """Cells with both means."""

    def integrate(
        self, view: View, T_map_laser: NDArray[np.float64], step: float, *, write: bool
    ) -> tuple[float, float, int]:
        """As ``CellMap.integrate``."""
        numbers, pace = self.config.map, self.pace(step)
        law = Means(
            step=step,
            look=step,
            pace=pace,
            oldest=numbers.oldest_paces * pace,
            decay=self.config.decay_per_s,
            threshold=self.config.threshold,
            trace=self.config.trace_s > 0.0,
            faded=numbers.faded,
            unseen=numbers.unseen,
        )
        result = average(self.cells, view, T_map_laser, self.cell, law, write)
        if write:
            self.release()
        return result
