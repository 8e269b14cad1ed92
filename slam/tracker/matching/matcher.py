# SPDX-License-Identifier: Apache-2.0
"""Scan matching, Eq. (13): the pose whose observations overlap the map most, against the prior.

By what matches were like so far it is told which scans go on from those before.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frontend import odometry_prior
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.climb import SCRATCH, Climb, Numbers, climbed
from slam.tracker.matching.config import UsualConfig
from slam.tracker.matching.local_search import Around, SearchWindow, search
from slam.tracker.matching.score import Reward, Seen

OFTEN_S = 0.4  # scans that come more seldom say little of what moves; set by hand
LEAST = 1e-9  # shares are divided by the usual one


def seen_by(observations: Observations) -> Seen:
    """The arrays of ``observations``; all weights are 1 where nothing is known of them.

    Every second point of a scan is copied: kernels are compiled once, for points without gaps.
    """
    return Seen(
        np.ascontiguousarray(observations.points_robot),
        observations.covariances,
        observations.shares,
        observations.tangents,
        observations.facings,
        np.ones(len(observations.points_robot)) if observations.weights is None
        else observations.weights,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Match:
    """Result of matching one frame.

    T_map_robot  (3,) best pose
    information  (3, 3) of the data alone, by (x, y, theta) in the map frame
    matched      share of the observations that overlap the map, 0 without observations; what does
                 not, and has no weight (``tracker.standing``), is left out of it
    overlapped   the same share of all observations
    score        reward at full weight - 1/2 Mahalanobis^2: comparable between matches of a frame
    tau          weight the reward had in the end
    searched     whether the wide search ran; ``evaluations`` candidate poses it scored
    slipped      whether it was found against the odometry
    """

    T_map_robot: Float
    information: Float
    matched: float
    score: float
    tau: float
    searched: bool = False
    evaluations: int = 0
    slipped: bool = False
    overlapped: float = 0.0


def unmatched(T_map_robot: Float, *, matched: float, score: float) -> Match:
    """A pose that comes from elsewhere: the data say nothing of it."""
    return Match(
        T_map_robot=T_map_robot,
        information=np.zeros((3, 3)),
        matched=matched,
        score=score,
        tau=0.0,
        overlapped=matched,
    )


def near(match: Match, prediction: Prediction) -> Match:
    """The match, or odometry alone where rounding has carried it past all places and numbers."""
    (x, y, turn), (x_0, y_0, turn_0) = match.T_map_robot.tolist(), prediction.T_map_robot.tolist()
    off = abs(x - x_0), abs(y - y_0), abs(turn - turn_0)
    numbers = sum(off) + sum(map(sum, match.information.tolist()))  # no number if one of them is
    if math.isfinite(numbers) and max(off) <= odometry_prior.MOST_STEP_M:
        return match
    return unmatched(prediction.T_map_robot, matched=0.0, score=0.0)


class Usual:
    """Of scans that the map took in.

    matches  latest matched fractions
    """

    def __init__(self, config: UsualConfig, matches: Sequence[float] = ()) -> None:
        self._config = config
        self.matches: deque[float] = deque(matches, maxlen=config.remembered)
        self._overlapped = 0.0
        self._median: float | None = None  # asked for more than once a scan

    @property
    def match(self) -> float:
        """Median matched fraction."""
        if self._median is None:
            self._median = median(self.matches) if self.matches else 1.0
        return self._median

    def know(self, matches: Sequence[float]) -> None:
        """So scans of before matched, from which the next one is to go on."""
        self.matches.extend(matches)
        self._median = None
        self._overlapped = self.match if matches else self._overlapped

    def learn(self, match: Match) -> None:
        """The map took in a scan."""
        self.matches.append(match.matched)
        self._median = None

    def follow(self, match: Match, observations: Observations, elapsed: float) -> None:
        """A scan was matched, to the map or to a local copy."""
        known = self._of_known(match, observations)
        self._overlapped += self._forgotten(elapsed) * (known - self._overlapped)

    def _forgotten(self, elapsed: float) -> float:
        """Share of what is remembered of a second ago that a scan replaces."""
        return min(1.0 - math.exp(-elapsed / self._config.fallen_s), 0.3)

    def share(
        self, match: Match, observations: Observations, least_in_view: float = LEAST
    ) -> float:
        """Of what all returns, voting or not, matched in the second before: what matches now.

        ``least_in_view``: share of the returns that was in view before, at least.
        """
        known = self._of_known(match, observations, least_in_view)
        return known / max(self._overlapped, LEAST)

    @staticmethod
    def _of_known(match: Match, observations: Observations, least: float = LEAST) -> float:
        """Matched share of what the scans before had in view: nothing else can go on from them."""
        return match.overlapped / max(observations.in_view, match.overlapped, least)


class Matcher:
    """Matches observations to a map; ``usual``: what it is told of matches so far."""

    def __init__(self, config: TrackerConfig) -> None:
        self.config = config
        self.reward = Reward(
            cell=config.cell_m,
            short_term=config.short_term_weight / config.saturation,
            logarithm=config.objective == "log",
            matched_overlap=config.matching.matched_overlap,
            log_floor=config.matching.log_floor,
            tail=config.matching.tail,
            tail_cells=config.matching.tail_cells,
            young_trace=0.0,
        )
        self.numbers = config.matching
        steps, cell = self.numbers.climb, config.cell_m
        numbers = Numbers(
            tuple(self.reward),
            tuple(getattr(steps, name) for name in Climb._fields),
            config.reward,
            config.reward_exponent,
            steps.tempered,
            steps.least_weight,
            (steps.moved_cells * cell) ** 2,
            (steps.widest_cells * cell) ** 2,
        )
        closed = self.reward._replace(young_trace=config.standing.young_trace)
        self._open, self._closed = tuple(numbers), tuple(numbers._replace(reward=tuple(closed)))
        self._plain = self._open
        n = steps.few
        self._few = (
            np.empty((n, 2)), np.empty((n, 3)), np.empty(n), np.empty((n, 2)),
            np.empty(n, np.uint8), np.empty(n),
        )  # fmt: skip
        self._scratch = np.empty(SCRATCH)
        self.usual = Usual(config.matching.usual)
        self._around = Around(self.reward.short_term)

    def match(self, observations: Observations, prediction: Prediction, cell_map: CellMap) -> Match:
        """Climb from the prediction; search around it when that is vague or finds too little.

        While scans come often, faint traces are closed to returns without weight.
        """
        self._plain = self._closed if prediction.elapsed <= OFTEN_S else self._open
        found = self._searched(observations, prediction, cell_map)
        self._plain = self._open
        return found

    def _searched(
        self, observations: Observations, prediction: Prediction, cell_map: CellMap
    ) -> Match:
        predicted, prior = prediction.T_map_robot, prediction.prior
        match = self.matched(cell_map, observations, predicted, prior)
        local = self.numbers.local
        good = local.good_share * self.usual.match
        vague_m = local.vague_cells * self.config.cell_m  # as far as the climb reaches
        vague = math.sqrt(max(prior[0, 0], prior[1, 1])) > vague_m
        if not vague and match.matched >= good:
            return match
        around, precision = self._around.of(cell_map), inverted(prior)
        for window in (SearchWindow.about(prior, local), SearchWindow.widest(local)):
            found = self.search(cell_map, observations, predicted, precision, window, around)
            if found.score > match.score:
                match = found
            if match.matched >= local.widest_share * good:
                break
        return match

    def matched(
        self, cell_map: CellMap, observations: Observations, prediction: Float, covariance: Float
    ) -> Match:
        """The optimum with that prior, reached from where observations that are blurred by it lead.

        They lead from the prediction itself where the prior moves none by half a cell.
        """
        every = math.ceil(len(observations.points_robot) / self.numbers.climb.few)
        return self._climbed(cell_map, observations, prediction, prediction, covariance, every)

    def climb(
        self, cell_map: CellMap, observations: Observations, start: Float, prediction: Float,
        precision: Float,
    ) -> Match:  # fmt: skip
        """The local optimum reached from ``start``; the reward's weight falls with the match."""
        return self._climbed(cell_map, observations, start, prediction, precision, 0)

    def _climbed(
        self, cell_map: CellMap, observations: Observations, start: Float, prediction: Float,
        prior: Float, every: int,
    ) -> Match:  # fmt: skip
        """As the kernel ``climbed``."""
        cells, seen = cell_map.cells, tuple(seen_by(observations))
        field = cells.directory, cells.corner, cells.x, cells.y, cells.facing
        pose, information = np.array(start, dtype=np.float64), np.empty((3, 3))
        tau, matched, overlapped, score = climbed(
            field, self._plain, seen, observations.amount, prediction, prior, every, self._few,
            pose, information, self._scratch,
        )  # fmt: skip
        pose[2] = se2.wrap(float(pose[2]))
        return Match(
            T_map_robot=pose, information=information, matched=matched, score=score, tau=tau,
            overlapped=overlapped,
        )  # fmt: skip

    def search(
        self,
        cell_map: CellMap,
        observations: Observations,
        prediction: Float,
        precision: Float,
        window: SearchWindow,
        around: Around | None = None,
    ) -> Match:
        """The best optimum in ``window`` about the prediction: branch and bound, then climb.

        ``around``: what searches of the same frame laid out before.
        """
        start, evaluations = search(
            cell_map, around or self._around.of(cell_map), observations, prediction, precision,
            window, self.config.reward,
        )  # fmt: skip
        match = self.climb(cell_map, observations, start, prediction, precision)
        return replace(match, searched=True, evaluations=evaluations)
