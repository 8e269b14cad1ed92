# SPDX-License-Identifier: Apache-2.0
"""Other places where the robot may be, each followed from scan to scan.

They come from a search of the whole map; each is carried along by odometry and matched to the
scans, which say how much of them the map explains there. A scan does no more of this than its
budget allows: the search goes on over the scans that follow, and where there are many places, they
are matched by turns.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, turned
from slam.tracker.belief.config import RelocaliseConfig
from slam.tracker.belief.likelihood import evidence
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.matching.whole_search import WholeSearch

ANEW = np.array([0.3, 0.35, 1.0])  # m, rad or s moved: another scan is as good as new; by hand
MOST_ANEW = 4.0  # scans: further ones see the same surfaces again; set by hand
LEAST = 1e-3  # share: numerical guard


def spread(m: float, rad: float) -> Float:
    """Covariance (3, 3) of these standard deviations of position and heading."""
    return np.diag([m**2, m**2, rad**2])


def coarse(config: RelocaliseConfig) -> Float:
    """Covariance (3, 3) of what a search of the whole map finds."""
    return spread(config.coarse_m, math.radians(config.coarse_deg))


def is_same(one: Match, other: Match) -> bool:
    """Nearer than what a match may be off."""
    x, y, turn = (one.T_map_robot - other.T_map_robot).tolist()
    return bool(np.hypot(x, y) < 0.1 and abs(se2.wrap(turn)) < 0.05)


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """One where the robot may be.

    match    of the latest scan that was matched there, carried on by odometry
    evidence nats of all scans that were, for this place against none that is known, each by what
             was new of it; ``anew``: how many new ones they are
    latest   nats of the latest of them
    scans    that were matched there; ``way`` (3,) m, rad and s moved since the first of them
    asked    (3,) m, rad and s moved since the latest
    lag      nats by which the unknown has grown since by its prior: who is carried now has seen
             nothing there
    waited   scans since then, ``drift`` (3, 3) what odometry may be off since
    """

    match: Match
    evidence: float = 0.0
    anew: float = 1.0
    latest: float = 0.0
    lag: float = 0.0
    scans: int = 1
    way: Float = field(default_factory=lambda: np.zeros(3))
    asked: Float = field(default_factory=lambda: np.zeros(3))
    waited: int = 0
    drift: Float = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def nats(self) -> float:
        """Of the place: after a few new scans, more of them see the same surfaces again."""
        return self.evidence / self.anew * min(self.anew, MOST_ANEW) - self.lag

    def asked_again(self, new: float, nats: float, **changes: Any) -> "Place":
        """After one more scan, so much of which is new; with other ``changes``."""
        evidence, anew = self.evidence + new * nats, self.anew + new
        return replace(self, evidence=evidence, anew=anew, **changes)

    def is_at(self, T_map_robot: Float, config: RelocaliseConfig) -> bool:
        """Whether that is the same place."""
        x, y, turn = (self.match.T_map_robot - T_map_robot).tolist()
        near = x * x + y * y < config.same_m**2
        return bool(near and abs(se2.wrap(turn)) < config.same_rad)


class Places:
    """The places that are followed from one scan on, on a map that is not written meanwhile.

    followed  in no order
    searches  of the whole map that were finished, all their places tried
    """

    def __init__(self, cell_map: CellMap, matcher: Matcher) -> None:
        self._cell_map, self._matcher = cell_map, matcher
        self._config = matcher.config.tracking.relocalise
        self._prices = matcher.config.matching.budget
        self.followed: list[Place] = []
        self.searches = 0
        self._coarse: CoarseMap | None = None
        self._search: WholeSearch | None = None
        self._since_search_s = math.inf
        self._found: list[Float] = []  # by the search, to be tried
        self._motion, self._drift = np.zeros(3), np.zeros((3, 3))  # since the scan searched for

    def follow(self, observations: Observations, prediction: Prediction, budget: Budget) -> None:
        """Follow all to the next scan."""
        self._go_on(prediction)
        left = (1.0 - self._prices.known_share) * budget.left_ns
        moved: dict[int, Place] = {}
        for place in sorted(self.followed, key=lambda place: -place.waited):
            waiting = self._waiting(place, prediction)
            if moved and budget.left_ns <= left:
                moved[id(place)] = waiting
            else:
                moved[id(place)] = self._matched(waiting, observations, budget)
        self.followed = [moved[id(place)] for place in self.followed]

    def explore(self, observations: Observations, budget: Budget) -> list[Place]:
        """Go on with the search of the whole map, after ``follow``; places that are new."""
        new = self._tried(observations, budget)
        self._look_around(observations, budget)
        return new + self._tried(observations, budget)

    def wait(self, prediction: Prediction) -> None:
        """Carry all on by odometry."""
        self._go_on(prediction)
        self.followed = [self._waiting(place, prediction) for place in self.followed]

    def lag(self, nats: float) -> None:
        """The unknown has grown by its prior."""
        self.followed = [replace(place, lag=place.lag + nats) for place in self.followed]

    def keep(self, new: list[Place]) -> None:
        """Follow the best, one of each place, the likeliest; none that is hopeless.

        Of places at the same pose, the one that more scans were asked of.
        """
        apart: list[Place] = []
        for place in sorted(self.followed + new, key=lambda one: -one.scans):
            if not any(is_same(place.match, other.match) for other in apart):
                apart.append(place)
        kept: list[Place] = []
        for place in sorted(apart, key=lambda one: -one.nats):
            at = place.match.T_map_robot
            if not any(other.is_at(at, self._config) for other in kept):
                kept.append(place)
        least = kept[0].nats - self._matcher.config.belief.hopeless if kept else 0.0
        self.followed = [one for one in kept if one.nats >= least][: self._config.most]

    def evidence(self, match: Match) -> float:
        """Nats of a scan matched to the map, against a place that the map does not know."""
        config, usual = self._matcher.config.belief, max(self._matcher.usual.match, LEAST)
        return evidence(config, match.overlapped / usual) - config.new

    def _go_on(self, prediction: Prediction) -> None:
        """The robot has moved on since the scan that is searched for."""
        self._since_search_s += prediction.elapsed
        tracked = float(prediction.T_map_robot[2]) - float(prediction.increment[2])
        step = turned(prediction.step, -tracked)
        self._drift = se2.propagate(self._drift, self._motion, prediction.increment, step)
        self._motion = se2.compose(self._motion, prediction.increment)

    def _look_around(self, observations: Observations, budget: Budget) -> None:
        """Go on with the search of the whole map, or begin one for this scan."""
        idle = self._search is None and not self._found
        if idle and self._since_search_s >= self._config.again_s and len(observations.points_robot):
            if self._coarse is None:
                self._coarse = CoarseMap(self._cell_map, self._matcher.reward.short_term)
            whole = self._matcher.config.matching.whole
            points = observations.points_robot
            self._search = WholeSearch(self._coarse, points, self._config.most, whole)
            self._since_search_s = 0.0
            self._motion, self._drift = np.zeros(3), np.zeros((3, 3))
        if self._search is not None and budget.left_ns > 0.0:
            self._found += self._search.advance(budget)
            if self._search.done:
                self._search = None
                self.searches += not self._found

    def _tried(self, observations: Observations, budget: Budget) -> list[Place]:
        """Places found, carried on to this scan, as many as the budget allows."""
        new = []
        while self._found and budget.left_ns > 0.0:
            place = self._found.pop(0)
            covariance = se2.propagate(coarse(self._config), place, self._motion, self._drift)
            here = se2.compose(place, self._motion)
            match = self._climb(observations, here, covariance, budget)
            few = min(len(observations.points_robot), self._matcher.numbers.climb.few)
            budget.spend(self._prices.approach_ns * few)
            nats = self.evidence(match)
            new.append(Place(match=match, evidence=nats, latest=nats))
            self.searches += self._search is None and not self._found
        return new

    def _matched(self, moved: Place, observations: Observations, budget: Budget) -> Place:
        """A scan says the less the less the robot has moved since the one before."""
        match = self._climb(observations, moved.match.T_map_robot, moved.drift, budget)
        latest, new = self.evidence(match), novelty(moved.asked)
        return moved.asked_again(
            new, latest, match=match, latest=latest, scans=moved.scans + 1, asked=np.zeros(3),
            waited=0, drift=np.zeros((3, 3)),
        )  # fmt: skip

    def _waiting(self, old: Place, prediction: Prediction) -> Place:
        """Carried on by odometry alone."""
        increment, before = prediction.increment, old.match.T_map_robot
        tracked = float(prediction.T_map_robot[2]) - float(increment[2])
        if old.waited:
            drift = se2.propagate(old.drift, before, increment, turned(prediction.step, -tracked))
        else:
            drift = turned(prediction.step, float(before[2]) - tracked)
        match = replace(old.match, T_map_robot=se2.compose(before, increment))
        x, y, turn = increment.tolist()
        moved = np.array([math.hypot(x, y), abs(turn), prediction.elapsed])
        return replace(
            old, match=match, way=old.way + moved, asked=old.asked + moved, waited=old.waited + 1,
            drift=drift,
        )  # fmt: skip

    def _climb(
        self, observations: Observations, T_map_robot: Float, covariance: Float, budget: Budget
    ) -> Match:
        budget.spend(self._prices.climb_ns * max(len(observations.points_robot), 1))
        return self._matcher.matched(self._cell_map, observations, T_map_robot, covariance)


def novelty(moved: Float) -> float:
    """Share of a scan that is new after having moved by (3,) m, rad and s."""
    return min(float((moved / ANEW).max()), 1.0)
