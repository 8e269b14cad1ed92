# SPDX-License-Identifier: Apache-2.0
"""A robot that is shoved, or whose wheels slip: it moved beyond what odometry says, but not far."""

from __future__ import annotations

from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.local_search import Around, SearchWindow
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.tracking.config import RelocaliseConfig
from slam.tracker.tracking.relocalise import spread, support


def slip(config: RelocaliseConfig) -> Float:
    """Covariance (3, 3) of a motion that odometry did not see."""
    return spread(config.slipped_m, config.slipped_rad)


def best_around(
    cell_map: CellMap,
    matcher: Matcher,
    observations: Observations,
    prediction: Prediction,
    around: Around | None = None,
) -> Match | None:
    """The best place as far from the prediction as a shove moves; None with too little in view.

    Under odometry's own prior that place is out of reach.
    """
    config = matcher.config.tracking.relocalise
    if float(observations.weights.sum()) < config.least_near:
        return None
    elapsed = prediction.elapsed
    window = SearchWindow(
        reach_m=min(config.pushed_mps * elapsed, config.farthest_m),
        turn_rad=min(config.pushed_radps * elapsed, config.farthest_rad),
    )
    loose = inverted(slip(config))
    return matcher.search(cell_map, observations, prediction.T_map_robot, loose, window, around)


def is_denied(
    cell_map: CellMap,
    config: RelocaliseConfig,
    observations: Observations,
    here: Match,
    found: Match,
    usual: float,
) -> bool:
    """Whether ``found`` explains most of what is ``usual``, and ``here`` far less.

    What came near hides a part of the map, so the right place may have less than usual. That
    ``here`` has far less tells a shove from a crowd.
    """
    there = support(cell_map, observations, found)
    if there < config.sure * usual:
        return False
    return support(cell_map, observations, here) <= config.denied_here * there
