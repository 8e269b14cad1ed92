# SPDX-License-Identifier: Apache-2.0
"""The scans of the last seconds, kept to say which present returns come from what stands."""

import math
from collections import deque
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from slam import se2
from slam.frames import NS_PER_S, Float
from slam.frontend.observations import Observations
from slam.tracker.standing.agreement import Agreement
from slam.tracker.standing.config import StandingConfig
from slam.tracker.standing.kernels import Asking, votes

NO_POINTS = np.empty((0, 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class Look:
    """One kept scan.

    T_map_laser (3,), points_map (n, 2), limit (bins,) as in ``View``
    """

    stamp_ns: int
    T_map_laser: Float
    points_map: Float
    limit: Float
    step: float


class Standing:
    """Gives each return its vote, by how long its place was not seen empty.

    agreement  of odometry with what was matched with these votes
    """

    def __init__(self, config: StandingConfig) -> None:
        self._config, self.agreement = config, Agreement(config)
        self._looks: deque[Look] = deque()
        # a little less, as scans come when they come
        first_s = 0.95 * config.spacing_s
        self._ages_s = [first_s * config.ages_grow**k for k in range(config.views)]

    def add(self, stamp_ns: int, T_map_robot: Float, seen: Observations) -> None:
        """Keep a scan that was tracked."""
        if self._config.settled_s == 0.0 or not len(seen.points_robot):
            return
        looks, config = self._looks, self._config
        if len(looks) > 1 and stamp_ns - looks[-2].stamp_ns < config.spacing_s * NS_PER_S:
            looks.pop()  # the newest is always there
        looks.append(
            Look(
                stamp_ns=stamp_ns,
                T_map_laser=se2.compose(T_map_robot, seen.T_robot_laser),
                points_map=se2.transform(T_map_robot, seen.points_robot),
                limit=seen.view.limit,
                step=seen.view.step,
            )
        )
        oldest = stamp_ns - round(1.5 * self._ages_s[-1] * NS_PER_S)
        while looks[0].stamp_ns < oldest:
            looks.popleft()

    def moved(self, T_new_old: Float) -> None:
        """The map moved: so did what was seen in it."""
        self.agreement.turned(float(T_new_old[2]))
        self._looks = deque(
            replace(
                look,
                T_map_laser=se2.compose(T_new_old, look.T_map_laser),
                points_map=se2.transform(T_new_old, look.points_map),
            )
            for look in self._looks
        )

    def _asked(self, stamp_ns: int, step: float) -> list[Look]:
        """The newest, and of the others about one of each age."""
        chosen: list[Look] = []
        least = -math.inf
        for look in reversed(self._looks):
            age = (stamp_ns - look.stamp_ns) / NS_PER_S
            if age >= least and look.step == step:
                chosen.append(look)
                older = [least_s for least_s in self._ages_s if least_s > age]
                if not older:
                    break
                least = older[0]
        return chosen

    def with_votes(
        self, stamp_ns: int, T_map_robot: Float, prior: Float, seen: Observations
    ) -> Observations:
        """With the vote of each return in [0, 1], and what share of them may have been seen before.

        ``T_map_robot``: a pose predicted with a (3, 3) prior.
        """
        config, points = self._config, seen.points_robot
        asked = self._asked(stamp_ns, seen.view.step) if config.settled_s > 0.0 else []
        if not asked or not len(points):
            return seen.with_votes(np.ones(len(points)))
        ages = [(stamp_ns - look.stamp_ns) / NS_PER_S for look in asked]
        place, heading = max(float(prior[0, 0]), float(prior[1, 1])), float(prior[2, 2])
        margin = config.margin_m + config.sigmas * math.sqrt(place)
        spread = math.radians(config.spread_deg) + config.sigmas * math.sqrt(heading)
        asking = Asking(
            step=seen.view.step,
            margin=margin,
            spread=min(spread, 0.5 * math.pi),
            # else the prediction may be what is off
            sure=1.0 / (1.0 + place / config.vague_m**2),
            settled_s=config.settled_s,
            left_m=config.left_m,
            along_m=config.along_m,
            thin_m=config.thin_m,
        )
        newest = sum(age <= config.left_s for age in ages)
        lately = [look.points_map for look in asked[:newest]]
        limit, width = seen.view.limit, max(map(len, [*lately, points])) + 1
        out = np.empty(len(points))
        in_view = votes(
            points, seen.joined, limit, T_map_robot,
            se2.compose(T_map_robot, seen.T_robot_laser), seen.T_robot_laser,
            np.array([look.T_map_laser for look in asked]),
            np.array([look.limit for look in asked]), np.array(ages),
            sum(age <= config.came_s for age in ages),
            np.concatenate(lately) if lately else NO_POINTS,
            np.array(list(accumulate(map(len, lately))), np.int64), asking,
            np.empty((6, width)), np.empty((2, len(limit)), np.int64), out,
        )  # fmt: skip
        return seen.with_votes(out, in_view)
