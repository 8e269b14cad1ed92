# SPDX-License-Identifier: Apache-2.0
"""What a network says as rasters: what exists, and what changed between its two memories."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam.estimate import Changes, Raster
from slam.shunting.map.network import Network
from slam.tracker.cells import dense


def existence(network: Network) -> Raster | None:
    """The larger of trace and short-term activity relative to saturation; NaN where no neuron
    lives. None for an empty network. Raises ``InvalidValueError`` where it would be
    too large for a raster.
    """
    found = _whole(network)
    if found is None:
        return None
    x, y = found
    values = np.minimum(np.maximum(y, x / np.float32(network.config.saturation)), np.float32(1.0))
    values[values == 0.0] = np.nan
    return _raster(network, values)


def changes(network: Network) -> Changes | None:
    """What appeared and what is gone; None for an empty network or one without a trace.

    A constant input I holds x at I / (A + I), so A x / (1 - x) is the input that x speaks of.
    """
    found = _whole(network)
    if found is None or network.config.trace_s == 0.0:
        return None
    x, y = found
    lately = np.minimum(np.float32(network.config.decay_per_s) * x / (1.0 - x), np.float32(1.0))
    reach = network.config.map.beside_cells
    appeared, gone = lately - _around(y, reach), y - _around(lately, reach)
    for layer in (appeared, gone):
        np.maximum(layer, np.float32(0.0), out=layer)
        layer[(x == 0.0) & (y == 0.0)] = np.nan
    return Changes(appeared=_raster(network, appeared), gone=_raster(network, gone))


def _around(values: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
    """The largest value within ``reach`` neurons: a wall seen one neuron aside is no change."""
    for axis in (0, 1):
        padded = np.pad(values, [(reach, reach) if k == axis else (0, 0) for k in (0, 1)])
        n = values.shape[axis]
        values = np.max([padded.take(range(k, k + n), axis) for k in range(2 * reach + 1)], axis=0)
    return values


def _whole(network: Network) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
    extent = network.raster_extent()
    if extent is None:
        return None
    i0, j0, i1, j1 = extent
    return dense(network.cells, i0, j0, (j1 - j0, i1 - i0))


def _raster(network: Network, values: NDArray[np.float32]) -> Raster:
    extent = network.extent()
    assert extent is not None
    origin = np.array([extent[0] * network.cell, extent[1] * network.cell, 0.0])
    return Raster(values=values, resolution_m=network.cell, T_map_origin=origin)
