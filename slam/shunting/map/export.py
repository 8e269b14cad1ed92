# SPDX-License-Identifier: Apache-2.0
"""What a network says as rasters: what exists, and what changed between its two memories."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from slam.estimate import Changes, Raster
from slam.shunting.map.network import Network
from slam.tracker.windows import Window, window

Blocks = NDArray[np.float32]  # (n, 8, 8)


def existence(
    network: Network, bounds: tuple[float, float, float, float] | None = None
) -> Raster | None:
    """The larger of trace and short-term activity relative to saturation; NaN where no neuron
    lives. Within ``bounds`` (xmin, ymin, xmax, ymax, m) or all. None where there is nothing.
    Raises ``InvalidValueError`` where it would be too large for a raster.
    """
    extent = network.raster_extent(bounds)
    if extent is None:
        return None
    found, x, y = _living(network, extent)
    values = np.divide(x, np.float32(network.config.saturation), out=x)
    np.maximum(y, values, out=values)
    np.minimum(values, np.float32(1.0), out=values)
    values[values == 0.0] = np.nan
    return _raster(network, found.spread(values, np.nan), extent)


def changes(
    network: Network, bounds: tuple[float, float, float, float] | None = None
) -> Changes | None:
    """What appeared and what is gone; None for an empty network or one without a trace.

    A constant input I holds x at I / (A + I), so A x / (1 - x) is the input that x speaks of.
    ``bounds`` and errors as of ``existence``.
    """
    extent = network.raster_extent(bounds)
    if extent is None or network.config.trace_s == 0.0:
        return None
    reach = network.config.map.beside_cells
    rim = 0 if bounds is None else reach  # what is beside the part counts as well
    wider = extent[0] - rim, extent[1] - rim, extent[2] + rim, extent[3] + rim
    found, x, y = _living(network, wider)
    lately = np.minimum(np.float32(network.config.decay_per_s) * x / (1.0 - x), np.float32(1.0))
    silent = (x == 0.0) & (y == 0.0)
    inner = np.s_[rim : wider[3] - wider[1] - rim, rim : wider[2] - wider[0] - rim]
    appeared, gone = (
        _raster(network, _beyond(found, one, other, silent, reach)[inner], extent)
        for one, other in ((lately, y), (y, lately))
    )
    return Changes(appeared=appeared, gone=gone)


def _beyond(
    found: Window, one: Blocks, other: Blocks, silent: NDArray[np.bool_], reach: int
) -> NDArray[np.float32]:
    """How much more ``one`` is than the largest of ``other`` within ``reach`` neurons: a wall seen
    one neuron aside is no change. NaN where ``silent`` and where no neuron lives."""
    square = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    around = cv2.dilate(found.spread(other, 0.0), square)
    beyond = found.spread(np.where(silent, np.float32(np.nan), one), np.nan)
    np.subtract(beyond, around, out=beyond)
    np.maximum(beyond, np.float32(0.0), out=beyond)
    return beyond


def _living(network: Network, extent: tuple[int, int, int, int]) -> tuple[Window, Blocks, Blocks]:
    """The blocks among the cells (i0, j0) to before (i1, j1), their x and their y."""
    i0, j0, i1, j1 = extent
    found = window(network.cells, i0, j0, (j1 - j0, i1 - i0))
    return found, network.cells.x[found.slots], network.cells.y[found.slots]


def _raster(
    network: Network, values: NDArray[np.float32], extent: tuple[int, int, int, int]
) -> Raster:
    origin = np.array([extent[0] * network.cell, extent[1] * network.cell, 0.0])
    return Raster(values=values, resolution_m=network.cell, T_map_origin=origin)
