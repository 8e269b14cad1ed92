# SPDX-License-Identifier: Apache-2.0
"""What a network says as rasters: what exists, and what changed between its two memories."""

import cv2
import numpy as np

from slam.arrays import Bools, Float32
from slam.estimate import Changes, Raster
from slam.tracker.network import Network
from slam.tracker.windows import Window, window

Blocks = Float32  # (n, 8, 8)


def existence(network: Network) -> Raster | None:
    """The larger of trace and short-term activity relative to saturation; NaN where no neuron
    lives. None where there is nothing. Cells are wider where it would be too large for a raster.
    """
    extent = network.extent()
    if extent is None:
        return None
    found, x, y = _living(network, extent)
    values = np.divide(x, np.float32(network.config.saturation), out=x)
    np.maximum(y, values, out=values)
    np.minimum(values, np.float32(1.0), out=values)
    values[values == 0.0] = np.nan
    n = network.coarseness(extent)
    return network.raster(found.spread(values, np.nan, n), extent, n)


def changes(network: Network) -> Changes | None:
    """What appeared and what is gone; None for an empty network, one without a trace, and one too
    large for a raster of its own cells.

    A constant input I holds x at I / (A + I), so A x / (1 - x) is the input that x speaks of.
    """
    extent = network.extent()
    if extent is None or network.config.trace_s == 0.0 or network.coarseness(extent) > 1:
        return None
    found, x, y = _living(network, extent)
    lately = np.minimum(np.float32(network.config.decay_per_s) * x / (1.0 - x), np.float32(1.0))
    silent, reach = (x == 0.0) & (y == 0.0), network.config.map.beside_cells
    appeared, gone = (
        network.raster(_beyond(found, one, other, silent, reach), extent)
        for one, other in ((lately, y), (y, lately))
    )
    return Changes(appeared=appeared, gone=gone)


def _beyond(found: Window, one: Blocks, other: Blocks, silent: Bools, reach: int) -> Float32:
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
