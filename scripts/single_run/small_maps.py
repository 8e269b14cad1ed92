# SPDX-License-Identifier: Apache-2.0
"""Large maps for files and pictures, in as many cells as those have room for."""

from __future__ import annotations

from dataclasses import dataclass

from slam.estimate import Changes, Raster
from slam.frontend.seen_space import SeenSpace
from slam.replay import Track
from slam.strips import MapStrips, joined_together

MOST_PIXELS = 1 << 26  # of map.pgm: a square of 245 m at 3 cm, which a map_server holds as 67 MB
MOST_CELLS = 800  # along the longer side; a picture of a map drops cells where it has more


@dataclass(frozen=True, eq=False)
class Drawn:
    """A map and its changes as pictures show them.

    n   so many cells a side are one
    """

    cells: MapStrips
    map: Raster
    changes: Changes | None
    n: int


def drawn(track: Track, most: int = MOST_CELLS) -> Drawn | None:
    """What is known of a track's map in at most ``most`` cells along its longer side, each the
    largest of several: a thin wall stays. None where nothing is known.

    Raises as ``Track.map`` does.
    """
    cells = track.map_strips()
    part = None if cells is None else cells.trimmed()
    known = None if cells is None else cells.known()
    if cells is None or part is None or known is None:
        return None
    n = max(-(-max(part.shape) // most), 1)
    changes, found = None, track.changes_strips()
    if found is not None:
        same = [layer.cut(known) if layer.shape == cells.shape else layer for layer in found]
        appeared, gone = joined_together(same, n)
        changes = Changes(appeared=appeared, gone=gone)
    return Drawn(part, part.joined(n).whole(), changes, n)


def for_file(cells: MapStrips, seen: SeenSpace) -> tuple[MapStrips, str]:
    """A map with the space that was seen, such that it fits into one image file, and what to say
    where its cells had to be joined."""
    whole = fitting = seen.merge(cells)
    n = 1
    while fitting.shape[0] * fitting.shape[1] > MOST_PIXELS:
        n += 1
        fitting = seen.merge(cells.joined(n))
    if n == 1:
        return whole, ""
    height, width = whole.shape
    return fitting, (
        f"map.pgm has cells of {fitting.resolution_m:g} m instead of {cells.resolution_m:g} m: "
        f"the map is {width * cells.resolution_m:.0f} m x {height * cells.resolution_m:.0f} m, "
        f"and the image has {MOST_PIXELS} cells at most."
    )
