# SPDX-License-Identifier: Apache-2.0
"""What scans say of a place: long-known surface that they confirm, and that they see through.

A return that stops short of a known surface says nothing: something came between. Each cell of the
map counts once for a place, by its most: standing still, or forty looks at one board, add nothing.
"""

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import ANEW, WHOLE, Look, uncounted
from slam.tracker.rasterise import rasterise

ENOUGH_M = 3.0  # of long-known surface: with less, a share of it says little


class Evidence:
    """Of one place, on a map that is not written meanwhile.

    known_m    m of long-known surface that scans confirmed
    through_m  the same that they saw through, as ``cells.Look`` counts it
    latest_m   m of trace that the latest scan confirms, counted before or not
    """

    def __init__(self) -> None:
        self._counted = ANEW
        self.known_m = self.through_m = self.latest_m = 0.0

    def copy(self) -> "Evidence":
        """The same, to be gone on with elsewhere."""
        other = Evidence()
        other._counted = self._counted.copy()
        other.known_m, other.through_m = self.known_m, self.through_m
        return other

    def add(self, cell_map: CellMap, observations: Observations, T_map_robot: Float) -> Look:
        """Take a scan in from that pose."""
        rasterise(cell_map, observations, T_map_robot)
        self._make_room(cell_map)
        T_map_laser = se2.compose(T_map_robot, observations.T_robot_laser)
        look = cell_map.integrate(
            observations.view, T_map_laser, 0.0, write=False, counted=self._counted
        )
        cell_map.release()
        self.known_m += look.known
        self.through_m += look.through
        self.latest_m = look.confirmed * cell_map.cell
        return look

    def _make_room(self, cell_map: CellMap) -> None:
        """The pool of blocks may have grown."""
        slots, before = len(cell_map.cells.free), self._counted
        if before.shape[1] < slots:
            self._counted = uncounted(cell_map.cells)
            if before.shape[1]:
                self._counted[:, : before.shape[1]] = before


def vanished(
    cell_map: CellMap, before: tuple[Observations, Float], now: tuple[Observations, Float]
) -> float:
    """Share of the long-known surface that a scan confirms and the next sees through, by pose.

    Of what the next confirms or sees through (that by w c): what is hidden from it says nothing.
    What stands does not vanish from one scan to the next, and what moves has moved little: next to
    nothing at right poses, and nearly all after a robot was carried elsewhere.
    """
    confirmed, passed = Evidence(), Evidence()
    confirmed.add(cell_map, *before)
    passed.add(cell_map, *now)
    n = len(confirmed._counted[0])  # the pool of blocks may have grown since
    there = confirmed._counted[0]
    stays, gone = (
        float(np.minimum(there, counted[:n]).sum(dtype=np.int64)) / WHOLE * cell_map.cell
        for counted in passed._counted
    )
    return gone / (stays + gone + ENOUGH_M)
