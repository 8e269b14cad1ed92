# SPDX-License-Identifier: Apache-2.0
"""What one session saw of each place: how often something stood there, of how many looks.

It needs scans and poses only, so it works beside any SLAM. A return counts for the place that it
lies in; the places that the beams passed count as empty.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from slam import se2
from slam.arrays import Bytes, Float, Float32, Int32, Ints
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Frame
from slam.scan_points import deskewed

CELL_M = 0.1  # m, edge of a place; set by hand
EVERY_S = 0.2  # s, between two scans that are counted; set by hand
RANGE_M = 8.0  # m, farthest return that is counted; set by hand
MARGIN_M = 0.15  # m, before a return that is not yet known to be empty; set by hand
LEAST_LOOKS = 5  # scans; a place seen less often stays unknown; set by hand
_TILE = 128  # places along a tile's edge
_FIXED = 4  # bits behind the point in the corners that OpenCV fills


@dataclass(frozen=True, kw_only=True, eq=False)
class Snapshot:
    """The places that one session saw.

    time_s    when: seconds since a midnight, so that hours of the day can be told
    cells     (n, 2) int32 indices (x, y): place (i, j) is centred at (i + 0.5, j + 0.5) cells
    standing  (n,) float32 in [0, 1]: share of the looks that found something there
    """

    time_s: float
    cells: Int32
    standing: Float32

    def __post_init__(self) -> None:
        if not math.isfinite(self.time_s):
            raise InvalidValueError(f"Snapshot.time_s must be finite, got {self.time_s}")
        n = len(self.standing)
        if self.cells.shape != (n, 2) or self.standing.shape != (n,):
            raise InvalidValueError(
                f"Snapshot.cells must be (n, 2) and standing (n,), got {self.cells.shape} and "
                f"{self.standing.shape}"
            )
        if n and not 0.0 <= self.standing.min() <= self.standing.max() <= 1.0:
            raise InvalidValueError("Snapshot.standing must lie in [0, 1]")


class SessionGrid:
    """Counts looks while a session goes on."""

    def __init__(
        self, cell_m: float = CELL_M, every_s: float = EVERY_S, least_looks: int = LEAST_LOOKS
    ) -> None:
        self._cell_m, self._every_ns = cell_m, round(every_s * NS_PER_S)
        self._least_looks = least_looks
        self._tiles: dict[tuple[int, int], Float32] = {}
        self._last_ns: int | None = None
        self.scans = 0

    def due(self, stamp_ns: int) -> bool:
        """Whether a scan of this stamp is to be counted."""
        last = self._last_ns
        return last is None or stamp_ns - last >= self._every_ns

    def add(self, frame: Frame, T_map_robot: Float) -> bool:
        """Count what ``frame`` saw from there; False for one too soon after the last, or blind."""
        if frame.scan is None or not self.due(frame.stamp_ns):
            return False
        T_map_laser = se2.compose(T_map_robot, frame.scan.spec.T_robot_laser)
        points = deskewed(frame)
        ends = se2.transform(T_map_robot, points)
        away = ends - T_map_laser[:2]
        ranges = np.hypot(away[:, 0], away[:, 1])
        if len(ends) < 2:
            return False
        self._last_ns = frame.stamp_ns
        self.scans += 1
        near = ends[ranges <= RANGE_M]
        seen = np.minimum(ranges, RANGE_M) - MARGIN_M
        share = np.maximum(seen, 0.0) / np.maximum(ranges, 1e-9)
        rim = T_map_laser[:2] + away * share[:, None]
        self._count(near, np.vstack([T_map_laser[None, :2], rim]))
        return True

    def _count(self, hits: Float, outline: Float) -> None:
        """One look: the places of ``hits`` are taken, others within ``outline`` empty."""
        cell = self._cell_m
        everything = np.vstack([hits, outline])
        low = np.floor(everything.min(axis=0) / cell).astype(int) - 1
        size = np.floor(everything.max(axis=0) / cell).astype(int) + 2 - low
        empty = np.zeros((size[1], size[0]), np.uint8)
        corners = (outline / cell - low - 0.5) * (1 << _FIXED)
        cv2.fillPoly(empty, [np.round(corners).astype(np.int32)], 1, cv2.LINE_8, _FIXED)
        taken = np.zeros_like(empty)
        at = np.floor(hits / cell).astype(int) - low
        taken[at[:, 1], at[:, 0]] = 1
        empty[taken > 0] = 0
        for row, column in np.ndindex(*(((low + size - 1) // _TILE - low // _TILE + 1)[::-1])):
            key = (int(low[1] // _TILE) + row, int(low[0] // _TILE) + column)
            self._add_to(key, low, taken, empty)

    def _add_to(
        self,
        key: tuple[int, int],
        low: Ints,
        taken: Bytes,
        empty: Bytes,
    ) -> None:
        tile = self._tiles.get(key)
        if tile is None:
            tile = self._tiles[key] = np.zeros((2, _TILE, _TILE), np.float32)
        y0, x0 = low[1] - key[0] * _TILE, low[0] - key[1] * _TILE
        rows = slice(max(0, y0), min(_TILE, y0 + taken.shape[0]))
        columns = slice(max(0, x0), min(_TILE, x0 + taken.shape[1]))
        part = np.s_[rows.start - y0 : rows.stop - y0, columns.start - x0 : columns.stop - x0]
        tile[0, rows, columns] += taken[part]
        tile[1, rows, columns] += empty[part]

    def snapshot(self, time_s: float) -> Snapshot:
        """What was seen so far, of places that were looked at often enough; by rows."""
        cells, shares = [np.zeros((0, 2), np.int32)], [np.zeros(0, np.float32)]
        for (row, column), (hits, passes) in sorted(self._tiles.items()):
            looks = hits + passes
            j, i = np.nonzero(looks >= self._least_looks)
            corner = np.array([column, row]) * _TILE
            cells.append((np.stack([i, j], axis=1) + corner).astype(np.int32))
            shares.append((hits[j, i] / looks[j, i]).astype(np.float32))
        return Snapshot(time_s=time_s, cells=np.concatenate(cells), standing=np.concatenate(shares))
