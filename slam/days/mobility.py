# SPDX-License-Identifier: Apache-2.0
"""How often and how long things stand, place by place: rasters for pictures and questions.

mobility = session.map().mobility
mobility.probability(time_s)      # a Raster: is something likely to stand there then?
mobility.at((3.2, 1.5), time_s)   # one place: is this door likely open at nine?
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from slam.days.config import DaysConfig, HabitConfig
from slam.days.habits import Habits
from slam.days.history import History, dense
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import Float


class MobilityMap:
    """What a history says of its places. Rasters are NaN where no session saw anything."""

    def __init__(self, history: History, config: HabitConfig | None = None) -> None:
        self.history, self.config = history, config or DaysConfig().habit

    @cached_property
    def _habits(self) -> Habits:
        cells, values = self.history.table()
        habits = Habits(len(cells), self.config)
        for time_s, row in zip(self.history.times_s.tolist(), values, strict=True):
            habits.see(time_s, row.astype(np.float64))
        return habits

    def probability(self, time_s: float) -> Raster | None:
        """That something stands in each place then; None without any place."""
        _finite(time_s)
        return self._raster(self._habits.probability(time_s))

    @cached_property
    def standing(self) -> Raster | None:
        """Share of the sessions that found something there."""
        _, values = self.history.table()
        with np.errstate(invalid="ignore", divide="ignore"):
            looks = (~np.isnan(values)).sum(axis=0)
            return self._raster(np.nansum(values, axis=0) / looks)

    @cached_property
    def mobility(self) -> Raster | None:
        """How much each place differs from one sighting to the next, on average.

        0: always so, wall or free floor; 1: never twice the same. NaN where it was seen once only.
        """
        _, values = self.history.table()
        last = np.full(values.shape[1:], np.nan)
        steps, pairs = np.zeros(len(last)), np.zeros(len(last))
        for row in values.astype(np.float64):
            both = ~np.isnan(row) & ~np.isnan(last)
            steps[both] += np.abs(row - last)[both]
            pairs += both
            last = np.where(np.isnan(row), last, row)
        return self._raster(np.where(pairs > 0, steps / np.maximum(pairs, 1.0), np.nan))

    @cached_property
    def stays_h(self) -> Float:
        """(n,) hours for which each place of ``history.table()`` stays as it is, on average."""
        return self._habits.stays_s() / 3600.0

    def at(self, point: tuple[float, float], time_s: float, reach_m: float = 0.0) -> float | None:
        """Probability that something stands at ``point`` (m, map frame) then, or, with ``reach_m``,
        in the likeliest place within that; None where no session saw it.
        """
        _finite(time_s)
        cells, _ = self.history.table()
        if not len(cells):
            return None
        cell = self.history.cell_m
        off = np.hypot(*((cells + 0.5) * cell - np.asarray(point)).T)
        near = off <= max(reach_m, 0.7072 * cell)
        if not near.any():
            return None
        told = self._habits.probability(time_s)
        return float(told[near].max() if reach_m > 0.0 else told[int(np.argmin(off))])

    def _raster(self, values: Float) -> Raster | None:
        cells, _ = self.history.table()
        if not len(cells):
            return None
        low, images = dense(cells, values[None].astype(np.float32))
        origin = np.array([*(low * self.history.cell_m).tolist(), 0.0])
        return Raster(values=images[0], resolution_m=self.history.cell_m, T_map_origin=origin)


def _finite(time_s: float) -> None:
    if not math.isfinite(time_s):
        raise InvalidValueError(f"time_s must be finite, got {time_s}")


@dataclass(frozen=True, kw_only=True, eq=False)
class DaysRaster(Raster):
    """A map, and what is known of its places over days."""

    mobility: MobilityMap

    @classmethod
    def of(cls, raster: Raster, mobility: MobilityMap) -> DaysRaster:
        """``raster`` with that beside it."""
        return cls(
            values=raster.values,
            resolution_m=raster.resolution_m,
            T_map_origin=raster.T_map_origin,
            mobility=mobility,
        )
