# SPDX-License-Identifier: Apache-2.0
"""Where in the map of the days before a session starts, and whether what it saw fits those days.

The robot maps on its own, in a frame that begins where it stands, while the known map is searched
for what it sees. Each place that is found is followed, and weighed as a robot that was carried
weighs places (``slam.tracker.belief``): by how much of all scans since the start the map explains.
Nothing is written to the known map meanwhile.

A session fits the days before where what always stands stands again: of the places where something
stood in nearly every session before and that this one looked at, the share that it found empty; of
those where it found something and the sessions before had a say, the share that was never taken.
Chairs and doors make few of both, a wrong place makes many.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from slam import se2
from slam.arrays import Float, Float32
from slam.days.evidence import EVERY_S, RANGE_M, SessionGrid, Snapshot
from slam.days.history import History, dense
from slam.estimate import Estimate
from slam.frames import NS_PER_S, Frame, to_s
from slam.frontend.observations import Observations, observe
from slam.frontend.odometry_prior import Prediction
from slam.tracker.belief.likelihood import probabilities
from slam.tracker.belief.places import Place, Places, coarse, novelty, spread
from slam.tracker.belief.state import State
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.matcher import Matcher
from slam.tracker.rasterise import rasterise
from slam.tracker.tracker import Tracker

# Finding the start; set by hand.
STEP_M = 0.02  # m, deviation of the motion between two scans
STEP_RAD = 0.01  # rad, the same of the turn
BUFFER = 200  # scans, kept to be merged when the place is found
BUFFER_M, BUFFER_RAD = 0.1, 0.15  # m driven or rad turned between two of them
ASKED = 20  # scans of those kept, evenly taken, that a place found late is asked for
AGREED = 0.75  # share of the usual match, in a map without days, of those asked
KEPT_ANEW = novelty(np.array([BUFFER_M, BUFFER_RAD, 0.0]))  # of such a scan
SURE = 0.9  # probability of one place: what it saw must fit the days before, too
FITS = 0.5  # share of the scans after the find that must be tracked
# Whether a session fits the days before; set by hand.
ALWAYS = 0.7  # share of the looks of all sessions: always stands
STANDS = 0.5  # share of a session's looks: something stands
EMPTY = 0.2  # share, most of the looks, around it too: nothing
SLACK = 2  # places, that an edge may be off by
KNOWN = 120  # places that always stand, looked at: fewer decide nothing
MORE = 0.045  # share that disagrees at any other place than where it began
SPOILS = 0.1  # share of a whole session: it is kept apart


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Counts of places.

    known, missing  that always stood and were looked at; of these those found empty
    taken, new      where something was found, of those with a say; of these those always empty
    """

    known: int = 0
    missing: int = 0
    taken: int = 0
    new: int = 0

    @property
    def disagrees(self) -> float:
        """Share of both that do not agree, in [0, 1]; 0 where nothing can be said."""
        return (self.missing + self.new) / max(self.known + self.taken, 1)


class Past:
    """The sessions of a history as one image of what always stands and what never does."""

    def __init__(self, history: History) -> None:
        self.cell_m = history.cell_m
        cells, values = history.table()
        self._low, self._standing = np.zeros(2, np.int64), np.full((0, 0), np.nan, np.float32)
        if len(cells):
            low, (image,) = dense(cells, np.nanmean(values, axis=0))
            self._low = low - SLACK
            self._standing = np.pad(image, SLACK, constant_values=np.nan)
        self._near = _highest_near(self._standing, SLACK)

    @property
    def known(self) -> bool:
        """Whether there is anything to agree with."""
        return bool((np.nan_to_num(self._standing) >= ALWAYS).any())

    def agreement(self, snapshot: Snapshot) -> Agreement:
        """Of what a session saw; on the same places."""
        standing = self._standing
        inside = np.all(
            (snapshot.cells >= self._low) & (snapshot.cells < self._low + standing.shape[::-1]),
            axis=1,
        )
        at = snapshot.cells[inside] - self._low
        now = np.full(standing.shape, np.nan, np.float32)
        now[at[:, 1], at[:, 0]] = snapshot.standing[inside]
        near = _highest_near(now, SLACK)
        with np.errstate(invalid="ignore"):
            known = (standing >= ALWAYS) & ~np.isnan(now)
            taken = (now >= STANDS) & ~np.isnan(standing)
            return Agreement(
                known=int(known.sum()),
                missing=int((known & (near < EMPTY)).sum()),
                taken=int(taken.sum()),
                new=int((taken & (self._near < EMPTY)).sum()),
            )


def _highest_near(image: Float32, slack: int) -> Float32:
    """The largest share within ``slack`` places along both axes, 0 where nothing is known."""
    if not image.size:
        return image
    side = 2 * slack + 1
    return np.asarray(cv2.dilate(np.nan_to_num(image), np.ones((side, side), np.uint8)))


class Trial:
    """A place where the session may have begun, and what it saw as seen from there."""

    def __init__(self, past: Past, T_map_own: Float) -> None:
        self._past, self._T_map_own = past, T_map_own
        self._grid, self._taken = SessionGrid(past.cell_m, 0.0, 1), 0
        self._same_rad = SLACK * past.cell_m / RANGE_M

    def is_at(self, T_map_own: Float) -> bool:
        """Whether that place is the same, as far as the slack of the comparison goes."""
        x, y, turn = se2.between(self._T_map_own, T_map_own).tolist()
        return bool(math.hypot(x, y) <= self._past.cell_m and abs(turn) <= self._same_rad)

    def agreement(self, seen: Sequence[tuple[Frame, Float]]) -> Agreement:
        """Of scans and poses in the session's own frame; only those that were added are new."""
        for frame, pose in seen[self._taken :]:
            self._grid.add(frame, se2.compose(self._T_map_own, pose))
        self._taken = len(seen)
        return self._past.agreement(self._grid.snapshot(0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Kept:
    """A scan of the search: what it saw, where in its own frame, and s since the one before."""

    observations: Observations
    T_own_robot: Float
    elapsed: float


@dataclass(kw_only=True, eq=False)
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

    def __init__(self, known: Tracker, past: Past) -> None:
        self._known, self._past = known, past
        numbers = known.config
        self._belief, self._budget = numbers.belief, numbers.matching.budget
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
        if not self.seen or now - self.seen[-1][0].stamp_ns >= round(EVERY_S * NS_PER_S):
            self.seen.append((frame, pose))
        prediction = Prediction(
            T_map_robot=pose,
            increment=se2.between(before, pose),
            covariance=spread(STEP_M, STEP_RAD),
            twist=np.zeros(3),
            elapsed=elapsed,
        )
        budget = Budget(self._budget, self._budget.lost_share)
        self._places.follow(observations, prediction, budget)
        for place in self._places.explore(observations, budget):
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
        unasked = self._kept[:-1][:: max(1, len(self._kept) // ASKED)]
        self._late.append(Late(place=place, T_map_own=T_map_own, unasked=unasked))

    def _ask(self, pose: Float) -> None:
        """Ask the scans before of the places that were found late, some in each scan."""
        left, covariance = ASKED, coarse(self._known.config.tracking.relocalise)
        while self._late and left > 0:
            late = self._late[0]
            now, late.unasked[-left:] = late.unasked[-left:], []
            left -= max(len(now), 1)
            for one in now:
                at = se2.compose(late.T_map_own, one.T_own_robot)
                match = self._known.matched(one.observations, at, covariance)
                late.place = late.place.asked_again(KEPT_ANEW, self._places.evidence(match))
            if not late.unasked:
                self._late.pop(0)
                self._weigh(late, pose)

    def _weigh(self, late: Late, pose: Float) -> None:
        """All scans were asked: it is followed as the others are, if it is not hopeless."""
        self._places.keep([late.at(pose)])
        best = self._places.followed[0].nats
        if late.place.nats < best - self._belief.hopeless:
            self._hopeless.append(late.T_map_own)
            del self._hopeless[:-BUFFER]

    def starts(self) -> list[Start]:
        """Where it may have begun, in no order; what is left of 1: outside the map."""
        followed = self._places.followed
        shares = probabilities([*(place.nats - self._belief.best for place in followed), 0.0])
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
        for place, start in zip(self._places.followed, self.starts(), strict=True):
            if place.waited == 0 and start.probability >= SURE:
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
        found = self._tried(T_map_own)
        if found.known < KNOWN or found.disagrees > SPOILS:
            return False
        most = found.disagrees + MORE
        asked = (self._tried(start.T_map_own) for start in self.starts())
        alike = (o.known >= KNOWN and o.disagrees <= most for o in asked)
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
        known = self._known
        asked = self._kept[:: max(1, len(self._kept) // ASKED)]
        covariance = coarse(known.config.tracking.relocalise)
        shares = [
            known.matched(
                one.observations, se2.compose(T_map_own, one.T_own_robot), covariance
            ).overlapped
            for one in asked
        ]
        return math.fsum(shares) >= AGREED * known.usual_match * len(asked)

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
            if math.hypot(x, y) < BUFFER_M and abs(turn) < BUFFER_RAD:
                return
        self._kept.append(Kept(observations=observations, T_own_robot=pose, elapsed=self._kept_s))
        self._kept_s = 0.0
        del self._kept[:-BUFFER]
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
