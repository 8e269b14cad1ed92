# SPDX-License-Identifier: Apache-2.0
"""Scan matching, Eq. (13): the pose whose observations overlap the map most, against the prior."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from slam import se2
from slam.frames import Float
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import inverted, turned
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.few import Widths, blur, room_for
from slam.tracker.matching.local_search import Around, SearchWindow, search
from slam.tracker.matching.score import SCRATCH, Climb, Reward, Seen, refine


def seen_by(observations: Observations) -> Seen:
    """The arrays of ``observations``."""
    return Seen(
        observations.points_robot,
        observations.covariances,
        observations.weights,
        observations.tangents,
        observations.facings,
        votes_of(observations),
    )


def votes_of(observations: Observations) -> Float:
    """(n,) the votes of ``observations``: all 1 where nothing is known of them."""
    votes = observations.votes
    return np.ones(len(observations.points_robot)) if votes is None else votes


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


class Matcher:
    """Matches observations to a map."""

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
        self._around = Around(self.reward.short_term)

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
        few = room_for(-(-n // every))
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
            cell_map, around or self.around(cell_map), observations, prediction, precision,
            window, self.config.reward,
        )  # fmt: skip
        match = self.climb(cell_map, observations, start, prediction, precision)
        return replace(match, searched=True, evaluations=evaluations)

    def around(self, cell_map: CellMap) -> Around:
        """For several searches of one frame in one map; the next call takes its room."""
        return self._around.of(cell_map)
