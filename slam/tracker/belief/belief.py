# SPDX-License-Identifier: Apache-2.0
"""Where the robot may be, scan by scan, and all that follows from it.

Three kinds of hypotheses: where motion led, carried to nobody knows where, and other places that
the map knows. A scan that goes on from those before speaks for the motion, one that the map
explains for a place. The pose is that of the motion until a place is taken. docs/belief.md has the
mathematics.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.belief.doubt import Doubt
from slam.tracker.belief.likelihood import MOST_NATS, carried, evidence, probabilities, sum_of
from slam.tracker.belief.places import Place, novelty, spread
from slam.tracker.belief.state import State
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import OFTEN_S, Match, Matcher, near, unmatched
from slam.tracker.rasterise import seen_at
from slam.tracker.standing.agreement import Agreement

STILL = np.diag([1e8, 1e8, 1e8])  # 1/m^2, 1/rad^2: a pose that does not move
MOST_LOST = 100.0  # nats: seven scans that go on end any doubt; set by hand
LEAST_IN_VIEW = 0.6  # share: who was carried sees little of what was in view; set by hand
ENOUGH = 0.5  # of the novelty of a place far away, before it is taken; set by hand


@dataclass(frozen=True, eq=False)
class Judged:
    """What is to be done with a scan.

    match       its pose: that of the motion, or of the place taken
    prediction  as given, or wider after a slip
    cell_map    the map to go on in; ``writes``: it takes the scan in
    followed    whether the pose is a match to a map, be it the copy
    """

    match: Match
    prediction: Prediction
    state: State
    cell_map: CellMap
    writes: bool = False
    followed: bool = True


class Belief:
    """Of one robot.

    p_lost  probability that the pose is wrong
    state   of the latest scan
    busy    share of the latest scan's time that searches for the robot took, roughly: 0, 1/2 or 1
    """

    def __init__(
        self,
        matcher: Matcher,
        match: Callable[[Observations, Prediction, CellMap], Match],
        agreement: Agreement,
    ) -> None:
        """``match`` matches a scan to a map as the SLAM does; ``agreement``: of matches and
        odometry, which is taken on here.
        """
        self._matcher, self._match, self._agreement = matcher, match, agreement
        self._unknown = -MOST_NATS  # nats of having been carried, against where motion led
        self._doubt: Doubt | None = None
        self.p_lost, self.state, self.busy = 0.0, State.TRACKING, 0.0

    def first(self, observations: Observations) -> State:
        """The first scan: the map begins with it."""
        self.state = State.TRACKING if len(observations.points_robot) else State.BLIND
        return self.state

    @property
    def certain(self) -> bool:
        """Whether no other place is followed."""
        return self._doubt is None

    def judge(
        self, cell_map: CellMap, observations: Observations, prediction: Prediction
    ) -> Judged:
        """Where the robot is."""
        judged = self._judged(cell_map, observations, prediction)
        self.state = judged.state
        return judged

    def _judged(
        self, cell_map: CellMap, observations: Observations, prediction: Prediction
    ) -> Judged:
        config, doubt = self._matcher.config, self._doubt
        self.busy = 0.0 if doubt is None else 1.0
        per_h = config.carried_per_h
        before = self._unknown
        self._unknown = sum_of([before, carried(per_h, prediction.elapsed)])
        if doubt is not None:
            doubt.places.lag(self._unknown - before)
        if not len(observations.points_robot):
            return self._blind(cell_map, prediction)
        local = cell_map if doubt is None else doubt.local
        match = near(self._match(observations, prediction, local), prediction)
        if prediction.elapsed <= OFTEN_S:
            self._agreement.take(prediction, match.T_map_robot, observations.mean_weight)
            match = self._undragged(cell_map, observations, match)
        share = self._matcher.usual.share(match, observations)
        least = config.tracking.relocalise.goes_on
        odd = share < least or match.overlapped < least * self._matcher.usual.match
        if doubt is None and odd and per_h > 0.0:
            doubt = Doubt(cell_map, self._matcher)
        if doubt is not None:
            doubt.evidence = doubt.places.evidence(self._on_map(doubt, observations, match))
        goes_on, nats = self._going_on(doubt, observations, match, share)
        self._unknown = min(max(self._unknown - nats, -MOST_NATS), MOST_LOST)
        if goes_on:
            self._matcher.usual.follow(match, observations, prediction.look)
        elif match.tau > 0.0:  # by odometry: what it was matched to says nothing
            by_odometry = unmatched(prediction.T_map_robot, matched=match.matched, score=0.0)
            match = replace(by_odometry, overlapped=match.overlapped)
            if prediction.elapsed <= OFTEN_S:
                self._agreement.drop()
        self._weigh(doubt)
        if doubt is None and self.p_lost <= config.belief.frozen_above:
            return self._settled(cell_map, match, prediction)
        doubt = self._doubt = doubt or Doubt(cell_map, self._matcher)
        doubt.match = match
        return self._searched(doubt, observations, prediction, goes_on)

    def _undragged(self, cell_map: CellMap, observations: Observations, match: Match) -> Match:
        """The match, or where odometry leads: movers carry off what odometry denies, and what does
        not explain clearly more of what is long known.
        """
        config, agreement = self._matcher.config, self._agreement
        if not 0.0 < config.standing.disagreed < agreement.denied or not agreement.is_far:
            return match
        if not observations.tangents.any():  # points: no surface tells whether odometry is right
            return match
        back = unmatched(agreement.led(match.T_map_robot), matched=match.matched, score=0.0)
        old = cell_map if self._doubt is None else self._doubt.cell_map
        if gain_m(old, observations, match, back) >= config.belief.more_m:
            return match
        agreement.put_back()
        return replace(back, overlapped=match.overlapped)

    def _going_on(
        self, doubt: Doubt | None, observations: Observations, match: Match, share: float
    ) -> tuple[bool, float]:
        """Whether a scan goes on from those before, and its nats for where motion led.

        Against it no more than by what it sees through: what is hidden denies nothing.
        """
        config = self._matcher.config
        if observations.amount < config.tracking.relocalise.least_weight:
            return True, 0.0
        nats = evidence(config.belief, share)
        if doubt is None:
            return True, max(nats, 0.0)
        look = seen_at(doubt.cell_map, observations, match.T_map_robot)
        denied_m = look.through - config.belief.hidden_m
        seen = self._matcher.usual.share(match, observations, LEAST_IN_VIEW)
        if seen < config.tracking.relocalise.goes_on and denied_m > look.known:
            nats = min(nats, doubt.evidence)  # the map denies more than it explains
        elif self._unknown > 0.0:  # who was carried away goes on from scans there, too
            nats = min(nats, max(doubt.evidence, 0.0))
        if nats >= 0.0:
            return True, nats
        return False, max(nats, -config.belief.hidden * max(denied_m, 0.0))

    def _on_map(self, doubt: Doubt, observations: Observations, match: Match) -> Match:
        """What a match to the copy is on the map of before the doubt."""
        if doubt.local is doubt.cell_map:
            return match
        there, everyone = match.T_map_robot, observations.weighted(None)
        return self._matcher.climb(doubt.cell_map, everyone, there, there, STILL)

    def _blind(self, cell_map: CellMap, prediction: Prediction) -> Judged:
        """A scan without a return says nothing: odometry alone."""
        match, doubt = unmatched(prediction.T_map_robot, matched=0.0, score=0.0), self._doubt
        if doubt is not None:
            doubt.match = match
            doubt.places.wait(prediction)
        self._weigh(doubt)
        writes = doubt is None
        return Judged(match, prediction, State.BLIND, cell_map, writes=writes, followed=False)

    def learn(self, judged: Judged) -> None:
        """The map took a scan in."""
        self._matcher.usual.learn(judged.match)

    def _settled(self, cell_map: CellMap, match: Match, prediction: Prediction) -> Judged:
        self._doubt = None
        return Judged(match, prediction, State.TRACKING, cell_map, writes=True)

    def _weigh(self, doubt: Doubt | None) -> None:
        """Probabilities of the places that are followed, and of not being where motion led."""
        found = self._unknown - self._matcher.config.belief.best
        places = [] if doubt is None else doubt.places.followed
        weights = [0.0, self._unknown, *(found + place.nats for place in places)]
        of_motion, _, *others = probabilities(weights)
        self.p_lost = max(0.0, 1.0 - of_motion)
        if doubt is not None:
            doubt.shares = others

    def _searched(
        self, doubt: Doubt, observations: Observations, prediction: Prediction, goes_on: bool
    ) -> Judged:
        """Other places are asked, and one is taken if it is certain."""
        config, everyone = self._matcher.config, observations.weighted(None)
        prices, frozen_above = config.matching.budget, config.belief.frozen_above
        lost = self.p_lost > 0.5 or not goes_on
        budget = Budget(prices, prices.lost_share if lost else prices.frozen_share)
        if everyone.amount >= config.tracking.relocalise.least_weight:
            doubt.places.follow(everyone, prediction, budget)
        else:
            doubt.places.wait(prediction)
        found = self._nearby(doubt, everyone, prediction, budget)
        if found is not None and self._is_slip(doubt, found, everyone):
            return self._slipped(doubt, found, prediction)
        if self.p_lost > frozen_above or not goes_on:
            doubt.places.keep(doubt.places.explore(everyone, budget))
        self._weigh(doubt)
        for place, p in zip(doubt.places.followed, doubt.shares, strict=True):
            if p >= 1.0 - frozen_above and self._is_certain(doubt, place, everyone, goes_on):
                return self._relocated(doubt, place, prediction)
        places = doubt.places
        nowhere = places.searches > 0 and all(place.nats <= 0.0 for place in places.followed)
        if (goes_on or nowhere) and self.p_lost <= frozen_above:
            return self._settled(doubt.local, doubt.match, prediction)
        if goes_on:
            doubt.write(observations, doubt.match.T_map_robot, prediction.look)
        state = State.LOST if self.p_lost >= 0.5 else State.FROZEN
        return Judged(doubt.match, prediction, state, doubt.cell_map, followed=goes_on)

    def _nearby(
        self, doubt: Doubt, everyone: Observations, prediction: Prediction, budget: Budget
    ) -> Match | None:
        """The best place as far around as a slip may have led."""
        numbers = self._matcher.config.tracking.relocalise
        doubt.since_near_s += prediction.elapsed
        if doubt.since_near_s < numbers.again_near_s or everyone.amount < numbers.least_near:
            return None
        doubt.since_near_s, self.busy = 0.0, max(self.busy, 0.5)
        every = max(1, len(everyone.points_robot) // numbers.near_points)
        points, shares = everyone.points_robot[::every], everyone.shares[::every] * every
        few = replace(everyone, points_robot=points, shares=shares)
        turn = min(math.pi, max(numbers.near_rad, numbers.near_rad_s * prediction.elapsed))
        loose = inverted(spread(numbers.near_m, turn))
        window = SearchWindow(reach_m=numbers.near_m, turn_rad=turn)
        start = prediction.T_map_robot
        found = self._matcher.search(doubt.cell_map, few, start, loose, window)
        prices, climbed = budget.prices, len(points) + len(everyone.points_robot)
        scored = found.evaluations * len(points)
        budget.spend(prices.bound_ns * scored + prices.climb_ns * climbed)
        return self._matcher.climb(doubt.cell_map, everyone, found.T_map_robot, start, loose)

    def _is_slip(self, doubt: Doubt, found: Match, everyone: Observations) -> bool:
        """Whether the robot slipped to a place nearby, which is certain against one that the map
        does not know, too.
        """
        config, nats = self._matcher.config.belief, doubt.places.evidence(found)
        p = probabilities([0.0, self._unknown, nats - doubt.evidence + math.log(config.slips)])[2]
        sure = min(p, probabilities([0.0, nats])[1]) >= 1.0 - config.frozen_above
        return sure and gain_m(doubt.cell_map, everyone, found, doubt.match) >= config.more_m

    def _is_certain(
        self, doubt: Doubt, place: Place, everyone: Observations, goes_on: bool
    ) -> bool:
        """Whether a likely place far away may be taken: after scans that are new."""
        config = self._matcher.config.belief
        asked = place.scans >= config.again and novelty(place.way) >= ENOUGH
        explained = place.latest > 0.0 and place.waited == 0
        broken = self._unknown > 0.0 or not goes_on
        better = probabilities([0.0, place.latest - doubt.evidence])[1] >= 1.0 - config.frozen_above
        if not (asked and explained and better and broken):
            return False
        if gain_m(doubt.cell_map, everyone, place.match, doubt.match) < config.far_m:
            return False
        here = seen_at(doubt.cell_map, everyone, doubt.match.T_map_robot)
        return here.through - here.known > config.hidden_m  # not only new: something is missing

    def _slipped(self, doubt: Doubt, found: Match, prediction: Prediction) -> Judged:
        """The robot is there, and its map goes on from there."""
        numbers = self._matcher.config.tracking.relocalise
        wide = replace(prediction, covariance=spread(numbers.near_m, numbers.near_rad))
        self._found()
        slipped = replace(found, slipped=True)
        return Judged(slipped, wide, State.TRACKING, doubt.cell_map, writes=True)

    def _relocated(self, doubt: Doubt, place: Place, prediction: Prediction) -> Judged:
        """The robot is at a place far away."""
        self._found()
        return Judged(place.match, prediction, State.RELOCATED, doubt.cell_map)

    def _found(self) -> None:
        self._doubt, self.p_lost, self._unknown = None, 0.0, -MOST_NATS
        self._agreement.forget()

    def spread_about(self, T_map_robot: Float, anywhere: Callable[[Float], Float]) -> Float:
        """(3, 3) that the other places add to the covariance of a pose."""
        total = np.zeros((3, 3))
        if self._doubt is None:
            return total
        for place, p in zip(self._doubt.places.followed, self._doubt.shares, strict=True):
            off = place.match.T_map_robot - T_map_robot
            off[2] = se2.wrap(float(off[2]))
            total += p * np.multiply.outer(off, off)
        # the places that are followed need not be all: who is lost may be anywhere
        return total + self.p_lost * anywhere(T_map_robot)


def gain_m(cell_map: CellMap, observations: Observations, one: Match, other: Match) -> float:
    """m of long-known surface that a scan explains more at one pose than at another: confirmed less
    seen through."""
    there, here = (seen_at(cell_map, observations, at.T_map_robot) for at in (one, other))
    return (there.known - there.through) - (here.known - here.through)
