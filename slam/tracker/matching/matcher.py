# SPDX-License-Identifier: Apache-2.0
"""Scan matching, Eq. (13): the pose whose observations overlap the map most, against the prior.

By what matches were like so far it is told which scans are worth a search.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam._jit import njit
from slam.frames import Float
from slam.frontend import odometry_prior
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, inverted, turned
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.config import UsualConfig
from slam.tracker.matching.local_search import Around, SearchWindow, search
from slam.tracker.matching.score import SCRATCH, Climb, Reward, Seen, refine


class Widths(NamedTuple):
    """Sums of two variances, m^2.

    place  of the prior's position
    least  a blur of no more is none
    most   of the blur: it is shrunk to this
    """

    place: float
    least: float
    most: float


@njit
def blur(
    seen: Seen, covariance: NDArray[np.float64], widths: Widths, every: int, out: Seen
) -> bool:
    """Fill ``out`` with one of ``every`` so many, smeared by a pose's (3, 3) ``covariance``.

    That one is in the robot frame. False, and ``out`` is not to be used, where it smears none of
    them by more than ``widths.least``.
    """
    xx, xy, xt = covariance[0, 0], covariance[0, 1], covariance[0, 2]
    yy, yt, tt = covariance[1, 1], covariance[1, 2], covariance[2, 2]
    farthest = 0.0
    for k in range(len(seen.points)):
        x, y = seen.points[k, 0], seen.points[k, 1]
        farthest = max(farthest, x * x + y * y)
    if 2.0 * (widths.place + farthest * tt) < widths.least:  # (a + b)^2 <= 2 (a^2 + b^2)
        return False
    blurred = False
    for m in range(len(out.points)):
        k = m * every
        x, y = seen.points[k, 0], seen.points[k, 1]
        ttx, tty = tt * x, tt * y
        a = xx - 2.0 * xt * y + tty * y
        b = xy + xt * x - yt * y - ttx * y
        d = yy + 2.0 * yt * x + ttx * x
        blurred |= a + d > widths.least
        share = min(1.0, widths.most / max(a + d, 1e-12))
        out.points[m, 0], out.points[m, 1] = x, y
        out.covariances[m, 0] = seen.covariances[k, 0] + a * share
        out.covariances[m, 1] = seen.covariances[k, 1] + b * share
        out.covariances[m, 2] = seen.covariances[k, 2] + d * share
        out.weights[m] = seen.weights[k] * every
        out.tangents[m, 0], out.tangents[m, 1] = seen.tangents[k, 0], seen.tangents[k, 1]
        out.facings[m], out.votes[m] = seen.facings[k], seen.votes[k]
    return blurred


LEAST = 1e-9  # shares are divided by the usual one


def seen_by(observations: Observations) -> Seen:
    """The arrays of ``observations``; all votes are 1 where nothing is known of them.

    Every second point of a scan is copied: kernels are compiled once, for points without gaps.
    """
    return Seen(
        np.ascontiguousarray(observations.points_robot),
        observations.covariances,
        observations.weights,
        observations.tangents,
        observations.facings,
        np.ones(len(observations.points_robot)) if observations.votes is None
        else observations.votes,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Match:
    """Result of matching one frame.

    T_map_robot  (3,) best pose
    information  (3, 3) of the data alone, by (x, y, theta) in the map frame
    matched      share of the observations that overlap the map, 0 without observations; what does
                 not, and has no vote (``tracker.standing``), is left out of it
    overlapped   the same share of all observations
    score        reward at full weight - 1/2 Mahalanobis^2: comparable between matches of a frame
    tau          weight the reward had in the end
    searched     whether the wide search ran; ``evaluations`` candidate poses it scored
    slipped      whether it was found against the odometry
    rewarded     reward for a unit of weight, by the votes of the returns
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
    rewarded: float = 0.0


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
    off = np.abs(match.T_map_robot - prediction.T_map_robot)
    if off.max() <= odometry_prior.MOST_STEP_M and np.isfinite(match.information).all():
        return match
    return unmatched(prediction.T_map_robot, matched=0.0, score=0.0)


class Usual:
    """Of scans that the map took in.

    matches  latest matched fractions
    """

    def __init__(self, config: UsualConfig, matches: Sequence[float] = ()) -> None:
        self._config = config
        self.matches: deque[float] = deque(matches, maxlen=config.remembered)
        self._rewarded, self._overlapped = 0.0, 0.0
        self._median: float | None = None  # asked for thrice a scan

    @property
    def match(self) -> float:
        """Median matched fraction."""
        if self._median is None:
            self._median = median(self.matches) if self.matches else 1.0
        return self._median

    def know(self, matches: Sequence[float]) -> None:
        """So scans of before matched."""
        self.matches.extend(matches)
        self._median = None

    def learn(self, match: Match, elapsed: float) -> None:
        """The map took in a scan, so many s after the one before."""
        self.know([match.matched])
        self._rewarded += self._forgotten(elapsed) * (match.rewarded - self._rewarded)

    def follow(self, match: Match, observations: Observations, elapsed: float) -> None:
        """A scan was matched, to the map or to a local copy."""
        known = self._of_known(match, observations)
        self._overlapped += self._forgotten(elapsed) * (known - self._overlapped)

    def _forgotten(self, elapsed: float) -> float:
        """Share of what is remembered of a second ago that a scan replaces."""
        return min(1.0 - math.exp(-elapsed / self._config.fallen_s), 0.3)

    def is_odd(self, match: Match, observations: Observations) -> bool:
        """Whether so little is matched, or so suddenly less, that the map in view is to be asked.

        Returns that have no vote and a reward that fell are the sign of a slip: who slipped sees
        what stands at places that were empty.
        """
        config = self._config
        if match.matched < config.odd * self.match:
            return True
        fell = match.rewarded < config.fallen * self._rewarded
        return fell and observations.mean_vote < config.outvoted

    def share(self, match: Match, observations: Observations) -> float:
        """Of what all returns, voting or not, matched in the second before: what matches now."""
        return self._of_known(match, observations) / max(self._overlapped, LEAST)

    @staticmethod
    def _of_known(match: Match, observations: Observations) -> float:
        """Matched share of what the scans before had in view: nothing else can go on from them."""
        return match.overlapped / max(observations.in_view, match.overlapped, LEAST)


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
            young_trace=config.standing.young_trace,
        )
        self.numbers = config.matching
        steps = self.numbers.climb
        self._climb = Climb(*(getattr(steps, name) for name in Climb._fields))
        self._scratch = np.empty(SCRATCH)
        self.usual = Usual(config.matching.usual)
        self._around = Around(self.reward.short_term)

    def match(self, observations: Observations, prediction: Prediction, cell_map: CellMap) -> Match:
        """Climb from the prediction; search around it when that is vague or finds too little."""
        predicted, prior = prediction.T_map_robot, prediction.prior
        precision = inverted(prior)
        start = self.approach(cell_map, observations, predicted, prior)
        match = self.climb(cell_map, observations, start, predicted, precision)
        local = self.numbers.local
        good = local.good_share * self.usual.match
        vague_m = local.vague_cells * self.config.cell_m  # as far as the climb reaches
        vague = math.sqrt(max(prior[0, 0], prior[1, 1])) > vague_m
        if not vague and match.matched >= good:
            return match
        around = self._around.of(cell_map)
        for window in (SearchWindow.about(prior, local), SearchWindow.widest(local)):
            found = self.search(cell_map, observations, predicted, precision, window, around)
            if found.score > match.score:
                match = found
            if match.matched >= local.widest_share * good:
                break
        return match

    def climb(
        self,
        cell_map: CellMap,
        observations: Observations,
        start: Float,
        prediction: Float,
        precision: Float,
    ) -> Match:
        """The local optimum reached from ``start``; the reward's weight falls with the match."""
        seen = seen_by(observations)
        full = observations.weight
        pose = np.array(start, dtype=np.float64)
        information = np.zeros((3, 3))
        tau, matched, overlapped, score = self.config.reward, 0.0, 0.0, -math.inf
        rewarded = 0.0
        while full > 0.0:
            rewarded, prior, count, absent = refine(
                cell_map.cells,
                self.reward,
                self._climb,
                seen,
                pose,
                prediction,
                precision,
                tau,
                information,
                self._scratch,
            )
            overlapped = count / full
            matched = count / (full - absent) if count > 0.0 else 0.0
            score = self.config.reward * rewarded + prior
            tempered = self.config.reward * matched**self.config.reward_exponent
            tempered = max(tempered, self.numbers.climb.least_weight)
            if tau < self.config.reward or tempered > self.numbers.climb.tempered * tau:
                break
            tau = tempered
        pose[2] = se2.wrap(float(pose[2]))
        return Match(
            T_map_robot=pose, information=information, matched=matched, score=score, tau=tau,
            overlapped=overlapped, rewarded=rewarded / full if full > 0.0 else 0.0,
        )  # fmt: skip

    def approach(
        self, cell_map: CellMap, observations: Observations, prediction: Float, covariance: Float
    ) -> Float:
        """Where to start climbing: the optimum for observations blurred by the prior's own spread.

        Returns the prediction itself where the prior moves no observation by half a cell.
        """
        n = len(observations.points_robot)
        if n == 0:
            return prediction
        numbers = self.numbers.climb
        every = max(1, math.ceil(n / numbers.few))
        m = -(-n // every)
        few = Seen(
            points=np.empty((m, 2)), covariances=np.empty((m, 3)), weights=np.empty(m),
            tangents=np.empty((m, 2)), facings=np.empty(m, np.uint8), votes=np.empty(m),
        )  # fmt: skip
        widths = Widths(
            place=float(covariance[0, 0] + covariance[1, 1]),
            least=(numbers.moved_cells * self.config.cell_m) ** 2,
            most=(numbers.widest_cells * self.config.cell_m) ** 2,
        )
        in_robot = turned(covariance, -float(prediction[2]))
        if not blur(seen_by(observations), in_robot, widths, every, few):
            return prediction
        pose = np.array(prediction, dtype=np.float64)
        refine(
            cell_map.cells, self.reward, self._climb, few, pose, prediction,
            inverted(covariance), self.config.reward, np.zeros((3, 3)), self._scratch,
        )  # fmt: skip
        return pose

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
