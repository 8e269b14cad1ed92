# SPDX-License-Identifier: Apache-2.0
"""Lost and found: follow every place the robot may be at, until one alone explains what it sees.

Hypotheses come from dead reckoning and from a search of the whole map; each is carried along by
odometry and matched to the scans. Nothing is written to the map meanwhile. A scan does no more of
this than its budget allows: the search goes on over the scans that follow, and where there are many
hypotheses, they are matched by turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted, turned
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.matching.whole_search import WholeSearch
from slam.tracker.rasterise import rasterise
from slam.tracker.tracking.config import RelocaliseConfig


def spread(m: float, rad: float) -> Float:
    """Covariance (3, 3) of these standard deviations of position and heading."""
    return np.diag([m**2, m**2, rad**2])


def coarse(config: RelocaliseConfig) -> Float:
    """Covariance (3, 3) of what a search of the whole map finds."""
    return spread(config.coarse_m, math.radians(config.coarse_deg))


def _near(one: Float, other: Float, config: RelocaliseConfig) -> bool:
    return _within(one, other, config.same_m, config.same_rad)


def _within(one: Float, other: Float, m: float, rad: float) -> bool:
    x, y, turn = (one - other).tolist()
    return bool(x * x + y * y < m**2 and abs(se2.wrap(turn)) < rad)


@dataclass(frozen=True, kw_only=True, eq=False)
class Hypothesis:
    """A place the robot may be at.

    match    of the latest scan that was matched there, carried on by odometry
    support  mean over ``scans`` of matched share times share of the map in view that is confirmed
    seen     mean of the weight that was in view
    waited   scans since it was matched, ``drift`` (3, 3) what odometry may be off since
    """

    match: Match
    support: float
    seen: float
    scans: int = 1
    way_m: float = 0.0
    turned_rad: float = 0.0
    elapsed_s: float = 0.0
    waited: int = 0
    drift: Float = field(default_factory=lambda: np.zeros((3, 3)))

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
    """Follows hypotheses from the scan on that found the robot lost.

    hypotheses  places that are followed, the best first
    elapsed_s   since then
    searches    of the whole map that were finished, all their places tried
    here        support of the place of dead reckoning in the latest scan
    spent_ns    work of the latest scan, counted
    accepted    support of the hypothesis that was accepted, 0 before
    """

    def __init__(self, cell_map: CellMap, matcher: Matcher) -> None:
        self._cell_map = cell_map
        self._matcher = matcher
        self._config = matcher.config.tracking.relocalise
        self._prices = matcher.config.matching.budget
        self.hypotheses: list[Hypothesis] = []
        self.elapsed_s, self.searches, self.here = 0.0, 0, 0.0
        self.spent_ns, self.accepted, self.went_on = 0.0, 0.0, False
        self._coarse: CoarseMap | None = None
        self._search: WholeSearch | None = None
        self._since_search_s = math.inf
        self._places: list[Float] = []  # that the search found and that are to be tried
        self._motion, self._drift = np.zeros(3), np.zeros((3, 3))  # since the scan searched for

    def look(self, observations: Observations, prediction: Prediction) -> None:
        """Take in a frame that is denied: the robot may be lost, and the search begins."""
        self._go_on(prediction)
        budget = Budget(self._prices, self._prices.frozen_share)
        self._look_around(observations, budget)
        self.spent_ns = budget.spent_ns

    def step(
        self,
        observations: Observations,
        prediction: Prediction,
        here: Match | None,
        usual: float,
        *,
        carried: bool,
    ) -> Match | None:
        """Take a frame in; the match of the hypothesis that is accepted, or None.

        ``here`` is the frame's match by dead reckoning, None where nobody says where the robot
        started; ``usual`` the support while not lost.
        """
        self.elapsed_s += prediction.elapsed
        self._go_on(prediction)
        budget = Budget(self._prices, self._prices.lost_share)
        price = self._prices.climb_ns * max(len(observations.points_robot), 1)
        most = max(1, int(self._prices.known_share * budget.left_ns / price))
        turns = sorted(self.hypotheses[1:], key=lambda h: -h.waited)
        matched = [id(h) for h in (self.hypotheses[:1] + turns)[:most]]
        found = [
            self._carried(h, observations, prediction)
            if id(h) in matched
            else self._waiting(h, prediction)
            for h in self.hypotheses
        ]
        if here is not None:
            found.append(self._new(observations, here))
            self.here = found[-1].support
        budget.spend(price * len(matched))
        found += self._tried_places(observations, budget, price)
        self._look_around(observations, budget)
        found += self._tried_places(observations, budget, price)
        self.spent_ns = budget.spent_ns
        self.hypotheses = _kept(found, usual, self._config)
        return self._accepted(usual, None if here is None else prediction.T_map_robot, carried)

    def elsewhere(self, T_map_robot: Float) -> float:
        """Support of the best place that is followed and is not this one; 0 where none is."""
        others = [
            h.support
            for h in self.hypotheses
            if not _near(h.match.T_map_robot, T_map_robot, self._config)
        ]
        return max(others, default=0.0)

    def _go_on(self, prediction: Prediction) -> None:
        """The robot has moved on since the scan that is searched for."""
        self._since_search_s += prediction.elapsed
        tracked = float(prediction.T_map_robot[2]) - float(prediction.increment[2])
        step = turned(prediction.step, -tracked)
        self._drift = se2.propagate(self._drift, self._motion, prediction.increment, step)
        self._motion = se2.compose(self._motion, prediction.increment)

    def _look_around(self, observations: Observations, budget: Budget) -> None:
        """Go on with the search of the whole map, or begin one for this scan."""
        idle = self._search is None and not self._places
        if idle and self._since_search_s >= self._config.again_s and len(observations.points_robot):
            if self._coarse is None:
                self._coarse = CoarseMap(self._cell_map, self._matcher.reward.short_term)
            whole = self._matcher.config.matching.whole
            points = observations.points_robot
            self._search = WholeSearch(self._coarse, points, self._config.most, whole)
            self._since_search_s = 0.0
            self._motion, self._drift = np.zeros(3), np.zeros((3, 3))
        if self._search is not None and budget.left_ns > 0.0:
            self._places += self._search.advance(budget)
            if self._search.done:
                self._search = None
                self.searches += not self._places

    def _tried_places(
        self, observations: Observations, budget: Budget, price: float
    ) -> list[Hypothesis]:
        """Hypotheses of the places found, carried on to this scan, as many as the budget allows."""
        found = []
        while self._places and budget.left_ns > 0.0:
            place = self._places.pop(0)
            covariance = se2.propagate(coarse(self._config), place, self._motion, self._drift)
            here = se2.compose(place, self._motion)
            found.append(self._new(observations, self._climb(observations, here, covariance)))
            few = min(len(observations.points_robot), self._matcher.numbers.climb.few)
            budget.spend(price + few * self._prices.approach_ns)
            self.searches += self._search is None and not self._places
        return found

    def _new(self, observations: Observations, match: Match) -> Hypothesis:
        seen = float(observations.weights.sum())
        return Hypothesis(match=match, support=self._support(observations, match), seen=seen)

    def _accepted(self, usual: float, predicted: Float | None, carried: bool) -> Match | None:
        """The match of the best hypothesis, if it is good and no other is.

        The place of dead reckoning goes before places that only look as good: a room may be
        symmetric, and to be carried through it is rare.
        """
        if not self.hypotheses:
            return None
        best, config, self.went_on = self.hypotheses[0], self._config, False
        rivals = [h for h in self.hypotheses if h.support > config.alias * best.support]
        going_on = None if predicted is None else self._going_on(rivals, predicted)
        if going_on is not None:
            best = going_on
        elif len(rivals) > 1 or not (
            carried
            or predicted is None
            or self._drifted(best, predicted)
            or self._outweighs(best, usual)
        ):
            return None
        if best.waited or (going_on is None and not self.searches):
            return None  # not sure yet that nothing else explains it
        known = going_on is not None or best.tried(config, config.later)
        enough = config.enough_later if known else config.enough
        if best.tried(config, config.last) and self._alone(best):
            enough = config.enough_last
        enough_seen = best.tried(config) and best.seen >= config.least_weight
        if not enough_seen or best.support < enough * usual:
            return None
        self.accepted = best.support
        return best.match

    def _going_on(self, rivals: list[Hypothesis], predicted: Float) -> Hypothesis | None:
        """The place of dead reckoning, else the best of those that a shove leads to."""
        config = self._config
        for one in rivals:
            if _near(one.match.T_map_robot, predicted, config):
                self.went_on = True
                return one
        return next((one for one in rivals if self._shoved(one, predicted)), None)

    def _alone(self, best: Hypothesis) -> bool:
        """Whether nothing else explains nearly as much, though less than usual is explained."""
        others = (h.support for h in self.hypotheses if h is not best)
        return max(others, default=0.0) <= self._config.alone * best.support

    def _outweighs(self, best: Hypothesis, usual: float) -> bool:
        """Whether a place was followed for so long, and explains so much more than dead reckoning,
        that the robot was carried there, though each of its scans agrees with the one before.
        """
        config = self._config
        tried, denied = best.tried(config, config.last), config.denied_here * best.support
        return tried and self.here < denied and best.support >= config.enough_later * usual

    def _drifted(self, best: Hypothesis, predicted: Float) -> bool:
        """Whether drift alone may have led from that place to the one of dead reckoning."""
        config = self._config
        return _within(best.match.T_map_robot, predicted, config.drift_m, config.drift_rad)

    def _shoved(self, one: Hypothesis, predicted: Float) -> bool:
        """Whether a shove alone may have done so."""
        config = self._config
        return _within(one.match.T_map_robot, predicted, config.farthest_m, config.farthest_rad)

    def _carried(
        self, old: Hypothesis, observations: Observations, prediction: Prediction
    ) -> Hypothesis:
        moved = self._waiting(old, prediction)
        match = self._climb(observations, moved.match.T_map_robot, moved.drift)
        support = self._support(observations, match)
        scans = old.scans + 1
        return replace(
            moved,
            match=match,
            support=old.support + (support - old.support) / scans,
            seen=old.seen + (float(observations.weights.sum()) - old.seen) / scans,
            scans=scans,
            waited=0,
            drift=np.zeros((3, 3)),
        )

    def _waiting(self, old: Hypothesis, prediction: Prediction) -> Hypothesis:
        """Carried on by odometry alone."""
        increment, before = prediction.increment, old.match.T_map_robot
        tracked = float(prediction.T_map_robot[2]) - float(increment[2])
        if old.waited:
            drift = se2.propagate(old.drift, before, increment, turned(prediction.step, -tracked))
        else:
            drift = turned(prediction.step, float(before[2]) - tracked)
        return replace(
            old,
            match=replace(old.match, T_map_robot=se2.compose(before, increment)),
            way_m=old.way_m + math.hypot(float(increment[0]), float(increment[1])),
            turned_rad=old.turned_rad + abs(float(increment[2])),
            elapsed_s=old.elapsed_s + prediction.elapsed,
            waited=old.waited + 1,
            drift=drift,
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
    confirmed, contradicted = in_view(cell_map, observations, match)
    total = confirmed + contradicted
    return match.matched * confirmed / total if total > 0.0 else 0.0


def in_view(cell_map: CellMap, observations: Observations, match: Match) -> tuple[float, float]:
    """What of the trace in view a frame confirms there, and what it contradicts; writes nothing."""
    rasterise(cell_map, observations, match.T_map_robot)
    T_map_laser = se2.compose(match.T_map_robot, observations.T_robot_laser)
    confirmed, contradicted, _ = cell_map.integrate(
        observations.view, T_map_laser, 0.0, write=False
    )
    cell_map.release()
    return confirmed, contradicted


def _kept(found: list[Hypothesis], usual: float, config: RelocaliseConfig) -> list[Hypothesis]:
    """The best first; one of each place, the longest followed; none that is hopeless."""
    kept: list[Hypothesis] = []
    for one in sorted(found, key=lambda h: -h.scans):
        if not any(one.same_as(other, config) for other in kept):
            kept.append(one)
    kept.sort(key=lambda h: -h.support)
    least = config.hopeless * max(usual, kept[0].support if kept else 0.0)
    return [h for h in kept if h.support >= least]
