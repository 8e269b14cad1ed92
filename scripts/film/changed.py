# SPDX-License-Identifier: Apache-2.0
"""Where scans may have changed a map: what a film draws again."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from slam import se2
from slam.frames import Float, Scan
from slam.frontend.seen_space import FREE_AT_MOST_M

SQUARE_M = 4.0
ALONG_M = 1.5  # between the points of a beam that are looked at
BESIDE = 6  # one in so many beams is looked at along its way; of all, where it ends
_WIDE = 1 << 30  # squares in a row, at most
BEYOND_M = 0.5  # what a return touches before and behind itself
Bounds = tuple[float, float, float, float]


class Changed:
    """Squares of the map frame that beams met something in, and those that they crossed."""

    def __init__(self) -> None:
        self._met: set[int] = set()
        self._crossed: set[int] = set()

    def add(self, scan: Scan, T_map_robot: Float) -> None:
        """All that ``scan`` saw from ``T_map_robot``."""
        T_map_laser = se2.compose(T_map_robot, scan.spec.T_robot_laser)
        angles = scan.spec.angles
        ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        reach = np.where(scan.valid, scan.ranges, FREE_AT_MOST_M) + BEYOND_M
        met, ends = reach[scan.valid, None], ways[scan.valid]
        around = np.vstack([met * ends, np.maximum(met - 2.0 * BEYOND_M, 0.0) * ends])
        self._met |= _squares(se2.transform(T_map_laser, around))
        few, at = reach[::BESIDE], np.arange(0.0, float(reach.max()), ALONG_M)
        beam, step = np.nonzero(at[None, :] < few[:, None])
        along = ways[::BESIDE][beam] * at[step][:, None]
        self._crossed |= _squares(se2.transform(T_map_laser, along))

    def taken(
        self, *, in_parts: bool = True, empty: Callable[[Bounds], bool] = lambda _: False
    ) -> Iterator[Bounds]:
        """xmin, ymin, xmax, ymax (m) of runs of squares, or of all at once; and forget them.

        empty  whether nothing is drawn there: a beam that crosses such a square changes nothing
        """
        crossed = [key for key in self._crossed - self._met if not empty(_square(key))]
        squares = [_place(key) for key in sorted([*self._met, *crossed])]
        self._met, self._crossed = set(), set()
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


def _squares(points: Float) -> set[int]:
    """One number for each square that has any of the points: it sorts faster than two."""
    column, row = np.floor(points / SQUARE_M).astype(np.int64).T
    return set(np.unique(row * _WIDE + column + _WIDE // 2).tolist())


def _place(key: int) -> tuple[int, int]:
    row, beside = divmod(key, _WIDE)
    return row, beside - _WIDE // 2


def _square(key: int) -> Bounds:
    row, column = _place(key)
    return _bounds(row, column, row, column)


def _bounds(row: int, column: int, last_row: int, last_column: int) -> Bounds:
    x, y = column * SQUARE_M, row * SQUARE_M
    return x, y, (last_column + 1) * SQUARE_M, (last_row + 1) * SQUARE_M
