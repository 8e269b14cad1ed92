# SPDX-License-Identifier: Apache-2.0
"""An ordinary occupancy grid (log-odds) in the place of the network, everything else the same.

It is there to compare with: what differs between "occupancy" and "shunting" on the same frames is
the neural map alone, as matcher, prior, search and recovery are shared.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from slam._jit import njit, uncounted
from slam.arrays import Float, Float32, Int32
from slam.estimate import Raster
from slam.frontend.visibility import View, seen_empty
from slam.settings import Settings, number
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import SIDE, Cells, Look, born, free_at, in_reach, lasting, stamped
from slam.tracker.config import TrackerConfig
from slam.tracker.network import Network
from slam.tracker.standing.config import FULL_WEIGHT, StandingConfig
from slam.tracker.tracker import Tracker

OCTOMAP = "Hornung et al. 2013"
SURE = 0.65  # share: w of a cell from which on it is long known; by hand


@dataclass(frozen=True, kw_only=True)
class GridConfig(Settings):
    """The inverse sensor model, log-odds per scan."""

    hit: float = number(0.85, "log-odds", "added to a cell in which a beam ends: p = 0.7", OCTOMAP)
    miss: float = number(
        -0.4, "log-odds", "added to a cell that a beam passes: p = 0.4", OCTOMAP, low=-1e6, high=0.0
    )
    most: float = number(
        3.5, "log-odds", "largest magnitude of a cell's log-odds: p = 0.97", OCTOMAP, low=1e-3
    )
    struck: float = number(0.6, "input", "least input of a cell where a beam ends")


@dataclass(frozen=True, kw_only=True)
class OccupancyConfig(TrackerConfig):
    """As ``TrackerConfig``, of whose map only ``cell_m`` counts here, and the grid's own.

    Every return has full weight: the grid stays what it is elsewhere.
    """

    standing: StandingConfig = field(default=FULL_WEIGHT)
    grid: GridConfig = field(default=GridConfig())


class Odds(NamedTuple):
    """The inverse sensor model, as in ``GridConfig``."""

    hit: float
    miss: float
    most: float
    struck: float


@uncounted
def _open(cells: Cells, view: View, T_map_laser: Float, cell: float) -> bool:
    """Let every block in view live: a grid also remembers where it saw nothing. False: no room."""
    c, s = math.cos(T_map_laser[2]), math.sin(T_map_laser[2])
    laser = (T_map_laser[0], T_map_laser[1], c, s)
    first_row, last_row, first_column, last_column = in_reach(cells, view, T_map_laser, SIDE * cell)
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            hidden = free_at(cells, view, laser, cell, row, column) < 0.0
            if cells.directory[row, column] < 0 and not hidden and born(cells, row, column) < 0:
                return False
    return True


@uncounted
def integrate(  # noqa: C901, PLR0913, PLR0915 (kernel)
    cells: Cells, log_odds: Float32, view: View, T_map_laser: Float,
    cell: float, step: float, odds: Odds, known_s: float, off: int, write: bool,
) -> Look:  # fmt: skip
    """Add one scan, ``step`` s after the last, to ``log_odds`` (S, 8, 8) by slot.

    ``cells.y`` becomes 2 p - 1 above 0, ``cells.age`` the s that a cell was
    looked at.
    """
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
            for jj in range(SIDE):
                for ii in range(SIDE):
                    given = cells.impression[scratch, jj, ii] if scratch >= 0 else np.float32(0.0)
                    y, age = cells.y[slot, jj, ii], cells.age[slot, jj, ii]
                    weight = lasting(y, age, known_s)
                    if given == 0.0:
                        px = (i0 + ii + 0.5) * cell - ox
                        py = (j0 + jj + 0.5) * cell - oy
                        if not seen_empty(view, c * px + s * py, c * py - s * px, free):
                            continue
                        contradicted += y
                        through += weight
                        more = odds.miss
                    else:
                        confirmed += y * given
                        known += weight * given
                        if write:
                            before = cells.off[slot, jj, ii]
                            cells.off[slot, jj, ii] = stamped(before, weight, SURE, off)
                        if given < odds.struck:
                            continue
                        more = odds.hit
                    visited += 1
                    if write:
                        now = float(log_odds[slot, jj, ii]) + more
                        now = min(max(now, -odds.most), odds.most)
                        log_odds[slot, jj, ii] = now
                        cells.age[slot, jj, ii] += step
                        cells.y[slot, jj, ii] = max(math.tanh(0.5 * now), 0.0)
    return Look(confirmed, contradicted, visited, known * cell, through * cell)


@njit
def _probabilities(cells: Cells, log_odds: Float32, i0: int, j0: int, n: int, out: Float32) -> None:
    """Into ``out``, NaN so far, from cell (i0, j0) on, ``n`` a side as one: the largest of them."""
    rows, columns = cells.directory.shape
    for row in range(rows):
        for column in range(columns):
            slot = cells.directory[row, column]
            if slot < 0:
                continue
            for jj in range(SIDE):
                for ii in range(SIDE):
                    odds = log_odds[slot, jj, ii]
                    if odds != 0.0:
                        a = ((row + cells.corner[1]) * SIDE + jj - j0) // n
                        b = ((column + cells.corner[0]) * SIDE + ii - i0) // n
                        p = np.float32(0.5 + 0.5 * math.tanh(0.5 * odds))
                        if not out[a, b] >= p:
                            out[a, b] = p


class Grid(CellMap):
    """The same storage, and log-odds beside it.

    log_odds  (S, 8, 8) float32 by slot. Zero where no block lives: one that was written to stays
    """

    config: OccupancyConfig

    def __init__(self, config: OccupancyConfig) -> None:
        super().__init__(config)
        numbers = config.grid
        self._odds = Odds(numbers.hit, numbers.miss, numbers.most, numbers.struck)
        self.log_odds = np.zeros_like(self.cells.age)

    def twin(self) -> Self:
        """The log-odds are copied too."""
        other = super().twin()
        other.log_odds = self.log_odds.copy()
        return other

    def begun_like(self, other: CellMap | None) -> Self:
        """With log-odds for as many blocks."""
        begun = super().begun_like(other)
        begun.log_odds = np.zeros_like(begun.cells.age)
        return begun

    def grow(self) -> None:
        """Make room where a kernel ran out of it."""
        super().grow()
        more = len(self.cells.age) - len(self.log_odds)
        self.log_odds = np.concatenate([self.log_odds, np.zeros((more, SIDE, SIDE), np.float32)])

    def kept(self, slots: Int32) -> Float32:
        """Log-odds, which a file has in the place of ages."""
        return self.log_odds[slots]

    def restore(self, slot: int, kept: Float32) -> None:
        """Log-odds of a file, and the least time of looking that they took."""
        self.log_odds[slot] = kept
        looks = np.where(kept > 0.0, kept / self._odds.hit, kept / min(self._odds.miss, -1e-3))
        self.cells.age[slot] = np.ceil(looks) * self.config.map.resumed_look_s

    def integrate(
        self,
        view: View,
        T_map_laser: Float,
        step: float,
        *,
        write: bool,
    ) -> Look:
        """As ``CellMap.integrate``; a grid counts scans, but keeps for how long it has looked."""
        if write:
            reach = view.farthest
            x, y = float(T_map_laser[0]), float(T_map_laser[1])
            self.cover(x - reach, y - reach, x + reach, y + reach)
            while not _open(self.cells, view, T_map_laser, self.cell):
                self.grow()
        result = integrate(
            self.cells, self.log_odds, view, T_map_laser, self.cell, step, self._odds,
            self.config.map.known_s, self.off_cm, write,
        )  # fmt: skip
        if write:
            self.release()
        return result

    def probabilities(self) -> Raster | None:
        """p of every cell that was ever seen, NaN elsewhere; wider cells where it is too large."""
        extent = self.extent()
        if extent is None:
            return None
        i0, j0, i1, j1 = extent
        n = self.coarseness(extent)
        values = np.full((-(-(j1 - j0) // n), -(-(i1 - i0) // n)), np.nan, np.float32)
        _probabilities(self.cells, self.log_odds, i0, j0, n, values)
        return self.raster(values, extent, n)


class OccupancySlam(Tracker):
    """An ordinary log-odds occupancy grid, with the matcher of every tracker."""

    config_class: ClassVar[type[OccupancyConfig]] = OccupancyConfig
    cells_hold = "probabilities"

    def __init__(
        self,
        config: OccupancyConfig | str | Mapping[str, Any] = "robust",
        *,
        cell_m: float | None = None,
    ) -> None:
        """``cell_m`` replaces that of the config."""
        given = self.config_class.of(config)
        super().__init__(given if cell_m is None else given.changed({"cell_m": cell_m}))

    @staticmethod
    def _new_map(config: OccupancyConfig) -> Grid:
        return Grid(config)

    @classmethod
    def _new_submap(cls, config: OccupancyConfig) -> Network:
        return Network(config, lateral=False)

    def changes(self) -> None:
        """A grid has but one memory."""

    def map(self) -> Raster | None:
        """Probability of being occupied; NaN where nothing was ever seen."""
        grid = self.cell_map
        assert isinstance(grid, Grid)
        return grid.probabilities()
