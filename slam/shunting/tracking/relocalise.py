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
from slam.shunting.map.network import Network
from slam.shunting.map.rasterise import stamp
from slam.shunting.matching.global_search import places
from slam.shunting.matching.local_search import SearchWindow
from slam.shunting.matching.matcher import Match, Matcher

MOST = 6  # hypotheses from one search of the map
AGAIN_S = 1.0  # between two searches of the map
COARSE = np.diag([0.1**2, 0.1**2, math.radians(1.5) ** 2])  # of what that search finds
ENOUGH = 0.8  # of the usual support: what an accepted hypothesis has on average,
ENOUGH_LATER, LATER = 0.65, 3.0  # or this much after so many times the least evidence
HOPELESS = 0.6  # of the usual support: below it on average, or of the best one's, it is dropped
ALIAS = 0.9  # a second hypothesis with this share of the best one's support: wait
SCANS, ON_M, ON_RAD, ON_S = 5, 0.3, 0.35, 1.0  # least evidence: scans, and way or turn or time
SAME_M, SAME_RAD = 0.3, 0.2  # nearer hypotheses are one
# Weight in view from which on a frame can deny the map, or tell a place; less may be a few things
# that moved, and fits in many places. The weight is that of ``Observations``: 4 m of surface, less
# of near ones, as no return counts for less than 0.3. So 134 returns always are enough, fewer of a
# small room are not, nor are fewer than 40 features.
TELLING = 40.0
SLIPPED = np.diag([0.2**2, 0.2**2, 0.2**2])  # of a motion that odometry did not see,
SHOVED_MPS, SHOVED_RADPS = 2.0, 3.5  # which is no faster,
FARTHEST_M, FARTHEST_RAD = 0.6, 0.5  # and not searched for farther,
SURE = 0.9  # and leads to a place with so much of the usual support


def _near(one: Float, other: Float) -> bool:
    x, y, turn = (one - other).tolist()
    return bool(x * x + y * y < SAME_M**2 and abs(se2.wrap(turn)) < SAME_RAD)


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

    def tried(self, times: float = 1.0) -> bool:
        """Seen from enough places, or for long enough, ``times`` as much as the least."""
        moved = max(self.way_m / ON_M, self.turned_rad / ON_RAD, self.elapsed_s / ON_S)
        return min(self.scans / SCANS, moved) >= times

    def same_as(self, other: Hypothesis) -> bool:
        """Whether both are the same place."""
        return _near(self.match.T_map_robot, other.match.T_map_robot)


class Recovery:
    """Follows hypotheses from the scan on that found the robot lost."""

    def __init__(self, network: Network, matcher: Matcher) -> None:
        self._network = network
        self._matcher = matcher
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
        if self._since_search_s >= AGAIN_S and len(observations.points_robot) > 0:
            self._since_search_s = 0.0
            short_term = self._matcher.reward.short_term
            for place in places(self._network, short_term, observations.points_robot, MOST):
                match = self._climb(observations, place, COARSE)
                found.append(self._new(observations, match))
        self.hypotheses = _kept(found, usual)
        return self._accepted(usual, prediction.T_map_robot)

    def _new(self, observations: Observations, match: Match) -> Hypothesis:
        seen = float(observations.weights.sum())
        return Hypothesis(match=match, support=self._support(observations, match), seen=seen)

    def _accepted(self, usual: float, predicted: Float) -> Match | None:
        """The match of the best hypothesis, if it is good and no other is.

        Where dead reckoning leads is believed before places that only look as good: a room may be
        symmetric, and to be carried through it is rare.
        """
        if not self.hypotheses:
            return None
        best = self.hypotheses[0]
        rivals = [h for h in self.hypotheses if h.support > ALIAS * best.support]
        going_on = [h for h in rivals if _near(h.match.T_map_robot, predicted)]
        if going_on:
            best = going_on[0]
        elif len(rivals) > 1:
            return None
        enough = ENOUGH_LATER if best.tried(LATER) else ENOUGH
        told = best.tried() and best.seen >= TELLING
        return best.match if told and best.support >= enough * usual else None

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
        start = self._matcher.approach(self._network, observations, T_map_robot, covariance)
        precision = inverted(covariance)
        return self._matcher.climb(self._network, observations, start, T_map_robot, precision)

    def _support(self, observations: Observations, match: Match) -> float:
        return support(self._network, observations, match)


def support(network: Network, observations: Observations, match: Match) -> float:
    """Matched share of the observations times the share of the trace in view that they confirm.

    The second factor is what tells a corridor from the room beside it: there the beams pass where
    walls are known to be.
    """
    stamp(network, observations, match.T_map_robot)
    T_map_laser = se2.compose(match.T_map_robot, observations.T_robot_laser)
    confirmed, contradicted, _ = network.integrate(observations.view, T_map_laser, 0.0, write=False)
    network.release()
    total = confirmed + contradicted
    return match.matched * confirmed / total if total > 0.0 else 0.0


def slipped(
    network: Network,
    matcher: Matcher,
    observations: Observations,
    prediction: Prediction,
    usual: float,
) -> Match | None:
    """The place around the prediction that explains a frame about as well as ``usual``.

    A robot that is shoved, or whose wheels slip, moves far beyond what its odometry says; under
    that prior the right place is out of reach. None where too little is in view to tell.
    """
    if float(observations.weights.sum()) < TELLING:
        return None
    elapsed = prediction.elapsed
    window = SearchWindow(
        reach_m=min(SHOVED_MPS * elapsed, FARTHEST_M),
        turn_rad=min(SHOVED_RADPS * elapsed, FARTHEST_RAD),
    )
    loose = inverted(SLIPPED)
    match = matcher.search(network, observations, prediction.T_map_robot, loose, window)
    sure = support(network, observations, match) >= SURE * usual
    return replace(match, slipped=True) if sure else None


def _kept(found: list[Hypothesis], usual: float) -> list[Hypothesis]:
    """The best first; one of each place, the longest followed; none that is hopeless."""
    kept: list[Hypothesis] = []
    for one in sorted(found, key=lambda h: -h.scans):
        if not any(one.same_as(other) for other in kept):
            kept.append(one)
    kept.sort(key=lambda h: -h.support)
    least = HOPELESS * max(usual, kept[0].support)
    return [h for h in kept if h.support >= least]
