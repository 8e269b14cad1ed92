# SPDX-License-Identifier: Apache-2.0
"""Where scans may have changed a map: what a film draws anew."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slam import se2
from slam.frames import Float, Scan
from slam.frontend.seen_space import FREE_WITHOUT_RETURN_M

SQUARE_M = 4.0
ALONG_M = 1.5  # between the points of a beam that are looked at
BESIDE = 6  # one in so many beams is looked at along its way; of all, where it ends
_WIDE = 1 << 30  # squares in a row, at most
BEYOND_M = 0.5  # what a return touches behind itself
Bounds = tuple[float, float, float, float]


class Changed:
    """Squares of the map frame that beams met or crossed."""

    def __init__(self) -> None:
        self._squares: set[tuple[int, int]] = set()

    def add(self, scan: Scan, T_map_robot: Float) -> None:
        """All that ``scan`` saw from ``T_map_robot``."""
        reach = np.where(scan.valid, scan.ranges, FREE_WITHOUT_RETURN_M) + BEYOND_M
        T_map_laser = se2.compose(T_map_robot, scan.spec.T_robot_laser)
        angles = scan.spec.angles
        ends = np.stack([reach * np.cos(angles), reach * np.sin(angles)], axis=1)
        few, at = reach[::BESIDE], np.arange(0.0, float(reach.max()), ALONG_M)
        beam, step = np.nonzero(at[None, :] < few[:, None])
        along = ends[::BESIDE][beam] * (at[step] / few[beam])[:, None]
        points = se2.transform(T_map_laser, np.vstack([ends, along]))
        column, row = np.floor(points / SQUARE_M).astype(np.int64).T
        keys = np.unique(row * _WIDE + column + _WIDE // 2)  # one number sorts faster than two
        for key in keys.tolist():
            at, beside = divmod(key, _WIDE)
            self._squares.add((at, beside - _WIDE // 2))

    def taken(self, *, in_parts: bool = True) -> Iterator[Bounds]:
        """xmin, ymin, xmax, ymax (m) of runs of squares, or of all at once; and forget them."""
        squares, self._squares = sorted(self._squares), set()
        if not squares:
            return
        if not in_parts:
            rows, columns = zip(*squares, strict=True)
            yield _bounds(min(rows), min(columns), max(rows), max(columns))
            return
        row, first = squares[0]
        last = first - 1
        for at, column in [*squares, (squares[-1][0] + 1, 0)]:
            if (at, column) == (row, last + 1):
                last = column
                continue
            yield _bounds(row, first, row, last)
            row, first, last = at, column, column


def _bounds(row: int, column: int, last_row: int, last_column: int) -> Bounds:
    x, y = column * SQUARE_M, row * SQUARE_M
    return x, y, (last_column + 1) * SQUARE_M, (last_row + 1) * SQUARE_M
