# SPDX-License-Identifier: Apache-2.0
"""The pose of a frame on a map, from the prediction: a climb, and searches where that is vague."""

from __future__ import annotations

import math
from dataclasses import replace

from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.belief.places import spread
from slam.tracker.belief.posterior import Odds
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.matching.usual import Usual


class ScanMatching:
    """Eq. (13) with a prior, and what is done where its optimum is not enough."""

    def __init__(self, config: TrackerConfig, matcher: Matcher, usual: Usual) -> None:
        self._config, self._matcher, self._usual = config, matcher, usual
        self._odds = Odds(config.belief, config.carried_per_h)

    def match(self, cell_map: CellMap, observations: Observations, prediction: Prediction) -> Match:
        """Climb from the prediction; search around it when that is vague or finds too little.

        Where too little is found, wheels may have slipped: it is searched as after a slip, and what
        that finds has to be better by the price of a slip.
        """
        predicted, prior = prediction.T_map_robot, prediction.prior
        precision = inverted(prior)
        start = self._matcher.approach(cell_map, observations, predicted, prior)
        match = self._matcher.climb(cell_map, observations, start, predicted, precision)
        numbers, belief = self._config.matching.local, self._config.belief
        good, vague = numbers.good_share * self._usual.match, self._is_vague(prior)
        if match.matched >= good and not vague:
            return match
        near, widest = SearchWindow.about(prior, numbers), SearchWindow.widest(numbers)
        slip = inverted(prior + spread(belief.slip_m, belief.slip_rad))
        slipped = self._odds.slipped(math.hypot(*prediction.increment[:2].tolist()), 0.0, 0.0)
        around = self._matcher.around(cell_map)
        for window, about, nats, enough in (
            (near, precision, 0.0, math.inf if vague else 0.0),
            (near, slip, slipped, good),
            (widest, precision, 0.0, numbers.widest_share * good),
        ):
            if match.matched >= enough:
                continue
            found = self._matcher.search(cell_map, observations, predicted, about, window, around)
            if found.score + nats > match.score:
                match = replace(found, score=found.score + nats)
        return match

    def _is_vague(self, prior: Float) -> bool:
        """Whether the prediction may be off by more than the climb reaches."""
        vague_m = self._config.matching.local.vague_cells * self._config.cell_m
        return math.sqrt(max(prior[0, 0], prior[1, 1])) > vague_m
