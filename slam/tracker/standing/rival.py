# SPDX-License-Identifier: Apache-2.0
"""A second pose, carried beside the first until one of them fails.

Who slipped sees what stands at places that were empty: the returns lose their votes, and little of
the map is matched. From the right place they have both. The poses are compared by how much of the
long-term trace the scan confirms from each. That sums over the map, not over beams: a crowd close
by, which carries the robot along, hides the map, but it does not confirm it.
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
from slam.tracker.matching.local_search import SearchWindow, search
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.rasterise import rasterise
from slam.tracker.standing.recent import Standing


@dataclass(frozen=True, kw_only=True, eq=False)
class Second:
    """The other pose.

    match  of the latest scan there
    here   sum over ``scans`` of the trace that each confirms from the first pose
    there  the same from this one
    """

    match: Match
    here: float
    there: float
    scans: int = 1
    elapsed_s: float = 0.0


class Rival:
    """Asks for a second pose when the first suddenly explains little, and decides between both."""

    def __init__(self, matcher: Matcher, standing: Standing) -> None:
        self._matcher, self._standing = matcher, standing
        self._config = matcher.config.standing
        self._least_weight = matcher.config.tracking.relocalise.least_weight
        self._usual = 0.0
        self._second: Second | None = None

    @property
    def undecided(self) -> bool:
        """Whether two poses are carried: nothing may be written."""
        return self._second is not None

    def forget(self) -> None:
        """The robot is lost, or was found elsewhere."""
        self._second, self._usual = None, 0.0

    def decided(
        self,
        cell_map: CellMap,
        stamp_ns: int,
        observations: Observations,
        prediction: Prediction,
        match: Match,
    ) -> Match:
        """``match``, or that of the second pose (``slipped``) once it has explained more."""
        if self._config.fallen == 0.0 or not len(observations.points_robot):
            return match
        if self._second is not None:
            self._second = self._carried(
                self._second, cell_map, stamp_ns, observations, prediction, match
            )
        elif self._has_fallen(observations, match):
            self._second = self._found(
                cell_map, stamp_ns, observations, prediction, match, match.T_map_robot
            )
        if self._second is None:
            self._learn(match.rewarded, prediction.elapsed)
        return self._decide(match)

    def _has_fallen(self, observations: Observations, match: Match) -> bool:
        """Among a few things alone nothing is decided: all of them may have moved."""
        if observations.weight < self._least_weight:
            return False
        if observations.votes is None or observations.mean_vote >= self._config.outvoted:
            return False
        return match.rewarded < self._config.fallen * self._usual

    def _learn(self, rewarded: float, elapsed_s: float) -> None:
        share = 1.0 - math.exp(-elapsed_s / self._config.fallen_s)
        self._usual += min(share, 0.3) * (rewarded - self._usual)

    def _found(
        self,
        cell_map: CellMap,
        stamp_ns: int,
        observations: Observations,
        prediction: Prediction,
        match: Match,
        around: Float,
    ) -> Second | None:
        """The best place around a pose by the long-term trace; None where it is no better."""
        config = self._config
        every = max(1, len(observations.points_robot) // config.rival_points)
        few = replace(
            observations,
            points_robot=observations.points_robot[::every],
            weights=observations.weights[::every] * every,
        )
        wide, gain = config.rival_rad, self._matcher.config.reward
        loose = inverted(np.diag([config.rival_m**2, config.rival_m**2, wide**2]))
        window = SearchWindow(reach_m=config.rival_m, turn_rad=wide)
        start, _ = search(cell_map, 0.0, few, around, loose, window, gain)
        found = self._climb(cell_map, stamp_ns, observations, start, prediction.prior, loose)
        least = max(match.rewarded + config.rival_gain, config.explains * self._usual)
        if found.rewarded < least or _same(found, match):
            return None
        return Second(
            match=found,
            here=_confirmed(cell_map, observations, match),
            there=_confirmed(cell_map, observations, found),
        )

    def _carried(
        self,
        old: Second,
        cell_map: CellMap,
        stamp_ns: int,
        observations: Observations,
        prediction: Prediction,
        match: Match,
    ) -> Second | None:
        """One scan on; looked for anew where it now explains as little as the first did."""
        start = se2.compose(old.match.T_map_robot, prediction.increment)
        tracked = float(prediction.T_map_robot[2]) - float(prediction.increment[2])
        step = turned(prediction.step, float(old.match.T_map_robot[2]) - tracked)
        found = self._climb(cell_map, stamp_ns, observations, start, step, inverted(step))
        if _same(found, match):
            return None
        if found.rewarded < self._config.explains * self._usual:
            return self._found(cell_map, stamp_ns, observations, prediction, match, start)
        return Second(
            match=found,
            here=old.here + _confirmed(cell_map, observations, match),
            there=old.there + _confirmed(cell_map, observations, found),
            scans=old.scans + 1,
            elapsed_s=old.elapsed_s + prediction.elapsed,
        )

    def _climb(
        self,
        cell_map: CellMap,
        stamp_ns: int,
        observations: Observations,
        start: Float,
        prior: Float,
        precision: Float,
    ) -> Match:
        votes = self._standing.votes(stamp_ns, start, prior, observations)
        seen = observations.with_votes(votes)
        return self._matcher.climb(cell_map, seen, start, start, precision)

    def _decide(self, match: Match) -> Match:
        config, second = self._config, self._second
        if second is None:
            return match
        ahead = second.there >= config.better * second.here
        tried = second.scans >= config.rival_scans and second.elapsed_s >= config.rival_s
        if ahead and tried:
            self._second = None
            return replace(second.match, slipped=True)
        if not ahead or second.elapsed_s > config.undecided_s:
            self._second = None
        return match


def _confirmed(cell_map: CellMap, observations: Observations, match: Match) -> float:
    """Long-term trace that the scan confirms from there."""
    rasterise(cell_map, observations, match.T_map_robot)
    T_map_laser = se2.compose(match.T_map_robot, observations.T_robot_laser)
    confirmed, _, _ = cell_map.integrate(observations.view, T_map_laser, 0.0, write=False)
    cell_map.release()
    return confirmed


def _same(one: Match, other: Match) -> bool:
    """Nearer than what a match may be off."""
    x, y, turn = (one.T_map_robot - other.T_map_robot).tolist()
    return math.hypot(x, y) < 0.05 and abs(se2.wrap(turn)) < 0.02
