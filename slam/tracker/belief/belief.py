# SPDX-License-Identifier: Apache-2.0
"""Where the robot may be, scan by scan, and all that follows from it.

At most five kinds of hypotheses: where motion led, a place nearby (a slip), places elsewhere that
the map knows, and carried to nobody knows where. Each has a log-weight from what scans confirm of
the long-known map and what they see through (``evidence``), and a prior that is a rate
(``posterior``). The pose, whether it is believed, and whether the map is written are read off the
posterior. docs/belief.md has the mathematics.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted, squared
from slam.tracker.belief.config import LENIENT
from slam.tracker.belief.episode import Episode, second_moment
from slam.tracker.belief.evidence import Evidence, vanished
from slam.tracker.belief.places import Place, is_same, spread
from slam.tracker.belief.posterior import Odds, probabilities
from slam.tracker.belief.status import State, Status
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import Look
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Match, Matcher, Usual, near, unmatched
from slam.tracker.standing.agreement import Agreement

DENIED = 14.2  # squared, in variances, of three numbers: odometry allows less in 997 of 1000
PAUSE_S = 1.0  # after a longer one, what stood may have been moved
NEGLIGIBLE = 0.01  # times frozen_above: so unlikely, all places beyond the alert limit are dropped
LEAST_INFORMATION = np.eye(3)  # 1/m^2, 1/rad^2, of a match that shows nothing: numerical guard
LEAST_P = 1e-300  # probability: numerical guard
SIGMAS = 2.0  # deviations of odometry's drift since the doubt began that are searched; set by hand
WIDEST_M = 1.5  # m, farthest that this widens a search nearby; set by hand
LEFT_S = 3.0  # for so long nothing of the map is in view: no crowd in passing; set by hand


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """What is to be done with a scan.

    match       its pose, whichever place it is
    prediction  as given, or wider after a slip
    cell_map    the map to go on in; ``writes``: it takes the scan in
    followed    whether the pose is a match to a map, be it the local copy
    likeliest   (3,) pose of the likeliest place, if that is not where motion led
    restored    whether the map is that of before the doubt: what was written since is not in it
    """

    match: Match
    prediction: Prediction
    state: State
    cell_map: CellMap
    writes: bool = False
    followed: bool = True
    likeliest: Float | None = None
    restored: bool = False


class Belief:
    """Of one robot.

    p_lost  probability that the pose is wrong
    status  what may be wrong
    budget  of the latest scan, for searches for the robot; nothing limits that nearby, which counts
    busy    share of the latest scan's time that searches for the robot took, roughly: 0, 1/2 or 1
    """

    def __init__(
        self,
        config: TrackerConfig,
        matcher: Matcher,
        match: Callable[[Observations, Prediction, CellMap], Match],
        usual: Usual,
        agreement: Agreement,
    ) -> None:
        """``match`` matches a scan to a map as the SLAM does; ``usual``: what scans so far were;
        ``agreement``: of matches and odometry, which is taken on here.
        """
        self._agreement = agreement
        self._config, self._numbers = config.belief, config.tracking.relocalise
        self._give_up_s = config.tracking.give_up_s
        self._alert_m = config.standing.alert_m
        self._matcher, self._match, self._usual = matcher, match, usual
        self._odds = Odds(config.belief, config.carried_per_h)
        self._episode: Episode | None = None
        self.p_lost, self.status, self.busy = 0.0, Status.TRACKING, 0.0
        self._p_off = 0.0  # that the robot is not where its motion led
        self.budget = self._new_budget()
        self._p_far = 0.0  # nor within the alert limit of it
        self._likeliest: int | None = None  # of the places that are followed, if one is
        self._since_near_s = np.inf
        self._suspect = False
        self._latest: Observations | None = None  # the scan before, if there was one

    def _new_budget(self) -> Budget:
        prices = self._matcher.config.matching.budget
        lost = self._p_off > 0.5
        return Budget(prices, prices.lost_share if lost else prices.frozen_share)

    def first(self, observations: Observations) -> State:
        """The first scan: the map begins with it."""
        self._latest = observations.with_votes(None)
        self.status = Status.TRACKING if len(observations.points_robot) else Status.BLIND
        return State.TRACKING if len(observations.points_robot) else State.BLIND

    @property
    def certain(self) -> bool:
        """Whether no other place is followed."""
        return self._episode is None

    @property
    def doubt(self) -> Episode | None:
        """Since which other places are followed, if any are."""
        return self._episode

    def judge(
        self,
        cell_map: CellMap,
        T_map_before: Float,
        observations: Observations,
        prediction: Prediction,
    ) -> Judged:
        """Where the robot is; ``T_map_before``: where it was at the scan before."""
        self._since_near_s += prediction.elapsed
        self.budget = self._new_budget()
        episode = self._episode
        in_doubt = episode is not None and self._p_off > self._config.frozen_above
        self.busy = 1.0 if in_doubt else 0.0 if episode is None else 0.5
        before, self._latest = self._latest, observations.with_votes(None)
        if not len(observations.points_robot):
            return self._blind(cell_map, prediction)
        if episode is not None and in_doubt:
            return self._go_on(episode, T_map_before, observations, prediction)
        match = near(self._match(observations, prediction, cell_map), prediction)
        self._agreement.take(prediction, match.T_map_robot, observations.mean_vote)
        odd = self._suspect or self._usual.is_odd(match, observations)
        dragged = self._dragged(cell_map, observations, match) if self._odds.asked else 0.0
        if dragged > 0.5:
            odd = odd or self._agreement.dragged() > 0.5
            pose = self._agreement.undragged(match.T_map_robot, dragged)
            match = unmatched(pose, matched=match.matched, score=0.0)
        if self._odds.asked and odd:
            gone, now = 0.0, (self._latest, match.T_map_robot)
            if before is not None and prediction.elapsed <= PAUSE_S:
                gone = vanished(cell_map, (before, T_map_before), now)
            begun = self._begun(cell_map, observations, prediction, match, gone)
            if self._p_off > self._config.frozen_above:  # what was followed before is believed
                self._episode, begun.matched, self.busy = begun, True, 1.0
                self._usual.follow(match, observations, prediction.elapsed)
                begun.places.remember(self._latest)
                begun.write(observations, match.T_map_robot, prediction.elapsed)
                return self._decided(begun, observations, match, prediction)
        if episode is None:
            return self._settled(cell_map, match, prediction)
        return self._go_on(episode, T_map_before, observations, prediction, match)

    def _dragged(self, cell_map: CellMap, observations: Observations, match: Match) -> float:
        """How likely movers carried the match off, and not odometry: by the map and by the
        agreement; by the map alone where old surface held the match. 0 where odometry agrees.
        """
        if not self._agreement.suspected:
            return 0.0
        dragged = max(self._agreement.dragged(), 0.5)
        poses = match.T_map_robot, self._agreement.put_back(match.T_map_robot)
        looks = [Evidence().add(cell_map, observations, pose) for pose in poses]
        here, back = probabilities([self._odds.evidence(look) for look in looks])
        return dragged * back / max(dragged * back + (1.0 - dragged) * here, LEAST_P)

    def _blind(self, cell_map: CellMap, prediction: Prediction) -> Judged:
        """A scan without a return says nothing: odometry alone."""
        self.status, episode = Status.BLIND, self._episode
        match = unmatched(prediction.T_map_robot, matched=0.0, score=0.0)
        if episode is not None:
            episode.moved(prediction)
            if self._p_off <= self._config.frozen_above:
                episode.doubted_s = 0.0
            episode.match = match
            episode.places.wait(prediction)
        return Judged(
            match=match, prediction=prediction, state=State.BLIND, cell_map=cell_map,
            writes=episode is None, followed=False, likeliest=self._elsewhere(episode),
        )  # fmt: skip

    def learn(self, observations: Observations, judged: Judged, look: Look) -> None:
        """The map took a scan in, and ``look`` is what that said of it."""
        match, elapsed = judged.match, judged.prediction.elapsed
        here = self._odds.evidence(look) - max(self._broken(observations, judged.prediction, match))
        self._usual.learn(match, elapsed)
        self._usual.follow(match, observations, elapsed)
        p_lost = probabilities([here, self._odds.carried(elapsed)])[1]
        self.p_lost = p_lost if self._episode is None else max(p_lost, self.p_lost)
        self._suspect = self._odds.asked and p_lost > self._config.frozen_above
        self._tell(look.through)

    def _broken(
        self,
        observations: Observations,
        prediction: Prediction,
        match: Match,
        gone: float = 0.0,
    ) -> tuple[float, float]:
        """Nats against a match as the motion: it corrects odometry, and does not go on."""
        if match.slipped or observations.weight < self._numbers.least_weight:
            return 0.0, 0.0  # paid for, or too little in view
        corrected = self._odds.corrected(prediction, match.T_map_robot)
        share = self._usual.share(match, observations)
        return corrected, self._odds.broken(share, gone)

    @staticmethod
    def _settled(cell_map: CellMap, match: Match, prediction: Prediction) -> Judged:
        tracking = State.TRACKING
        return Judged(
            match=match, prediction=prediction, state=tracking, cell_map=cell_map, writes=True
        )

    def _begun(
        self,
        cell_map: CellMap,
        observations: Observations,
        prediction: Prediction,
        match: Match,
        gone: float,
    ) -> Episode:
        """What one scan says of where motion led, and of a place nearby."""
        episode = Episode(cell_map, self._matcher, self._odds, prediction.elapsed)
        episode.moved(prediction)
        episode.match = match
        episode.evidence.add(cell_map, observations, match.T_map_robot)
        episode.note_break(*self._broken(observations, prediction, match, gone))
        self._search_near(episode, observations, prediction, match)
        self._weigh(episode)
        return episode

    def _search_near(
        self,
        episode: Episode,
        observations: Observations,
        prediction: Prediction,
        match: Match,
    ) -> None:
        """Look for the best place as far around as a slip may have led, and shows."""
        numbers = self._numbers
        if self._since_near_s < numbers.again_near_s or observations.weight < numbers.least_near:
            return
        self._since_near_s, self.busy = 0.0, max(self.busy, 0.5)
        everyone = observations.with_votes(None)
        every = max(1, len(everyone.points_robot) // numbers.near_points)
        points, weights = everyone.points_robot[::every], everyone.weights[::every] * every
        few = replace(everyone, points_robot=points, weights=weights)
        slip = self._agreement.shown(spread(self._config.slip_m, self._config.slip_rad))
        # not what adds up where nothing shows it, but odometry's drift since the doubt began
        loose = inverted(slip + prediction.loosened + episode.drift)
        reach_m = min(SIGMAS * math.sqrt(max(episode.drift[0, 0], episode.drift[1, 1])), WIDEST_M)
        window = SearchWindow(reach_m=max(reach_m, numbers.near_m), turn_rad=numbers.near_rad)
        start = prediction.T_map_robot
        found = self._matcher.search(episode.cell_map, few, start, loose, window)
        prices, climbed = self.budget.prices, len(points) + len(everyone.points_robot)
        scored = found.evaluations * len(points)
        self.budget.spend(prices.bound_ns * scored + prices.climb_ns * climbed)
        found = self._matcher.climb(episode.cell_map, everyone, found.T_map_robot, start, loose)
        if is_same(found, match):
            return
        # the robot may have slipped now, or its motion led it astray some scans ago
        first = episode.elapsed_s <= prediction.elapsed  # of the episode: no scans are kept
        of = (episode.before,) if first else (episode.before, None)
        begun = [episode.places.begun(everyone, found, self.budget, before) for before in of]
        likelier = max(begun, key=lambda place: self._odds.evidence(place.evidence))
        place = self._told_nearby(episode, likelier, match)
        episode.places.keep([place], episode.weight, self._config.hopeless)

    @staticmethod
    def _told_nearby(episode: Episode, place: Place, here: Match) -> Place:
        """A new place, with the prior of a slip to there."""
        return replace(
            place,
            prior=episode.prior(place.match, here.T_map_robot),
            gain_m=place.evidence.latest_m - episode.evidence.latest_m,
        )

    def _go_on(
        self,
        episode: Episode,
        T_map_before: Float,
        observations: Observations,
        prediction: Prediction,
        believed: Match | None = None,
    ) -> Judged:
        """Another scan of an episode; ``believed``: its match, where the pose is believed."""
        episode.moved(prediction)
        if believed is None:
            match = self._followed(episode, observations, prediction)
        else:
            match, episode.matched = believed, believed.tau > 0.0
        episode.see(observations, match)
        moved = prediction
        # the old map may have pulled the match before: from there the next one jumps
        T_map_robot, off = match.T_map_robot, prediction.off(match.T_map_robot)
        if episode.matched and squared(off, prediction.step) <= DENIED:
            increment = se2.between(T_map_before, T_map_robot)
            # as sure as both together: among people a few returns must turn no place
            seen = inverted(match.tau * match.information + LEAST_INFORMATION)
            match_may = seen + self._agreement.own + np.multiply.outer(off, off)
            step = inverted(inverted(prediction.step) + inverted(match_may))
            moved = prediction.changed(
                T_map_robot=T_map_robot, increment=increment, covariance=step,
                loosened=np.zeros((3, 3)),
            )  # fmt: skip
        everyone = observations.with_votes(None)
        episode.places.follow(everyone, moved, self.budget, episode.evidence)
        if self._p_off > self._config.frozen_above:
            self._search_near(episode, observations, prediction, match)
        new = episode.places.explore(everyone, self.budget)
        new = [self._told_nearby(episode, place, match) for place in new]
        episode.places.keep(new, episode.weight, self._config.hopeless)
        episode.places.remember(everyone)
        self._weigh(episode)
        return self._decided(episode, observations, match, prediction)

    def _followed(
        self,
        episode: Episode,
        observations: Observations,
        prediction: Prediction,
    ) -> Match:
        """The pose on the local copy, where the scan agrees with it; else by odometry."""
        episode.matched = False
        match = unmatched(prediction.T_map_robot, matched=0.0, score=0.0)
        if observations.weight >= self._numbers.least_weight:
            found = near(self._match(observations, prediction, episode.local), prediction)
            goes_on = self._usual.share(found, observations) >= self._config.breaks
            episode.note_break(*self._broken(observations, prediction, found))
            self._usual.follow(found, observations, prediction.elapsed)
            if goes_on:
                vote = observations.mean_vote
                self._agreement.take(prediction, found.T_map_robot, vote, in_doubt=True)
            often = prediction.elapsed <= PAUSE_S  # else no match follows what moves
            asked = goes_on and often
            dragged = self._dragged(episode.cell_map, observations, found) if asked else 0.0
            episode.matched = goes_on and dragged <= 0.5
            match = found if episode.matched else replace(match, matched=found.matched)
            if dragged > 0.5:
                pose = self._agreement.undragged(found.T_map_robot, dragged)
                match = replace(match, T_map_robot=pose)
        return match

    def _weigh(self, episode: Episode) -> None:
        self._weighed = episode.weighed()
        at_same = (
            p
            for place, p in zip(episode.places.followed, self._weighed.places, strict=True)
            if is_same(place.match, episode.match)
        )
        self.p_lost = self._p_off = max(0.0, 1.0 - self._weighed.followed - sum(at_same))
        far = (
            p
            for place, p in zip(episode.places.followed, self._weighed.places, strict=True)
            if self._is_far(place.match, episode.match)
        )
        self._p_far = self._weighed.unknown + sum(far)
        self._likeliest = None
        for k, p in enumerate(self._weighed.places):
            if 1.0 - p < self.p_lost:
                self._likeliest, self.p_lost = k, 1.0 - p
        place = None if self._likeliest is None else episode.places.followed[self._likeliest]
        self._tell((place or episode).evidence.through_m)

    def _is_far(self, one: Match, other: Match) -> bool:
        """Beyond the alert limit, or turned so much that it soon is."""
        x, y, turn = (one.T_map_robot - other.T_map_robot).tolist()
        return math.hypot(x, y) > self._alert_m or abs(se2.wrap(turn)) > self._numbers.same_rad

    def _elsewhere(self, episode: Episode | None) -> Float | None:
        """(3,) where the likeliest place is, if that is not where motion led."""
        if episode is None or self._likeliest is None:
            return None
        return episode.places.followed[self._likeliest].match.T_map_robot

    def _tell(self, through_m: float) -> None:
        """In a word."""
        if self.p_lost >= 0.5:
            self.status = Status.LOST
        else:
            outdated = self._odds.denied(through_m) >= self._config.outdated
            self.status = Status.OUTDATED if outdated else Status.TRACKING

    def _decided(
        self,
        episode: Episode,
        observations: Observations,
        match: Match,
        prediction: Prediction,
    ) -> Judged:
        """Whether one place is certain: where motion led, or another; else wait."""
        weighed, sure = self._weighed, 1.0 - self._config.frozen_above
        waited_enough = episode.doubted_s > self._give_up_s
        for place, p in zip(episode.places.followed, weighed.places, strict=True):
            same = is_same(place.match, match) and p > weighed.followed
            goes_on = self._usual.share(place.match, observations) >= self._config.breaks
            # the robot has left the map: no scan will tell more
            left = waited_enough and place.unseen_s >= LEFT_S
            taken = (goes_on and p >= sure) or (left and p >= 1.0 - LENIENT * (1.0 - sure))
            if place.waited == 0 and (taken or (same and 1.0 - self._p_off >= sure)):
                return self._found(place, episode, prediction, writes=left)
        if 1.0 - self._p_off >= sure:  # a search may still find where the robot was carried
            episode.believe(prediction.elapsed)
            long = episode.believed_s > self._give_up_s
            if long or self._p_far <= NEGLIGIBLE * self._config.frozen_above:
                self._episode = None
            return self._settled(episode.local, match, prediction)
        episode.doubt()
        if episode.elapsed_s > prediction.elapsed:
            episode.write(observations, match.T_map_robot, prediction.elapsed)
        state = State.LOST if self.p_lost >= 0.5 else State.FROZEN
        return Judged(
            match=match, prediction=prediction, state=state, cell_map=episode.cell_map,
            followed=episode.matched, likeliest=self._elsewhere(episode),
        )  # fmt: skip

    def _found(
        self,
        place: Place,
        episode: Episode,
        prediction: Prediction,
        *,
        writes: bool,
    ) -> Judged:
        self._episode, self.p_lost, self.status = None, 0.0, Status.TRACKING
        self._agreement.forget()
        slipped = place.prior > episode.carried_there
        if slipped:
            wide = spread(self._config.slip_m, self._config.slip_rad)
            return Judged(
                match=replace(place.match, slipped=True),
                prediction=replace(prediction, covariance=wide),
                state=State.TRACKING, writes=True,
                cell_map=episode.latest,
            )  # fmt: skip
        return Judged(
            match=place.match, prediction=prediction, state=State.RELOCATED,
            cell_map=episode.cell_map, restored=episode.trusted,
            writes=writes,  # off the map nothing else is there for the next scan to go on from
        )  # fmt: skip

    def spread_about(self, T_map_robot: Float, anywhere: Callable[[Float], Float]) -> Float:
        """(3, 3) that the other places add to the covariance of a pose."""
        if self._episode is None:
            return np.zeros((3, 3))
        poses = [place.match.T_map_robot for place in self._episode.places.followed]
        poses.append(self._episode.match.T_map_robot)
        shares = [*self._weighed.places, self._weighed.followed]
        spreads = second_moment(poses, shares, T_map_robot)
        # the places that are followed need not be all: who is lost may be anywhere
        return spreads + self.p_lost * anywhere(T_map_robot)
