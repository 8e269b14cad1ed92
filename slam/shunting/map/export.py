# SPDX-License-Identifier: Apache-2.0
"""What a network says as rasters: what exists, and what changed between its two memories."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam.estimate import Changes, Raster
from slam.shunting.map.network import Network
from slam.tracker.cells import dense


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
    x, y = _dense(network, extent)
    values = np.divide(x, np.float32(network.config.saturation), out=x)
    np.maximum(y, values, out=values)
    np.minimum(values, np.float32(1.0), out=values)
    values[values == 0.0] = np.nan
    return _raster(network, values, extent)


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
    x, y = _dense(network, (extent[0] - rim, extent[1] - rim, extent[2] + rim, extent[3] + rim))
    lately = np.minimum(np.float32(network.config.decay_per_s) * x / (1.0 - x), np.float32(1.0))
    appeared, gone = lately - _around(y, reach), y - _around(lately, reach)
    for layer in (appeared, gone):
        np.maximum(layer, np.float32(0.0), out=layer)
        layer[(x == 0.0) & (y == 0.0)] = np.nan
    inner = np.s_[rim : x.shape[0] - rim, rim : x.shape[1] - rim]
    appeared, gone = appeared[inner], gone[inner]
    return Changes(appeared=_raster(network, appeared, extent), gone=_raster(network, gone, extent))


def _around(values: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
    """The largest value within ``reach`` neurons: a wall seen one neuron aside is no change."""
    for axis in (0, 1):
        padded = np.pad(values, [(reach, reach) if k == axis else (0, 0) for k in (0, 1)])
        n = values.shape[axis]
        values = padded[:n] if axis == 0 else padded[:, :n]
        values = values.copy()
        for k in range(1, 2 * reach + 1):  # one by one: a stack of them would be all the memory
            beside = padded[k : k + n] if axis == 0 else padded[:, k : k + n]
            np.maximum(values, beside, out=values)
    return values


def _dense(
    network: Network, extent: tuple[int, int, int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """x and y of the cells (i0, j0) to before (i1, j1)."""
    i0, j0, i1, j1 = extent
    return dense(network.cells, i0, j0, (j1 - j0, i1 - i0))


def _raster(
    network: Network, values: NDArray[np.float32], extent: tuple[int, int, int, int]
) -> Raster:
    origin = np.array([extent[0] * network.cell, extent[1] * network.cell, 0.0])
    return Raster(values=values, resolution_m=network.cell, T_map_origin=origin)
