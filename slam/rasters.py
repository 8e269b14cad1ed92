# SPDX-License-Identifier: Apache-2.0
"""Parts of a raster, and the same in fewer, wider cells: what files and pictures have room for."""

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam._jit import njit
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import Float

_WHOLE = 1e-6  # cells; so near to a whole number is one
Rectangle = tuple[int, int, int, int]  # first row and column, past-the-last row and column


def known(raster: Raster) -> Rectangle | None:
    """Where anything is known; None for nowhere."""
    there = ~np.isnan(raster.values)
    rows, columns = (np.flatnonzero(there.any(axis=axis)) for axis in (1, 0))
    if len(rows) == 0:
        return None
    return int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1


def trimmed(raster: Raster) -> Raster | None:
    """Without its unknown rim; None where nothing is known."""
    part = known(raster)
    return None if part is None else joined(raster, 1, part)


def joined(raster: Raster, n: int, part: Rectangle | None = None) -> Raster:
    """``part`` of it, None: all, in cells ``n`` times as wide, each the largest of several: a thin
    wall stays."""
    if n < 1:
        raise InvalidValueError(f"cells are joined in blocks of >= 1 a side, got {n}")
    low, left, high, right = (0, 0, *raster.values.shape) if part is None else part
    values = raster.values[low:high, left:right]
    if n > 1:
        height, width = values.shape
        out = np.full((-(-height // n), -(-width // n)), np.nan, np.float32)
        given = np.ascontiguousarray(values).view()
        given.setflags(write=False)  # of one type, for one compiled kernel
        _join(out, given, n)
        values = out
    return Raster(
        values=values,
        resolution_m=n * raster.resolution_m,
        T_map_origin=_corner(raster, low, left),
    )


def _corner(raster: Raster, row: int, column: int) -> Float:
    """The pose of a cell's outer corner."""
    x, y, yaw = raster.T_map_origin.tolist()
    cell = raster.resolution_m
    across, up = x / cell, y / cell
    if yaw == 0.0 and max(abs(across - round(across)), abs(up - round(up))) < _WHOLE:
        # whole cells from the map's origin: a product has not the error of a sum
        return np.array([(round(across) + column) * cell, (round(up) + row) * cell, 0.0])
    return se2.compose(raster.T_map_origin, np.array([column * cell, row * cell, 0.0]))


@njit
def _join(out: NDArray[np.float32], values: NDArray[np.float32], n: int) -> None:
    for a in range(values.shape[0]):
        for b in range(values.shape[1]):
            value = values[a, b]
            if not np.isnan(value) and not out[a // n, b // n] >= value:  # out may be NaN
                out[a // n, b // n] = value
