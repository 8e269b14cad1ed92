# SPDX-License-Identifier: Apache-2.0
"""The pose of a frame on a map, from the prediction: a climb, and searches where that is vague."""

from __future__ import annotations

import math

from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.matching.usual import Usual


class ScanMatching:
    """Eq. (13) with a prior, and what is done where its optimum is not enough."""

    def __init__(self, config: TrackerConfig, matcher: Matcher, usual: Usual) -> None:
        self._config, self._matcher, self._usual = config, matcher, usual

    def match(self, cell_map: CellMap, observations: Observations, prediction: Prediction) -> Match:
        """Climb from the prediction; search around it when that is vague or finds too little."""
        predicted, prior = prediction.T_map_robot, prediction.prior
        precision = inverted(prior)
        start = self._matcher.approach(cell_map, observations, predicted, prior)
        match = self._matcher.climb(cell_map, observations, start, predicted, precision)
        numbers = self._config.matching.local
        near, widest = SearchWindow.about(prior, numbers), SearchWindow.widest(numbers)
        good = numbers.good_share * self._usual.match
        poor = numbers.widest_share * good
        around = self._matcher.around(cell_map)
        wanted = self._is_vague(prior) or match.matched < good
        for window, search in ((near, wanted), (widest, True)):
            if not search or (window is widest and match.matched >= poor):
                break
            found = self._matcher.search(
                cell_map, observations, predicted, precision, window, around
            )
            if found.score > match.score:
                match = found
        return match

    def _is_vague(self, prior: Float) -> bool:
        """Whether the prediction may be off by more than the climb reaches."""
        vague_m = self._config.matching.local.vague_cells * self._config.cell_m
        return math.sqrt(max(prior[0, 0], prior[1, 1])) > vague_m
