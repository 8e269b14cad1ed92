# SPDX-License-Identifier: Apache-2.0
"""The sessions of a building, place by place, and what a scan shows that they do not know.

``News``: a return counts where nothing stood when the place was last seen; a beam counts that goes
through a place where something stood then. Each place is news for ``NEWS_S``. Then the map has
learnt it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.arrays import Bools, Float, Float32, Int32, Ints
from slam.days.evidence import Snapshot
from slam.errors import InvalidValueError, LogFormatError
from slam.frames import NS_PER_S, Frame
from slam.scan_points import deskewed

UNSEEN, LEVELS = 0, 254  # bytes of a share: 0 unseen, 1 to 255 for 0 to 1
NAMES = ("day_cell_m", "day_times_s", "day_cells", "day_standing")
FARTHEST = 1 << 24  # places from the origin
WIDEST = 1 << 26  # places in the rectangle around all, which is held whole: 820 m square of 10 cm
MOST_SESSIONS, MOST_TIME_S = 1000, 1e12
DAY_S = 86_400.0
DATES = 1971  # year from which on a time is a date: those of simulated sessions begin at 0 s
SESSIONS = 64  # kept in a map file; older ones go; set by hand
STOOD = 0.5  # share of the looks, when last seen: something stood; set by hand
EMPTY = 0.05  # share of the looks, around it too: nothing stood; set by hand
SLACK = 1  # places, that an edge may be off by; set by hand
BEYOND_M = 0.3  # m, that a beam must go past a place where something stood; set by hand
ASKED_M = 8.0  # m, farthest place that is asked; set by hand
REACH = 4  # places, to others that are of the same thing; set by hand
NEWS_S = 2.0  # s after its first scan; then the map has learnt it; set by hand


@dataclass(frozen=True, kw_only=True)
class History:
    """Sessions in the order in which they were mapped, on places of ``cell_m``."""

    cell_m: float
    sessions: tuple[Snapshot, ...] = ()

    def __len__(self) -> int:
        return len(self.sessions)

    def with_session(self, snapshot: Snapshot, most: int = SESSIONS) -> "History":
        """One more; of more than ``most`` the oldest go.

        Raises as ``check_later``.
        """
        self.check_later(snapshot.time_s)
        return replace(self, sessions=(*self.sessions, snapshot)[-most:])

    def check_later(self, time_s: float) -> None:
        """``InvalidValueError`` for a session that does not begin after the last one: the same one
        merged twice would count twice."""
        if self.sessions and time_s <= self.sessions[-1].time_s:
            raise InvalidValueError(
                f"Session.time_s must be later than the map's last session, at "
                f"{told(self.sessions[-1].time_s)}, got {told(time_s)}"
            )

    @property
    def times_s(self) -> Float:
        """(sessions,) when each was."""
        return np.array([s.time_s for s in self.sessions], dtype=np.float64)

    def table(self) -> tuple[Int32, Float32]:
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
    def of_arrays(cls, path: Path, arrays: Mapping[str, NDArray[Any]]) -> "History":
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
    path: Path, cell: NDArray[Any], times: NDArray[Any], cells: NDArray[Any], levels: NDArray[Any]
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


def dense(cells: Int32, values: Sequence[Float32] | Float32) -> tuple[Ints, Float32]:
    """Corner (x, y) of the places' rectangle, and (k, height, width) images, NaN elsewhere."""
    rows = np.atleast_2d(np.asarray(values, dtype=np.float32))
    low = cells.min(axis=0).astype(np.int64)
    width, height = (cells.max(axis=0) - low + 1).tolist()
    images = np.full((len(rows), height, width), np.nan, np.float32)
    at = cells - low
    images[:, at[:, 1], at[:, 0]] = rows
    return low, images


def told(time_s: float) -> str:
    """A time as ``--at`` takes it, 2026-05-04T09:00:00Z; in s where it is no date of a log."""
    try:
        day = datetime.fromtimestamp(time_s, UTC)
    except (OverflowError, ValueError, OSError):
        return f"{time_s:.15g} s"
    return f"{time_s:.15g} s" if day.year < DATES else day.isoformat().replace("+00:00", "Z")


def hour_of(time_s: Float | float) -> Float:
    """Hour of the day in [0, 24)."""
    return np.asarray(np.mod(time_s, DAY_S) / 3600.0, dtype=np.float64)


_NEVER = np.iinfo(np.int64).max


class News:
    """Holds each scan of a session against what the days before saw last of each place."""

    def __init__(self, history: History) -> None:
        self.cell_m = history.cell_m
        cells, last = _last_seen(history)
        stood = last >= STOOD
        self._low = np.zeros(2, np.int64)
        self._empty: Bools = np.zeros((0, 0), np.bool_)
        if len(cells):
            self._low, (image,) = dense(cells, last)
            side = np.ones((2 * SLACK + 1,) * 2, np.uint8)
            near = cv2.dilate(np.nan_to_num(image), side)
            self._empty = ~np.isnan(image) & (near <= EMPTY)
        self._stood = cells[stood] - self._low
        self._stood_at: Float = np.asarray((cells[stood] + 0.5) * self.cell_m, dtype=np.float64)
        self._since_ns: Ints = np.full(self._empty.shape, _NEVER, np.int64)

    @property
    def known(self) -> bool:
        """Whether there is anything to hold a scan against."""
        return bool(self._empty.size)

    def share(self, frame: Frame, T_map_robot: Float) -> float:
        """Of the returns of a scan, those that tell news; 0 without any return."""
        if frame.scan is None or not self.known:
            return 0.0
        ends = se2.transform(T_map_robot, deskewed(frame))
        if len(ends) < 2:
            return 0.0
        eye = se2.compose(T_map_robot, frame.scan.spec.T_robot_laser)[:2]
        beams, places = self._came(ends)
        passing, left = self._went(eye, ends)
        beams, places = np.concatenate([beams, passing]), np.concatenate([places, left])
        since = self._since_ns[places[:, 1], places[:, 0]]
        self._note(places[since == _NEVER], frame.stamp_ns)
        new = frame.stamp_ns - np.minimum(since, frame.stamp_ns) <= NEWS_S * NS_PER_S
        is_news = np.zeros(len(ends), np.bool_)
        is_news[beams[new]] = True
        return float(is_news.mean())

    def _note(self, places: Ints, now_ns: int) -> None:
        """From now on these places are news, and those so near that they are of one thing."""
        for i, j in places.tolist():
            rows, columns = (slice(max(at - REACH, 0), at + REACH + 1) for at in (j, i))
            around = self._since_ns[rows, columns]
            np.minimum(around, now_ns, out=around)

    def _came(self, ends: Float) -> tuple[Ints, Ints]:
        """Returns (n,) that lie where nothing was, and their places (n, 2)."""
        at = np.floor(ends / self.cell_m).astype(np.int64) - self._low
        height, width = self._empty.shape
        inside = np.flatnonzero((at >= 0).all(axis=1) & (at < (width, height)).all(axis=1))
        new = inside[self._empty[at[inside, 1], at[inside, 0]]]
        return new, at[new]

    def _went(self, eye: Float, ends: Float) -> tuple[Ints, Ints]:
        """Beams (n,) that pass through a place where something stood, and those places (n, 2)."""
        away = ends - eye
        bearings = np.arctan2(away[:, 1], away[:, 0])
        order = np.argsort(bearings, kind="stable")
        turns = np.repeat((-2.0 * math.pi, 0.0, 2.0 * math.pi), len(order))
        order = np.tile(order, 3)  # a place behind, at +-pi, has beams at both ends
        bearings = bearings[order] + turns
        ranges = np.hypot(away[order, 0], away[order, 1])
        to = self._stood_at - eye
        far = np.hypot(to[:, 0], to[:, 1])
        near = np.flatnonzero((far < ASKED_M) & (far > self.cell_m))
        to, far = to[near], far[near]
        middle = np.arctan2(to[:, 1], to[:, 0])
        first = np.searchsorted(bearings, middle - 0.5 * self.cell_m / far)
        last = np.searchsorted(bearings, middle + 0.5 * self.cell_m / far)
        beams, places = [np.zeros(0, np.int64)], [np.zeros((0, 2), np.int64)]
        least = far + BEYOND_M
        for k in np.flatnonzero(last > first).tolist():
            if ranges[first[k] : last[k]].min() > least[k]:
                beams.append(order[first[k] : last[k]])
                places.append(np.repeat(self._stood[near[k]][None], last[k] - first[k], axis=0))
        return np.concatenate(beams), np.concatenate(places)


def _last_seen(history: History) -> tuple[Int32, Float32]:
    """Places (n, 2), and the share of each when a session saw it last."""
    cells, values = history.table()
    last = np.full(len(cells), np.nan, np.float32)
    for row in values:
        last = np.where(np.isnan(row), last, row)
    return cells, last
