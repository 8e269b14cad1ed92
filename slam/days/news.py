# SPDX-License-Identifier: Apache-2.0
"""What a scan shows that the days before do not know: the map is outdated here.

A return counts where nothing stood when the place was last seen; a beam counts that passes through
a place where something stood then. Each place is news for ``news_s``. Then the map has learnt
it.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.days.config import DaysConfig, NewsConfig
from slam.days.history import History, dense
from slam.frames import NS_PER_S, Float, Frame
from slam.scan_points import deskewed

_NEVER = np.iinfo(np.int64).max


class News:
    """Holds each scan of a session against what the days before saw last of each place."""

    def __init__(self, history: History, config: NewsConfig | None = None) -> None:
        self.config, self.cell_m = config or DaysConfig().news, history.cell_m
        cells, last = _last_seen(history)
        stood = last >= self.config.stands
        self._low = np.zeros(2, np.int64)
        self._empty: NDArray[np.bool_] = np.zeros((0, 0), np.bool_)
        if len(cells):
            self._low, (image,) = dense(cells, last)
            side = np.ones((2 * self.config.slack + 1,) * 2, np.uint8)
            near = cv2.dilate(np.nan_to_num(image), side)
            self._empty = ~np.isnan(image) & (near <= self.config.empty)
        self._stood = cells[stood] - self._low
        self._stood_at: Float = np.asarray((cells[stood] + 0.5) * self.cell_m, dtype=np.float64)
        self._since_ns: NDArray[np.int64] = np.full(self._empty.shape, _NEVER, np.int64)

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
        new = frame.stamp_ns - np.minimum(since, frame.stamp_ns) <= self.config.news_s * NS_PER_S
        told = np.zeros(len(ends), np.bool_)
        told[beams[new]] = True
        return float(told.mean())

    def _note(self, places: NDArray[np.int64], now_ns: int) -> None:
        """From now on these places are news, and those so near that they are of one thing."""
        reach = self.config.reach
        for i, j in places.tolist():
            rows, columns = (slice(max(at - reach, 0), at + reach + 1) for at in (j, i))
            around = self._since_ns[rows, columns]
            np.minimum(around, now_ns, out=around)

    def _came(self, ends: Float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Returns (n,) that lie where nothing was, and their places (n, 2)."""
        at = np.floor(ends / self.cell_m).astype(np.int64) - self._low
        height, width = self._empty.shape
        inside = np.flatnonzero((at >= 0).all(axis=1) & (at < (width, height)).all(axis=1))
        new = inside[self._empty[at[inside, 1], at[inside, 0]]]
        return new, at[new]

    def _went(self, eye: Float, ends: Float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
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
        near = np.flatnonzero((far < self.config.range_m) & (far > self.cell_m))
        to, far = to[near], far[near]
        middle = np.arctan2(to[:, 1], to[:, 0])
        first = np.searchsorted(bearings, middle - 0.5 * self.cell_m / far)
        last = np.searchsorted(bearings, middle + 0.5 * self.cell_m / far)
        beams, places = [np.zeros(0, np.int64)], [np.zeros((0, 2), np.int64)]
        least = far + self.config.beyond_m
        for k in np.flatnonzero(last > first).tolist():
            if ranges[first[k] : last[k]].min() > least[k]:
                beams.append(order[first[k] : last[k]])
                places.append(np.repeat(self._stood[near[k]][None], last[k] - first[k], axis=0))
        return np.concatenate(beams), np.concatenate(places)


def _last_seen(history: History) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Places (n, 2), and the share of each when a session saw it last."""
    cells, values = history.table()
    last = np.full(len(cells), np.nan, np.float32)
    for row in values:
        last = np.where(np.isnan(row), last, row)
    return cells, last
