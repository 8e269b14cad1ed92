# SPDX-License-Identifier: Apache-2.0
"""Other places where the robot may be, each followed from scan to scan.

They come from a search nearby and from a search of the whole map; each is carried along by odometry
and matched to the scans. A scan does no more of this than its budget allows: the search goes on
over the scans that follow, and where there are many places, they are matched by turns.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted, turned
from slam.tracker.belief.config import RelocaliseConfig
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.posterior import MOST_NATS
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.matching.whole_search import WholeSearch


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

    match     of the latest scan that was matched there, carried on by odometry
    evidence  of all scans that were
    prior     nats of having slipped there; none: it cannot have
    gain_m    mean of the trace that a scan confirms more from there than from where motion led
    scans     that were matched there
    unseen_s  s since a scan from there last confirmed more than may be by chance
    waited    scans since it was matched, ``drift`` (3, 3) what odometry may be off since
    """

    match: Match
    evidence: Evidence
    prior: float = -MOST_NATS
    gain_m: float = 0.0
    scans: int = 1
    unseen_s: float = 0.0
    waited: int = 0
    drift: Float = field(default_factory=lambda: np.zeros((3, 3)))

    def is_at(self, T_map_robot: Float, config: RelocaliseConfig) -> bool:
        """Whether that is the same place."""
        x, y, turn = (self.match.T_map_robot - T_map_robot).tolist()
        near = x * x + y * y < config.same_m**2
        return bool(near and abs(se2.wrap(turn)) < config.same_rad)


class Places:
    """The places that are followed from one scan on, on a map that is not written meanwhile.

    followed  with evidence, in no order
    searches  of the whole map that were finished, all their places tried
    """

    def __init__(self, cell_map: CellMap, matcher: Matcher) -> None:
        self._cell_map, self._matcher = cell_map, matcher
        self._config = matcher.config.tracking.relocalise
        self._prices = matcher.config.matching.budget
        self.followed: list[Place] = []
        self.searches = 0
        self._kept: list[tuple[Observations, Float]] = []  # earlier scans, and the motion since
        self._coarse: CoarseMap | None = None
        self._search: WholeSearch | None = None
        self._since_search_s = math.inf
        self._found: list[Float] = []  # by the search, to be tried
        self._motion, self._drift = np.zeros(3), np.zeros((3, 3))  # since the scan searched for

    def remember(self, observations: Observations) -> None:
        """Keep a scan for places that are found later; of too many, every second one goes."""
        self._kept.append((observations, np.zeros(3)))
        if len(self._kept) > self._config.kept:
            self._kept = self._kept[::2]

    def follow(
        self, observations: Observations, prediction: Prediction, budget: Budget, here: Evidence
    ) -> None:
        """Follow all to the next scan; ``here``: of where motion led."""
        self._go_on(prediction)
        left = (1.0 - self._prices.known_share) * budget.left_ns
        moved: dict[int, Place] = {}
        for place in sorted(self.followed, key=lambda place: -place.waited):
            if moved and budget.left_ns <= left:
                moved[id(place)] = self._waiting(place, prediction)
            else:
                moved[id(place)] = self._matched(place, observations, prediction, here, budget)
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

    def keep(self, new: list[Place], weight: Callable[[Place], float], hopeless: float) -> None:
        """Follow the best, one of each place, the likeliest; none that is hopeless.

        Of places at the same pose, the one that more scans were asked of.
        """
        apart: list[Place] = []
        for place in sorted(self.followed + new, key=lambda one: -one.scans):
            if not any(is_same(place.match, other.match) for other in apart):
                apart.append(place)
        kept: list[Place] = []
        for place in sorted(apart, key=lambda one: -weight(one)):
            at = place.match.T_map_robot
            if not any(other.is_at(at, self._config) for other in kept):
                kept.append(place)
        best = weight(kept[0]) if kept else 0.0
        self.followed = [one for one in kept if weight(one) >= best - hopeless][: self._config.most]

    def _go_on(self, prediction: Prediction) -> None:
        """The robot has moved on since the scan that is searched for."""
        self._since_search_s += prediction.elapsed
        tracked = float(prediction.T_map_robot[2]) - float(prediction.increment[2])
        step = turned(prediction.step, -tracked)
        self._drift = se2.propagate(self._drift, self._motion, prediction.increment, step)
        self._motion = se2.compose(self._motion, prediction.increment)
        self._kept = [
            (seen, se2.compose(motion, prediction.increment)) for seen, motion in self._kept
        ]

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
            new.append(self.begun(observations, match, budget))
            self.searches += self._search is None and not self._found
        return new

    def begun(
        self,
        observations: Observations,
        match: Match,
        budget: Budget,
        before: Evidence | None = None,
    ) -> Place:
        """A place with what this scan says of it, and those before it: what was said ``before``
        of where motion led, or else what kept scans say of where it came from.
        """
        evidence = Evidence() if before is None else before.copy()
        for seen, motion in self._kept if before is None else ():
            at = se2.compose(match.T_map_robot, se2.inverse(motion))
            self._weigh(evidence, seen, at, budget)
        self._weigh(evidence, observations, match.T_map_robot, budget)
        return Place(match=match, evidence=evidence)

    def _weigh(
        self, evidence: Evidence, observations: Observations, T_map_robot: Float, budget: Budget
    ) -> None:
        look = evidence.add(self._cell_map, observations, T_map_robot)
        budget.spend(self._prices.weigh_ns * look.visited)

    def _matched(
        self,
        old: Place,
        observations: Observations,
        prediction: Prediction,
        here: Evidence,
        budget: Budget,
    ) -> Place:
        moved = self._waiting(old, prediction)
        match = self._climb(observations, moved.match.T_map_robot, moved.drift, budget)
        self._weigh(old.evidence, observations, match.T_map_robot, budget)
        gain_m, scans = old.evidence.latest_m - here.latest_m, old.scans + 1
        seen = old.evidence.latest_m >= self._matcher.config.belief.confirmed_m
        return replace(
            moved, match=match, gain_m=old.gain_m + (gain_m - old.gain_m) / scans, scans=scans,
            unseen_s=0.0 if seen else moved.unseen_s, waited=0, drift=np.zeros((3, 3)),
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
        unseen_s, waited = old.unseen_s + prediction.elapsed, old.waited + 1
        return replace(old, match=match, unseen_s=unseen_s, waited=waited, drift=drift)

    def _climb(
        self, observations: Observations, T_map_robot: Float, covariance: Float, budget: Budget
    ) -> Match:
        budget.spend(self._prices.climb_ns * max(len(observations.points_robot), 1))
        start = self._matcher.approach(self._cell_map, observations, T_map_robot, covariance)
        precision = inverted(covariance)
        return self._matcher.climb(self._cell_map, observations, start, T_map_robot, precision)
