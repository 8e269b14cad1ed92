# SPDX-License-Identifier: Apache-2.0
"""The best place for a scan as far around as a slip may have led."""

from dataclasses import replace

from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.belief.places import spread
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.standing.agreement import Agreement
from slam.tracker.uncertainty.residuals import look


def best_nearby(
    matcher: Matcher,
    agreement: Agreement,
    cell_map: CellMap,
    observations: Observations,
    prediction: Prediction,
) -> Match:
    """By all returns, around the pose that is predicted.

    Where the old surface in view from there shows nothing of a direction, the place is not moved
    in it: along a bare corridor a scan among people fits best somewhere, and that says nothing.
    """
    numbers, config = matcher.config.tracking.relocalise, matcher.config.belief
    every = max(1, len(observations.points_robot) // numbers.near_points)
    points, weights = observations.points_robot[::every], observations.weights[::every] * every
    few = replace(observations, points_robot=points, weights=weights)
    slip = spread(config.slip_m, config.slip_rad)
    loose, start = inverted(slip), prediction.T_map_robot
    window = SearchWindow(reach_m=numbers.near_m, turn_rad=numbers.near_rad)
    found = matcher.search(cell_map, few, start, loose, window)
    found = matcher.climb(cell_map, observations, found.T_map_robot, start, loose)
    times, short_term = (prediction.elapsed, 0.0), matcher.reward.short_term
    old = look(cell_map, short_term, observations, found.T_map_robot, times, 0).old
    shown = inverted(prediction.covariance + agreement.shown(slip, old))
    return matcher.climb(cell_map, observations, found.T_map_robot, start, shown)
