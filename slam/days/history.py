# SPDX-License-Identifier: Apache-2.0
"""The sessions of a building, place by place: what a map of days knows beside the map itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.days.config import DaysConfig
from slam.days.evidence import Snapshot
from slam.errors import InvalidValueError, LogFormatError
from slam.frames import Float

UNSEEN, LEVELS = 0, 254  # bytes of a share: 0 unseen, 1 to 255 for 0 to 1
NAMES = ("day_cell_m", "day_times_s", "day_cells", "day_standing")
FARTHEST = 1 << 24  # places from the origin
WIDEST = 1 << 26  # places in the rectangle around all, which is held whole: 820 m square of 10 cm
MOST_SESSIONS, MOST_TIME_S = 1000, 1e12
DAY_S = 86_400.0


@dataclass(frozen=True, kw_only=True)
class History:
    """Sessions in the order in which they were mapped, on places of ``cell_m``."""

    cell_m: float
    sessions: tuple[Snapshot, ...] = ()

    def __len__(self) -> int:
        return len(self.sessions)

    def with_session(self, snapshot: Snapshot, most: int | None = None) -> History:
        """One more; of more than ``most`` the oldest go.

        Raises ``InvalidValueError`` for one that is not later than the last: the same session
        merged twice would count twice.
        """
        if self.sessions and snapshot.time_s <= self.sessions[-1].time_s:
            raise InvalidValueError(
                f"a session must begin after the last one of the map, at "
                f"{self.sessions[-1].time_s:.15g} s, got {snapshot.time_s:.15g} s"
            )
        most = DaysConfig().evidence.sessions if most is None else most
        return replace(self, sessions=(*self.sessions, snapshot)[-most:])

    @property
    def times_s(self) -> Float:
        """(sessions,) when each was."""
        return np.array([s.time_s for s in self.sessions], dtype=np.float64)

    def table(self) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Places (n, 2) that any session saw, and (sessions, n) shares, NaN where unseen."""
        if not self.sessions:
            return np.zeros((0, 2), np.int32), np.zeros((0, 0), np.float32)
        stacked = np.concatenate([s.cells for s in self.sessions])
        cells, inverse = np.unique(stacked, axis=0, return_inverse=True)
        values = np.full((len(self.sessions), len(cells)), np.nan, np.float32)
        first = 0
        for row, session in enumerate(self.sessions):
            n = len(session.cells)
            values[row, inverse.ravel()[first : first + n]] = session.standing
            first += n
        return cells, values

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a map file keeps; a share is kept to 1/254."""
        cells, values = self.table()
        levels = np.round(np.nan_to_num(values) * LEVELS).astype(np.uint8) + np.uint8(1)
        return {
            "day_cell_m": np.array(self.cell_m),
            "day_times_s": self.times_s,
            "day_cells": cells,
            "day_standing": np.where(np.isnan(values), np.uint8(UNSEEN), levels),
        }

    @classmethod
    def of_arrays(cls, path: Path, arrays: Mapping[str, NDArray[Any]]) -> History:
        """Of a file's arrays; ``LogFormatError`` for what ``arrays`` never gives."""
        cell, times = arrays["day_cell_m"], arrays["day_times_s"]
        cells, levels = arrays["day_cells"], arrays["day_standing"]
        _check(path, cell, times, cells, levels)
        sessions = []
        for row, time_s in enumerate(times.tolist()):
            seen = np.flatnonzero(levels[row] != UNSEEN)
            shares = (levels[row, seen].astype(np.float32) - 1.0) / LEVELS
            sessions.append(Snapshot(time_s=time_s, cells=cells[seen], standing=shares))
        return cls(cell_m=float(cell), sessions=tuple(sessions))


def _check(
    path: Path,
    cell: NDArray[Any],
    times: NDArray[Any],
    cells: NDArray[Any],
    levels: NDArray[Any],
) -> None:
    if cell.shape != () or cell.dtype != np.float64 or not 0.0 < float(cell) < math.inf:
        raise LogFormatError(path, "day_cell_m must be a length > 0 m")
    good = times.ndim == 1 and times.dtype == np.float64 and len(times) <= MOST_SESSIONS
    if not good or not (np.abs(times) <= MOST_TIME_S).all() or not (np.diff(times) > 0.0).all():
        raise LogFormatError(
            path, f"day_times_s must be up to {MOST_SESSIONS} times s, each later than the last"
        )
    if cells.ndim != 2 or cells.shape[1] != 2 or cells.dtype != np.int32:
        raise LogFormatError(path, "day_cells must be int32 of shape (n, 2)")
    if len(cells) and int(np.abs(cells.astype(np.int64)).max()) > FARTHEST:
        raise LogFormatError(path, f"day_cells must lie within {FARTHEST} places")
    if len(cells) and math.prod((np.ptp(cells.astype(np.int64), axis=0) + 1).tolist()) > WIDEST:
        raise LogFormatError(path, f"day_cells must lie in a rectangle of {WIDEST} places")
    if len(np.unique(cells, axis=0)) != len(cells):
        raise LogFormatError(path, "day_cells: a place occurs twice")
    if levels.shape != (len(times), len(cells)) or levels.dtype != np.uint8:
        raise LogFormatError(
            path, f"day_standing must be bytes of shape {(len(times), len(cells))}"
        )


def dense(
    cells: NDArray[np.int32], values: Sequence[NDArray[np.float32]] | NDArray[np.float32]
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Corner (x, y) of the places' rectangle, and (k, height, width) images, NaN elsewhere."""
    rows = np.atleast_2d(np.asarray(values, dtype=np.float32))
    low = cells.min(axis=0).astype(np.int64)
    width, height = (cells.max(axis=0) - low + 1).tolist()
    images = np.full((len(rows), height, width), np.nan, np.float32)
    at = cells - low
    images[:, at[:, 1], at[:, 0]] = rows
    return low, images


def hour_of(time_s: Float | float) -> Float:
    """Hour of the day in [0, 24)."""
    return np.asarray(np.mod(time_s, DAY_S) / 3600.0, dtype=np.float64)
