# SPDX-License-Identifier: Apache-2.0
"""The numbers of the occupancy grid, beside those of every tracker."""

from __future__ import annotations

from dataclasses import dataclass, field

from slam.settings import Settings, number
from slam.tracker.config import TrackerConfig
from slam.tracker.standing.config import ALL_VOTE, StandingConfig

OCTOMAP = "Hornung et al. 2013"


@dataclass(frozen=True, kw_only=True)
class GridConfig(Settings):
    """The inverse sensor model, log-odds per scan."""

    hit: float = number(0.85, "log-odds", "added to a cell in which a beam ends: p = 0.7", OCTOMAP)
    miss: float = number(
        -0.4, "log-odds", "added to a cell that a beam passes: p = 0.4", OCTOMAP, low=-1e6, high=0.0
    )
    most: float = number(
        3.5, "log-odds", "largest magnitude of a cell's log-odds: p = 0.97", OCTOMAP, low=1e-3
    )
    struck: float = number(0.6, "input", "least input of a cell where a beam ends")


@dataclass(frozen=True, kw_only=True)
class OccupancyConfig(TrackerConfig):
    """As ``TrackerConfig``, of whose map only ``cell_m`` counts here, and the grid's own.

    Every return has full weight: the grid stays what it is elsewhere.
    """

    standing: StandingConfig = field(default=ALL_VOTE)
    grid: GridConfig = field(default=GridConfig())
