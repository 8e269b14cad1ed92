# SPDX-License-Identifier: Apache-2.0
"""A lost robot goes on tracking, in a map of what it has seen since it is lost.

Where boards or people have closed in on the robot, nothing that it sees is in the map, and the
robot is where it is believed to be. Dead reckoning would lose it then. Its scans still agree with
one another, so they are matched to each other: that is as good as any odometry by scans. The map
itself is neither matched nor written for this.

This also tells whether the robot was *carried*: whoever is carried sees all of its surroundings
change at once. While each scan agrees with the one before, the robot can only be where its motion
leads it. Another place is believed only after long, where it explains far more.
"""

from __future__ import annotations

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.tracker.cell_map import CellMap
from slam.tracker.rasterise import rasterise


class Wake:
    """The map as it was when it first denied a scan, and what was seen since.

    map       a copy of the SLAM's map, written as if nothing were wrong
    carried   whether a scan did not agree with those before it
    followed  whether the latest scan was matched to those before it
    agreed    scans in a row that agreed with it as well as usual, for ``agreed_s``
    """

    def __init__(self, cell_map: CellMap) -> None:
        self.map = cell_map.twin()
        self.carried = self.followed = False
        self.agreed_s, self.agreed = 0.0, 0

    def add(self, observations: Observations, T_map_robot: Float, elapsed: float) -> None:
        """Take in a scan from where it was seen."""
        rasterise(self.map, observations, T_map_robot)
        T_map_laser = se2.compose(T_map_robot, observations.T_robot_laser)
        step = min(elapsed, self.map.config.map.longest_look_s)
        self.map.integrate(observations.view, T_map_laser, step, write=True)

    def count(self, agrees: bool, elapsed: float) -> None:
        """Another scan that agrees with it as well as usual, or one that does not."""
        self.agreed = self.agreed + 1 if agrees else 0
        self.agreed_s = self.agreed_s + elapsed if agrees else 0.0
