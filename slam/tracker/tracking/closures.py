# SPDX-License-Identifier: Apache-2.0
"""Measures between key frames: steps of the chain, and closures found by matching little maps.

Each key frame is matched to the few before it: matched to the whole map, as it was online, a step
would hide the drift that a loop is to correct. A closure is a match to the little map of another
stretch of the way, searched for in a window (``search``) or started from a prediction (``tie``).
"""

import math
from collections.abc import Callable, Generator, Iterable

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import inverted
from slam.posegraph import Edge
from slam.tracker.belief.places import coarse, spread
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.matching.whole_search import WholeSearch
from slam.tracker.rasterise import rasterise, seen_at
from slam.tracker.tracking.keys import KeyFrame
from slam.tracker.uncertainty.covariances import carried, observable
from slam.tracker.uncertainty.residuals import residuals_of

# What things cost, in units of drawing one key frame; measured on logs of 5 cm, 180 and 361 beams.
UNIT_NS = 400_000  # of the counted price of a search, which is that of a slower machine
DRAWN = 1  # the unit
MATCHED, MATCHED_POINTS = 2, 60  # and one for so many points
PIECE = 0.05  # of a scan's budget: after that a search pauses
SAMPLES = 4  # of a scan's points, that say in which directions a match is one; set by hand
KEPT = 64  # submaps; half a MB each at 3 cm and 180 beams


def draw(cell_map: CellMap, key: KeyFrame, pose: Float, look_s: float) -> None:
    """Let a map see a key frame from ``pose`` (3,) for so many s."""
    rasterise(cell_map, key.observations, pose)
    T_map_laser = se2.compose(pose, key.observations.T_robot_laser)
    cell_map.integrate(key.observations.view, T_map_laser, look_s, write=True)


def support(cell_map: CellMap, observations: Observations, match: Match) -> float:
    """Matched share of the observations times the share of the trace in view that they confirm.

    The second factor distinguishes a corridor from the room beside it: there the beams pass where
    walls are known to be.
    """
    look = seen_at(cell_map, observations, match.T_map_robot)
    total = look.confirmed + look.contradicted
    return match.matched * look.confirmed / total if total > 0.0 else 0.0


class Closures:
    """Matches key frames to others; ``spent`` counts what that cost, in units.

    chained  where the steps alone lead, (3,) of each key frame that was stepped to
    """

    def __init__(
        self,
        config: TrackerConfig,
        matcher: Matcher,
        new_map: Callable[[], CellMap],
        keys: list[KeyFrame],
    ) -> None:
        """``new_map`` makes an empty map for what a few key frames saw."""
        self._new_map, self._matcher, self._keys = new_map, matcher, keys
        self._numbers = config.loops
        self._coarse = coarse(config.tracking.relocalise)
        self.chained: list[Float] = []
        self.spent = 0
        self._whole = config.matching.whole
        self._prices = config.matching.budget
        self._room_m = 2.0 * config.loops.widest_m + config.loops.near_m
        self._submaps: dict[int, CellMap] = {}  # those used last, the latest at the end
        self._coarse_map: tuple[int, CoarseMap] | None = None  # of the one searched last
        self._latest: CellMap | None = None  # map that was drawn
        self._drawn: set[int] = set()  # middles of all submaps so far

    def step(self, j: int) -> Edge:
        """The step to key frame ``j``, matched to the few before it; as online where it is poor."""
        key = self._keys[j]
        step, covariance = key.step, key.covariance
        cell_map = self._map_of(range(max(0, j - self._numbers.recent), j), j - 1)
        match = self._matcher.matched(cell_map, key.observations, step, covariance)
        self._spend_match(j)
        if match.matched >= self._numbers.good_step:
            step = match.T_map_robot
            information = self._information(cell_map, key.observations, match)
            covariance = inverted(information + inverted(covariance))
        covariance = covariance + spread(self._numbers.chain_m, self._numbers.chain_rad)
        self.chained.append(se2.compose(self.chained[-1], step))
        return Edge(a=j - 1, b=j, T_a_b=step, information=inverted(covariance))

    def tie(self, middle: int, j: int, predicted: Float) -> Generator[None, None, Edge | None]:
        """Key frame ``j`` matched to the map about ``middle``, near where it is predicted.

        Or where it lay online, if ``alias`` times as much is explained there: along a corridor,
        and among what moves, little maps say less than the whole one did. It pauses before each
        match.
        """
        online = self._online(middle, j)
        self._submap(middle)
        yield
        found = self._matched(middle, j, online)
        off = np.abs(predicted - online)
        off[2] = abs(se2.wrap(float(off[2])))
        numbers = self._numbers
        if max(off[0], off[1]) > numbers.alike_m or off[2] > numbers.alike_rad:
            yield
            other = self._matched(middle, j, predicted)
            if found[0] < numbers.alias * other[0]:
                found = other
        return self._edge(middle, j, found[1], found[0])

    def _online(self, middle: int, j: int) -> Float:
        """Where key frame ``j`` lies from ``middle`` in the map."""
        return se2.between(self._keys[middle].T_map_robot, self._keys[j].T_map_robot)

    def _matched(self, middle: int, j: int, predicted: Float) -> tuple[float, Match]:
        """The match nearest to a prediction, and its support."""
        cell_map, seen = self._submap(middle), self._keys[j].observations
        match = self._matcher.matched(cell_map, seen, predicted, self._coarse)
        self._spend_match(j)
        self.spent += DRAWN
        return support(cell_map, seen, match), match

    def search(
        self, middle: int, j: int, predicted: Float, gate: float
    ) -> Generator[None, None, Edge | None]:
        """The same, searched for up to ``gate`` m around; None where two places look alike.

        Where it lay online, if that explains ``alias`` times as much as the best of them. It
        pauses between parts of the search, and before each match.
        """
        search = self._begun_search(middle, j, (predicted, gate, self._numbers.gate_rad))
        places: list[Float] = []
        while not search.done:
            yield
            budget = Budget(self._prices, PIECE)
            places += search.advance(budget)
            self.spent += math.ceil(budget.spent_ns / UNIT_NS)
        found: list[tuple[float, Match]] = []
        for place in places:
            yield
            found.append(self._matched(middle, j, place))
        if not found:
            return None
        yield
        found.sort(key=lambda one: -one[0])
        (best, match), others = found[0], found[1:]
        known = self._matched(middle, j, self._online(middle, j))
        if known[0] >= self._numbers.alias * best:
            return self._edge(middle, j, known[1], known[0])
        alike = any(other > self._numbers.alias * best for other, _ in others)
        return None if alike else self._edge(middle, j, match, best)

    def _begun_search(self, middle: int, j: int, about: tuple[Float, float, float]) -> WholeSearch:
        """A search of the map about ``middle``, which is laid out once for those that follow."""
        cell_map = self._submap(middle)
        if self._coarse_map is None or self._coarse_map[0] != middle:
            short_term = self._matcher.reward.short_term
            self._coarse_map = middle, CoarseMap(cell_map, short_term, self._room_m)
        points, most = self._keys[j].observations.points_robot, self._numbers.most
        return WholeSearch(self._coarse_map[1], points, most, self._whole, about)

    def _spend_match(self, j: int) -> None:
        points = len(self._keys[j].observations.points_robot)
        self.spent += MATCHED + points // MATCHED_POINTS

    def _edge(self, middle: int, j: int, match: Match, backing: float) -> Edge | None:
        if backing < self._numbers.good_support or match.matched < self._numbers.good_match:
            return None
        information = self._information(self._submap(middle), self._keys[j].observations, match)
        covariance = inverted(information + self._numbers.loose * np.eye(3))
        covariance = covariance + spread(self._numbers.loop_m, self._numbers.loop_rad)
        T_a_b = match.T_map_robot
        return Edge(a=middle, b=j, T_a_b=T_a_b, information=inverted(covariance), robust=True)

    def _information(self, cell_map: CellMap, seen: Observations, match: Match) -> Float:
        """(3, 3) of a match, used in the graph: none along a bare corridor.

        There the overlaps' curvature is that of noise.
        """
        short_term, numbers = self._matcher.reward.short_term, cell_map.config.uncertainty
        geometry, feigned = np.zeros((3, 3)), 0.0
        step = max(1, len(seen.points_robot) // numbers.residuals.samples)
        for turn in range(0, step, -(-step // SAMPLES)):
            one = residuals_of(cell_map, short_term, seen, match.T_map_robot, (1.0, 0.0), turn)
            geometry, feigned = geometry + one.geometry, feigned + one.feigned
        out, information = np.empty((3, 3)), match.tau * match.information
        unobservable, along_rad = observable(geometry, feigned, numbers.pose.noisy, out)
        if unobservable == 2:
            information = np.diag([0.0, 0.0, information[2, 2]])
        elif unobservable == 1:
            x, y = math.cos(along_rad), math.sin(along_rad)
            carried(information, np.zeros(3), x, y, out)
            information = out
        return self._numbers.information_share * information

    def _submap(self, middle: int) -> CellMap:
        """What the key frames about ``middle`` saw, in the frame of that one.

        It is drawn again, to the same cells, where ``KEPT`` others were used since. That is not
        ``spent``: what work comes when must not depend on what is kept.
        """
        cell_map = self._submaps.pop(middle, None)
        if cell_map is None:
            way_m, after_m = self._keys[middle].way_m, self._numbers.after_m
            near = range(middle - self._numbers.submap, middle + self._numbers.submap + 1)
            about = [k for k in near if abs(self._keys[k].way_m - way_m) <= after_m]
            before = self.spent
            cell_map = self._map_of(about, middle)
            if middle in self._drawn:
                self.spent = before
            self._drawn.add(middle)
        self._submaps[middle] = cell_map
        if len(self._submaps) > KEPT:
            oldest = next(iter(self._submaps))
            del self._submaps[oldest]
        return cell_map

    def restart(self, poses: list[Float]) -> None:
        """Other key frames, (3,) each."""
        self.chained = list(poses)
        self._submaps.clear()
        self._coarse_map = None
        self._drawn.clear()

    def _map_of(self, members: Iterable[int], origin: int) -> CellMap:
        """What some key frames saw, in the frame of one, as the chain puts them."""
        self._latest = cell_map = self._new_map().begun_like(self._latest)
        for k in members:
            pose = se2.between(self.chained[origin], self.chained[k])
            draw(cell_map, self._keys[k], pose, self._numbers.look_s)
            self.spent += DRAWN
        return cell_map
