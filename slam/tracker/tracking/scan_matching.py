# SPDX-License-Identifier: Apache-2.0
"""The pose of a frame on a map, from the prediction: a climb, and searches where that is vague."""

from __future__ import annotations

import math
from dataclasses import replace

from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.local_search import Around, SearchWindow
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.tracking.quality import TrackingQuality
from slam.tracker.tracking.shove import best_around, is_denied


class ScanMatching:
    """Eq. (13) with a prior, and what is done where its optimum is not enough.

    ``quality`` knows what is usually matched.
    """

    def __init__(self, config: TrackerConfig, matcher: Matcher, quality: TrackingQuality) -> None:
        self._config, self._matcher, self._quality = config, matcher, quality

    def match(self, cell_map: CellMap, observations: Observations, prediction: Prediction) -> Match:
        """Climb from the prediction; search around it when that is vague or finds too little."""
        predicted, prior = prediction.T_map_robot, prediction.prior
        precision = inverted(prior)
        start = self._matcher.approach(cell_map, observations, predicted, prior)
        match = self._matcher.climb(cell_map, observations, start, predicted, precision)
        numbers = self._config.matching.local
        near, widest = SearchWindow.about(prior, numbers), SearchWindow.widest(numbers)
        good = numbers.good_share * self._quality.usual_match()
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
        if not (match.matched < poor or self._is_silenced(observations)):
            return match
        return self._unshoved(cell_map, observations, prediction, match, around)

    def _is_vague(self, prior: Float) -> bool:
        """Whether the prediction may be off by more than the climb reaches."""
        vague_m = self._config.matching.local.vague_cells * self._config.cell_m
        return math.sqrt(max(prior[0, 0], prior[1, 1])) > vague_m

    def _is_silenced(self, observations: Observations) -> bool:
        """Whether few returns may vote: walls among them would be the sign of a slip."""
        votes = observations.votes
        if votes is None or not len(votes):
            return False
        return float(votes.mean()) < self._config.tracking.relocalise.few_vote

    def _unshoved(
        self,
        cell_map: CellMap,
        observations: Observations,
        prediction: Prediction,
        match: Match,
        around: Around,
    ) -> Match:
        """The place that a shove has led to, where there is one; else ``match``."""
        if not self._quality.is_worth_searching_near():
            return match
        everyone = replace(observations, votes=None)
        there = best_around(cell_map, self._matcher, everyone, prediction, around)
        limits, usual = self._config.tracking.relocalise, self._quality.usual_whole()
        if there is None or not is_denied(cell_map, limits, everyone, match, there, usual):
            return match
        return replace(there, slipped=True)
