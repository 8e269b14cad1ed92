# SPDX-License-Identifier: Apache-2.0
"""From the first scan that does not go on from those before until it is certain where the robot is.

The map of before is kept as it is. Scans that go on from one another are written to a copy of it
and matched there: where boards or people have closed in on the robot, nothing that it sees is in
the map. If the robot turns out to be where its motion led, the copy is the map from then on.
"""

import math

from slam import se2
from slam.arrays import Float
from slam.frontend.observations import Observations
from slam.tracker.belief.places import Places
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import MOST_OFF, used
from slam.tracker.matching.matcher import Match, Matcher, unmatched
from slam.tracker.rasterise import rasterise

MOST_NEW = 2000  # blocks, set by hand: all of the station has 8000, at cells of 3 cm


class Doubt:
    """One of one robot.

    cell_map      as it was before
    places        where else the robot may be
    match         of the latest scan at the place that motion led to
    shares        probabilities of ``places.followed``
    evidence      nats of that scan there, on the map as it was before
    since_near_s  since a slip was searched for
    """

    def __init__(self, cell_map: CellMap, matcher: Matcher) -> None:
        self.cell_map, self._local = cell_map, cell_map
        self.places = Places(cell_map, matcher)
        self.match: Match = unmatched(se2.IDENTITY, matched=0.0, score=0.0)
        self.shares: list[float] = []
        self.evidence, self.since_near_s = 0.0, math.inf

    @property
    def local(self) -> CellMap:
        """The copy; the map itself until something is written."""
        return self._local

    def write(self, observations: Observations, T_map_robot: Float, look: float) -> None:
        """Let the copy see a scan for ``look`` s; begun anew when ``MOST_NEW`` blocks larger."""
        fresh = self._local is self.cell_map
        if fresh or used(self._local.cells) > used(self.cell_map.cells) + MOST_NEW:
            self._local = self.cell_map.twin()
            self._local.off_cm = MOST_OFF  # by how much the map is off is not known
        rasterise(self._local, observations, T_map_robot)
        T_map_laser = se2.compose(T_map_robot, observations.T_robot_laser)
        step = min(look, self._local.config.map.longest_look_s)
        self._local.integrate(observations.view, T_map_laser, step, write=True)
