# SPDX-License-Identifier: Apache-2.0
"""Large maps in as many cells as a picture has pixels: drawn whole, they take all the memory."""

from __future__ import annotations

import numpy as np

from slam.estimate import Changes, Raster

MOST_CELLS = 2400  # along the longer side: more than our pictures have pixels
_STRIPE = 64  # rows of the result that are made at a time


def small_map(raster: Raster, most: int = MOST_CELLS) -> Raster:
    """``raster`` in fewer cells, each the largest of several: a thin wall stays one.

    The same object where it has no more than ``most`` cells along its longer side.
    """
    n = -(-max(raster.values.shape) // most)
    if n <= 1:
        return raster
    stripes = []
    for first in range(0, raster.values.shape[0], n * _STRIPE):
        part = raster.values[first : first + n * _STRIPE]
        padded = np.pad(part, [(0, -size % n) for size in part.shape], constant_values=np.nan)
        height, width = padded.shape
        blocks = padded.reshape(height // n, n, width // n, n)
        stripes.append(np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1))
    return Raster(
        values=np.vstack(stripes),
        resolution_m=n * raster.resolution_m,
        T_map_origin=raster.T_map_origin,
    )


def small_changes(changes: Changes, most: int = MOST_CELLS) -> Changes:
    """Both layers so."""
    return Changes(appeared=small_map(changes.appeared, most), gone=small_map(changes.gone, most))
