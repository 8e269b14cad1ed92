# SPDX-License-Identifier: Apache-2.0
"""A run's map as pictures and image files hold it: cells joined where there are too many."""

from __future__ import annotations

from dataclasses import dataclass

from slam.estimate import Changes, Raster
from slam.frontend.seen_space import SeenSpace
from slam.rasters import joined, known
from slam.replay import Track

MOST_PIXELS = 1 << 26  # of map.pgm: a square of 245 m at 3 cm, which a map_server holds as 67 MB
MOST_CELLS = 800  # along the longer side; a picture of a map drops cells where it has more


@dataclass(frozen=True, eq=False)
class Drawn:
    """What is known of a map; that and its changes as pictures show them."""

    cells: Raster
    map: Raster
    changes: Changes | None


def drawn(track: Track, most: int = MOST_CELLS) -> Drawn | None:
    """What is known of a track's map in at most ``most`` cells along its longer side, each the
    largest of several: a thin wall stays. None where nothing is known.

    Raises as ``Track.map`` does.
    """
    raster = track.map()
    part = None if raster is None else known(raster)
    if raster is None or part is None:
        return None
    cells = joined(raster, 1, part)
    n = max(-(-max(cells.values.shape) // most), 1)
    changes = track.changes()
    if changes is not None:
        appeared, gone = (
            joined(layer, n, part if layer.values.shape == raster.values.shape else None)
            for layer in (changes.appeared, changes.gone)
        )
        changes = Changes(appeared=appeared, gone=gone)
    return Drawn(cells, joined(cells, n), changes)


def for_file(cells: Raster, seen: SeenSpace) -> tuple[Raster, str]:
    """A map with the space that was seen, such that it fits into one image file, and what to say
    where its cells had to be joined."""
    fitting = seen.merge(cells, MOST_PIXELS)
    if fitting.resolution_m == cells.resolution_m:
        return fitting, ""
    height, width = (fitting.resolution_m * n for n in fitting.values.shape)
    return fitting, (
        f"map.pgm has cells of {fitting.resolution_m:g} m instead of {cells.resolution_m:g} m: "
        f"the map is {width:.0f} m x {height:.0f} m, and the image has {MOST_PIXELS} cells at most."
    )
