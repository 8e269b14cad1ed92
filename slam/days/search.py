# SPDX-License-Identifier: Apache-2.0
"""Where in the map of the days before a session starts.

The robot maps on its own, in a frame that begins where it stands, while the known map is searched
for what it sees. Each place that is found is followed, and weighed as a robot that was carried
weighs places (``slam.tracker.belief``): by what all scans since the start confirm of the long-known
map and what they see through. Nothing is written to the known map meanwhile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from slam import se2
from slam.days.agreement import Agreement, Past, Trial
from slam.days.config import DaysConfig
from slam.estimate import Estimate
from slam.frames import NS_PER_S, Float, Frame, to_s
from slam.frontend.observations import Observations, observe
from slam.frontend.odometry_prior import Prediction
from slam.tracker.belief.config import RelocaliseConfig
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.places import Place, Places, coarse, spread
from slam.tracker.belief.posterior import Odds, probabilities
from slam.tracker.belief.status import State
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.matcher import Matcher
from slam.tracker.rasterise import rasterise
from slam.tracker.tracker import Tracker


@dataclass(frozen=True, kw_only=True, eq=False)
class Kept:
    """A scan of the search: what it saw, where in its own frame, and s since the one before."""

    observations: Observations
    T_own_robot: Float
    elapsed: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Late:
    """A place that was found late: it is weighed when the scans before have been asked, too."""

    place: Place
    T_map_own: Float
    unasked: list[Kept]

    def at(self, T_own_robot: Float) -> Place:
        """The place of the robot there."""
        match = replace(self.place.match, T_map_robot=se2.compose(self.T_map_own, T_own_robot))
        return replace(self.place, match=match, waited=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """Where the session may have begun, and the probability of it."""

    T_map_own: Float
    probability: float


class StartSearch:
    """Maps alone and searches the known map, until the start is found.

    alone  the SLAM that maps meanwhile
    seen   scans to be counted when the place is found, and the poses in the session's own frame
    """

    def __init__(self, known: Tracker, config: DaysConfig, past: Past) -> None:
        self._known, self._config, self._past = known, config.search, past
        self._every_ns = round(config.evidence.every_s * NS_PER_S)
        numbers = known.config
        self._belief, self._budget = numbers.belief, numbers.matching.budget
        changed = replace(numbers.belief, outdated=0.0)  # rooms have, since: all places pay alike
        self._odds = Odds(changed, numbers.carried_per_h)
        places = _places_in(known.cell_map, numbers.tracking.relocalise)
        self._prior = -math.log(places) - numbers.belief.outdated
        self.seen: list[tuple[Frame, Float]] = []
        self.alone = type(known)(numbers)
        self.alone.hold_map()
        self.elapsed_s = 0.0
        self._before: tuple[int, Float] | None = None
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Motion and kept scans are worth nothing from before."""
        self._places = Places(self._known.cell_map, Matcher(self._known.config))
        self._late: list[Late] = []
        self._hopeless: list[Float] = []  # T_map_own of places that are not asked again
        self._kept: list[Kept] = []
        self._kept_s = 0.0
        self._trials: list[Trial] = []
        self.seen.clear()

    def take(self, frame: Frame) -> tuple[Estimate, Float | None]:
        """The estimate in the session's own frame, and T_map_own (3,) when the place is found."""
        estimate = self.alone.update(frame)
        now, pose = frame.stamp_ns, estimate.T_map_robot
        before_ns, before = self._before or (now, pose)
        elapsed = to_s(now - before_ns)
        self._before = (now, pose)
        self.elapsed_s += elapsed
        observations = observe(frame, self._twist(frame, before, pose, elapsed), self._known.config)
        if not estimate.converged or not len(observations.points_robot):
            if estimate.diagnostics.get("state") == State.LOST:
                self._begin_anew()  # its own map is in doubt
            return estimate, None
        self._keep(observations, pose, elapsed)
        if not self.seen or now - self.seen[-1][0].stamp_ns >= self._every_ns:
            self.seen.append((frame, pose))
        prediction = Prediction(
            T_map_robot=pose,
            increment=se2.between(before, pose),
            covariance=spread(self._config.step_m, self._config.step_rad),
            twist=np.zeros(3),
            elapsed=elapsed,
        )
        share = self._budget.lost_share
        for place in self._places.step(observations, prediction, share, Evidence()):
            self._join(place, pose)
        self._ask(pose)
        return estimate, self._found()

    def _join(self, place: Place, pose: Float) -> None:
        """A place that is new is to be asked for the scans before, evenly taken."""
        config = self._known.config.tracking.relocalise
        own = [late.T_map_own for late in self._late] + self._hopeless
        others = [one.match.T_map_robot for one in self._places.followed]
        others += [se2.compose(T_map_own, pose) for T_map_own in own]
        if any(place.is_at(other, config) for other in others):
            return
        T_map_own = se2.compose(place.match.T_map_robot, se2.inverse(pose))
        unasked = self._kept[:-1][:: max(1, len(self._kept) // self._config.asked)]
        self._late.append(Late(place=place, T_map_own=T_map_own, unasked=unasked))

    def _ask(self, pose: Float) -> None:
        """Ask the scans before of the places that were found late, some in each scan."""
        left = self._config.asked
        while self._late and left > 0:
            late = self._late[0]
            now, late.unasked[-left:] = late.unasked[-left:], []
            left -= max(len(now), 1)
            for one in now:
                at = se2.compose(late.T_map_own, one.T_own_robot)
                late.place.evidence.add(self._known.cell_map, one.observations, at)
            if not late.unasked:
                self._late.pop(0)
                self._weigh(late, pose)

    def _weigh(self, late: Late, pose: Float) -> None:
        """All scans were asked: it is followed as the others are, if it is not hopeless."""
        hopeless = self._belief.hopeless
        self._places.keep([late.at(pose)], self._weight, hopeless)
        best = self._weight(self._places.followed[0])
        if self._weight(late.place) < best - hopeless:
            self._hopeless.append(late.T_map_own)
            del self._hopeless[: -self._config.buffer]

    def _weight(self, place: Place) -> float:
        """Nats of having begun there, against outside the map; any place of it is as likely."""
        return self._odds.evidence(place.evidence) + self._prior

    def starts(self) -> list[Start]:
        """Where it may have begun, in no order; what is left of 1: outside the map."""
        followed = self._places.followed
        shares = probabilities([*map(self._weight, followed), 0.0])
        assert self._before is not None or not followed
        own = np.zeros(3) if self._before is None else se2.inverse(self._before[1])
        return [
            Start(T_map_own=se2.compose(place.match.T_map_robot, own), probability=p)
            for place, p in zip(followed, shares[:-1], strict=True)
        ]

    def _found(self) -> Float | None:
        """T_map_own (3,), where one place is certain, and no other is still to be asked."""
        if self._late or not self._places.searches:
            return None
        sure = 1.0 - self._belief.frozen_above
        for place, start in zip(self._places.followed, self.starts(), strict=True):
            if place.waited == 0 and start.probability >= sure:
                return start.T_map_own if self._fits(start.T_map_own) else None
        return None

    def _fits(self, T_map_own: Float) -> bool:
        """Whether a session from there would be kept, and would not fit nearly as well from another
        place that is followed.

        What stands now where nothing stood costs a place nothing in the belief: somebody may have
        come between. And what has changed since may speak for a place alike.
        """
        if not self._past.known:
            return self._matches(T_map_own)
        config, found = self._past.config, self._tried(T_map_own)
        if found.known < config.known or found.disagrees > config.spoils:
            return False
        most = found.disagrees + config.more
        asked = (self._tried(start.T_map_own) for start in self.starts())
        alike = (o.known >= config.known and o.disagrees <= most for o in asked)
        return sum(alike) == 1  # itself

    def _tried(self, T_map_own: Float) -> Agreement:
        """How all that was seen agrees with the days before, from there."""
        trial = next((one for one in self._trials if one.is_at(T_map_own)), None)
        if trial is None:
            trial = Trial(self._past, T_map_own)
            self._trials = [trial, *self._trials][: self._known.config.tracking.relocalise.most]
        return trial.agreement(self.seen)

    def _matches(self, T_map_own: Float) -> bool:
        """The same of a map without days: by what of the kept scans the map has."""
        config, known = self._config, self._known
        asked = self._kept[:: max(1, len(self._kept) // config.asked)]
        covariance = coarse(known.config.tracking.relocalise)
        shares = [
            known.matched(
                one.observations, se2.compose(T_map_own, one.T_own_robot), covariance
            ).overlapped
            for one in asked
        ]
        return math.fsum(shares) >= config.agreed * known.usual_match * len(asked)

    @staticmethod
    def _twist(frame: Frame, before: Float, pose: Float, elapsed: float) -> Float:
        if frame.odometry.twist is not None:
            return np.asarray(frame.odometry.twist)
        return se2.between(before, pose) / elapsed if elapsed > 0.0 else np.zeros(3)

    def _keep(self, observations: Observations, pose: Float, elapsed: float) -> None:
        """Keep the scan if the robot has moved on; the oldest go."""
        self._kept_s += elapsed
        if self._kept:
            x, y, turn = se2.between(self._kept[-1].T_own_robot, pose).tolist()
            config = self._config
            if math.hypot(x, y) < config.buffer_m and abs(turn) < config.buffer_rad:
                return
        self._kept.append(Kept(observations=observations, T_own_robot=pose, elapsed=self._kept_s))
        self._kept_s = 0.0
        del self._kept[: -self._config.buffer]
        for late in self._late:
            late.unasked.append(self._kept[-1])

    def merge(self, T_map_own: Float) -> int:
        """Let the known map see the kept scans from where they were; how many."""
        known, cell_map = self._known, self._known.cell_map
        for one in self._kept:
            at = se2.compose(T_map_own, one.T_own_robot)
            rasterise(cell_map, one.observations, at)
            T_map_laser = se2.compose(at, one.observations.T_robot_laser)
            step = min(max(one.elapsed, 1e-3), known.config.map.longest_look_s)
            cell_map.integrate(one.observations.view, T_map_laser, step, write=True)
        return len(self._kept)


def _places_in(cell_map: CellMap, config: RelocaliseConfig) -> float:
    """How many places that are not one fit into the rectangle around the map; at least 1."""
    i0, j0, i1, j1 = cell_map.extent() or (0, 0, 0, 0)
    area = (i1 - i0) * (j1 - j0) * cell_map.cell**2
    return max(area / config.same_m**2 * math.tau / config.same_rad, 1.0)
