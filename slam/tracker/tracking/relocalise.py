# SPDX-License-Identifier: Apache-2.0
"""Lost and found: follow every place the robot may be at, until one alone explains what it sees.

Hypotheses come from dead reckoning and from a search of the whole map; each is carried along by
odometry and matched to every scan. Nothing is written to the map meanwhile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted, turned
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.global_search import places
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.rasterise import rasterise
from slam.tracker.tracking.config import RelocaliseConfig


def spread(m: float, rad: float) -> Float:
    """Covariance (3, 3) of these standard deviations of position and heading."""
    return np.diag([m**2, m**2, rad**2])


def coarse(config: RelocaliseConfig) -> Float:
    """Covariance (3, 3) of what a search of the whole map finds."""
    return spread(config.coarse_m, math.radians(config.coarse_deg))


def slip(config: RelocaliseConfig) -> Float:
    """Covariance (3, 3) of a motion that odometry did not see."""
    return spread(config.slipped_m, config.slipped_rad)


def _near(one: Float, other: Float, config: RelocaliseConfig) -> bool:
    x, y, turn = (one - other).tolist()
    return bool(x * x + y * y < config.same_m**2 and abs(se2.wrap(turn)) < config.same_rad)


@dataclass(frozen=True, kw_only=True, eq=False)
class Hypothesis:
    """A place the robot may be at.

    match    of the latest scan there
    support  mean over ``scans`` of matched share times share of the map in view that is confirmed
    seen     mean of the weight that was in view
    """

    match: Match
    support: float
    seen: float
    scans: int = 1
    way_m: float = 0.0
    turned_rad: float = 0.0
    elapsed_s: float = 0.0

    def tried(self, config: RelocaliseConfig, times: float = 1.0) -> bool:
        """Seen from enough places, or for long enough, ``times`` as much as the least."""
        moved = max(
            self.way_m / config.on_m, self.turned_rad / config.on_rad, self.elapsed_s / config.on_s
        )
        return min(self.scans / config.scans, moved) >= times

    def same_as(self, other: Hypothesis, config: RelocaliseConfig) -> bool:
        """Whether both are the same place."""
        return _near(self.match.T_map_robot, other.match.T_map_robot, config)


class Relocalisation:
    """Follows hypotheses from the scan on that found the robot lost."""

    def __init__(self, cell_map: CellMap, matcher: Matcher) -> None:
        self._cell_map = cell_map
        self._matcher = matcher
        self._config = matcher.config.tracking.relocalise
        self.hypotheses: list[Hypothesis] = []
        self.elapsed_s = 0.0
        self._since_search_s = math.inf

    def step(
        self, observations: Observations, prediction: Prediction, here: Match, usual: float
    ) -> Match | None:
        """Take a frame in; the match of the hypothesis that is accepted, or None.

        ``here`` is the frame's match by dead reckoning, ``usual`` the support while not lost.
        """
        self.elapsed_s += prediction.elapsed
        self._since_search_s += prediction.elapsed
        found = [self._carried(h, observations, prediction) for h in self.hypotheses]
        found.append(self._new(observations, here))
        if self._since_search_s >= self._config.again_s and len(observations.points_robot) > 0:
            self._since_search_s = 0.0
            short_term = self._matcher.reward.short_term
            points, most = observations.points_robot, self._config.most
            for place in places(self._cell_map, short_term, points, most):
                match = self._climb(observations, place, coarse(self._config))
                found.append(self._new(observations, match))
        self.hypotheses = _kept(found, usual, self._config)
        return self._accepted(usual, prediction.T_map_robot)

    def _new(self, observations: Observations, match: Match) -> Hypothesis:
        seen = float(observations.weights.sum())
        return Hypothesis(match=match, support=self._support(observations, match), seen=seen)

    def _accepted(self, usual: float, predicted: Float) -> Match | None:
        """The match of the best hypothesis, if it is good and no other is.

        The place of dead reckoning goes before places that only look as good: a room may be
        symmetric, and to be carried through it is rare.
        """
        if not self.hypotheses:
            return None
        best, config = self.hypotheses[0], self._config
        rivals = [h for h in self.hypotheses if h.support > config.alias * best.support]
        going_on = [h for h in rivals if _near(h.match.T_map_robot, predicted, config)]
        if going_on:
            best = going_on[0]
        elif len(rivals) > 1:
            return None
        enough = config.enough_later if best.tried(config, config.later) else config.enough
        enough_seen = best.tried(config) and best.seen >= config.least_weight
        return best.match if enough_seen and best.support >= enough * usual else None

    def _carried(
        self, old: Hypothesis, observations: Observations, prediction: Prediction
    ) -> Hypothesis:
        increment = prediction.increment
        T_map_robot = se2.compose(old.match.T_map_robot, increment)
        tracked = float(prediction.T_map_robot[2]) - float(increment[2])
        covariance = turned(prediction.step, float(old.match.T_map_robot[2]) - tracked)
        match = self._climb(observations, T_map_robot, covariance)
        support = self._support(observations, match)
        scans = old.scans + 1
        return replace(
            old,
            match=match,
            support=old.support + (support - old.support) / scans,
            seen=old.seen + (float(observations.weights.sum()) - old.seen) / scans,
            scans=scans,
            way_m=old.way_m + math.hypot(float(increment[0]), float(increment[1])),
            turned_rad=old.turned_rad + abs(float(increment[2])),
            elapsed_s=old.elapsed_s + prediction.elapsed,
        )

    def _climb(self, observations: Observations, T_map_robot: Float, covariance: Float) -> Match:
        start = self._matcher.approach(self._cell_map, observations, T_map_robot, covariance)
        precision = inverted(covariance)
        return self._matcher.climb(self._cell_map, observations, start, T_map_robot, precision)

    def _support(self, observations: Observations, match: Match) -> float:
        return support(self._cell_map, observations, match)


def support(cell_map: CellMap, observations: Observations, match: Match) -> float:
    """Matched share of the observations times the share of the trace in view that they confirm.

    The second factor distinguishes a corridor from the room beside it: there the beams pass where
    walls are known to be.
    """
    rasterise(cell_map, observations, match.T_map_robot)
    T_map_laser = se2.compose(match.T_map_robot, observations.T_robot_laser)
    confirmed, contradicted, _ = cell_map.integrate(
        observations.view, T_map_laser, 0.0, write=False
    )
    cell_map.release()
    total = confirmed + contradicted
    return match.matched * confirmed / total if total > 0.0 else 0.0


def slipped(
    cell_map: CellMap,
    matcher: Matcher,
    observations: Observations,
    prediction: Prediction,
    usual: float,
) -> Match | None:
    """The place around the prediction that explains a frame about as well as ``usual``.

    A robot that is shoved, or whose wheels slip, moves far beyond what its odometry says; under
    that prior the right place is out of reach. None where too little is in view to decide.
    """
    config = matcher.config.tracking.relocalise
    if float(observations.weights.sum()) < config.least_weight:
        return None
    elapsed = prediction.elapsed
    window = SearchWindow(
        reach_m=min(config.pushed_mps * elapsed, config.farthest_m),
        turn_rad=min(config.pushed_radps * elapsed, config.farthest_rad),
    )
    loose = inverted(slip(config))
    match = matcher.search(cell_map, observations, prediction.T_map_robot, loose, window)
    sure = support(cell_map, observations, match) >= config.sure * usual
    return replace(match, slipped=True) if sure else None


def _kept(found: list[Hypothesis], usual: float, config: RelocaliseConfig) -> list[Hypothesis]:
    """The best first; one of each place, the longest followed; none that is hopeless."""
    kept: list[Hypothesis] = []
    for one in sorted(found, key=lambda h: -h.scans):
        if not any(one.same_as(other, config) for other in kept):
            kept.append(one)
    kept.sort(key=lambda h: -h.support)
    least = config.hopeless * max(usual, kept[0].support)
    return [h for h in kept if h.support >= least]
