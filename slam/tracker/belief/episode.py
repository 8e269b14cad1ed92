# SPDX-License-Identifier: Apache-2.0
"""From the first scan at which the pose is not certain until next to nothing speaks for others.

The map of before is kept as it is. The scans are written to a local copy of it, as if nothing were
wrong, and matched there: where boards or people have closed in on the robot, nothing that it sees
is in the map, and its scans still agree with one another. If the robot turns out to be where its
motion led, the copy is the map from then on; other places are followed a while yet.
"""

import math
from dataclasses import dataclass

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, turned
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.places import Place, Places, coarse
from slam.tracker.belief.posterior import MOST_NATS, Odds, probabilities
from slam.tracker.cell_map import CellMap
from slam.tracker.cells import MOST_OFF, used
from slam.tracker.matching.matcher import Match, Matcher, unmatched
from slam.tracker.rasterise import rasterise

MOST_NEW = 2000  # blocks, set by hand: all of the station has 8000, at cells of 3 cm


@dataclass(frozen=True, kw_only=True)
class Weighed:
    """What the scans so far make of it.

    followed    probability of the place that motion led to
    places      of each other place, as in ``Places.followed``
    unknown     of having been carried, nobody knows where
    """

    followed: float
    places: list[float]
    unknown: float


class Episode:
    """One of one robot.

    evidence  of the place that motion led to; ``before``: without the latest scan
    match     of the latest scan at that place
    broken    nats against the motion of any scan in doubt, at most; of them break_nats are those of
              returns that do not go on
    matched   whether the latest scan was matched to the copy
    trusted   whether the pose was believed since it began: the copy is the map then
    doubted_s, believed_s  s since the pose was last believed, and since it last was not
    drift     (3, 3) in the map: by how much odometry may be off, since the pose was last believed
    """

    def __init__(self, cell_map: CellMap, matcher: Matcher, odds: Odds, elapsed: float) -> None:
        self._odds, self.cell_map = odds, cell_map
        self._local: CellMap | None = None
        self.evidence = Evidence()
        self.places = Places(cell_map, matcher)
        self.before = Evidence()
        self.broken = self.break_nats = 0.0
        self.way_m = self.elapsed_s = self.doubted_s = self.believed_s = 0.0
        self.trusted = False
        self._kept: CellMap | None = None
        self.drift: Float = np.zeros((3, 3))
        self._found = coarse(matcher.config.tracking.relocalise)
        self._carried = odds.carried(elapsed)
        self.match = unmatched(np.zeros(3), matched=0.0, score=0.0)
        self.matched = False

    @property
    def local(self) -> CellMap:
        """The copy, made when it is first asked for."""
        if self._local is None:
            self._local = self._copy()
        return self._local

    @property
    def latest(self) -> CellMap:
        """The map as it was when the pose was last believed."""
        return self.cell_map if self._kept is None else self._kept

    def _copy(self) -> CellMap:
        """In which it is not known by how much the map is off that becomes known."""
        copy = self.latest.twin()
        copy.off_cm = MOST_OFF
        return copy

    def note_break(self, corrected: float, lost: float) -> None:
        """Nats against a match as the motion: the most of any scan counts."""
        self.broken = max(self.broken, corrected, lost)
        self.break_nats = max(self.break_nats, lost)

    def see(self, observations: Observations, match: Match) -> None:
        """What a scan says of where motion led, on the map of before."""
        self.before = self.evidence.copy()
        self.evidence.add(self.cell_map, observations, match.T_map_robot)
        self.match = match

    def believe(self, elapsed: float) -> None:
        """The pose is believed in this scan: odometry's drift begins anew."""
        self.trusted, self.doubted_s, self.drift = True, 0.0, np.zeros((3, 3))
        self.believed_s += elapsed

    def doubt(self) -> None:
        """It is not: what is written from now on may be wrong."""
        if self.believed_s > 0.0:
            self.believed_s, self._kept, self._local = 0.0, self._local, None

    def write(self, observations: Observations, T_map_robot: Float, elapsed: float) -> None:
        """Let the copy see a scan; grown by ``MOST_NEW`` blocks, it is begun anew."""
        if used(self.local.cells) > used(self.latest.cells) + MOST_NEW:
            self._local = self._copy()
        rasterise(self.local, observations, T_map_robot)
        T_map_laser = se2.compose(T_map_robot, observations.T_robot_laser)
        step = min(elapsed, self.local.config.map.longest_look_s)
        self.local.integrate(observations.view, T_map_laser, step, write=True)

    def moved(self, prediction: Prediction) -> None:
        """The robot has moved on."""
        self.elapsed_s += prediction.elapsed
        self.doubted_s += prediction.elapsed
        x, y, turn = prediction.increment.tolist()
        self.way_m = math.hypot(x, y)
        before = prediction.T_map_robot - (0.0, 0.0, turn)
        step = turned(prediction.covariance, -float(before[2]))
        self.drift = se2.propagate(self.drift, before, prediction.increment, step)

    def prior(self, place: Match, here: Float) -> float:
        """Nats of a slip from ``here`` to that place, or of odometry's drift: what is likelier."""
        off = place.T_map_robot - here
        off[2] = se2.wrap(float(off[2]))
        x, y, turn = off.tolist()
        slipped = self._odds.slipped(self.way_m, math.hypot(x, y), turn)
        return max(slipped, self._odds.drifted(off, self.drift, self._found))

    def weight(self, place: Place) -> float:
        """Nats of having been carried to a place, or of having slipped there."""
        return self._odds.evidence(place.evidence) + max(place.prior, self.carried_there)

    @property
    def carried_there(self) -> float:
        """Nats of having been carried to any one place."""
        return self._carried - self._odds.config.place

    def weighed(self) -> Weighed:
        """The posterior."""
        places = self.places.followed
        weights = [self.weight(place) for place in places]
        slipped = [k for k, place in enumerate(places) if place.prior > self.carried_there]
        elsewhere = [place for place in places if place.prior <= self.carried_there]
        here = self._here(elsewhere) - self.broken
        here = self._compared(slipped, here, weights)
        nearby = max((weights[k] for k in slipped), default=-MOST_NATS)
        of_here, unknown, *others = probabilities([here, self._unknown(nearby), *weights])
        return Weighed(followed=of_here, places=others, unknown=unknown)

    def _here(self, elsewhere: list[Place]) -> float:
        """Nats of what scans say of where motion led.

        A room that is new to the map confirms nothing, and may look like one that it knows.
        """
        odds, own = self._odds, self.evidence
        best = max((odds.evidence(place.evidence) for place in elsewhere), default=0.0)
        known = max(odds.confirmed(own.known_m), best - odds.config.alike)
        return known - odds.denied(own.through_m)

    def _compared(self, nearby: list[int], here: float, weights: list[float]) -> float:
        """Nats of where motion led; ``weights`` of places ``nearby`` change with it.

        What has changed in the room speaks alike against both; they differ by what is confirmed.
        A place that leads by that leads by as much at least. To others it lends what it weighs:
        where motion led weighs as much as the best of them, and they lag by as much at least.
        """
        places, k_nats = self.places.followed, self._odds.config.nearby_per_m
        ahead = {k: k_nats * places[k].gain_m + places[k].prior for k in nearby}
        behind = [k for k in nearby if ahead[k] <= 0.0]
        here = max([here, *(weights[k] for k in behind)])
        for k in behind:
            weights[k] = min(weights[k], here + ahead[k])
        return min([here, *(weights[k] - ahead[k] for k in nearby if ahead[k] > 0.0)])

    def _unknown(self, nearby: float) -> float:
        """Nats of having been carried to nobody knows where; ``nearby``: of the best slip.

        After a break, a map that was not searched may hold a place as good as the one nearby.
        """
        config = self._odds.config
        if self.places.searches:
            found_m = max((one.evidence.known_m for one in self.places.followed), default=0.0)
            return self._carried - config.searched * min(found_m, config.linear_m)
        share = min(self.break_nats / config.broken, 1.0)
        unknown = self._carried + config.unsearched * share
        return max(unknown, nearby) if share == 1.0 else unknown


def second_moment(poses: list[Float], shares: list[float], T_map_robot: Float) -> Float:
    """(3, 3) about a pose of places with these probabilities."""
    total = np.zeros((3, 3))
    for pose, share in zip(poses, shares, strict=True):
        off = pose - T_map_robot
        off[2] = se2.wrap(float(off[2]))
        total += share * np.multiply.outer(off, off)
    return total
