# SPDX-License-Identifier: Apache-2.0
"""The scans of the last seconds, kept to say which present returns come from what stands."""

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from slam import se2
from slam.frames import NS_PER_S, Float
from slam.frontend.observations import Observations
from slam.tracker.standing.agreement import Agreement
from slam.tracker.standing.config import StandingConfig
from slam.tracker.standing.kernels import Asked, Asking, Present, placed, weigh


@dataclass(frozen=True, kw_only=True, eq=False)
class KeptScan:
    """T_map_laser (3,), points_map (n, 2), limit (bins,) and step as in ``View``."""

    stamp_ns: int
    T_map_laser: Float
    points_map: Float
    limit: Float
    step: float


class Standing:
    """Gives each return its weight, by how long its place was not seen empty by its own scanner.

    agreement  of odometry with what was matched with these weights
    """

    def __init__(self, config: StandingConfig) -> None:
        self._config, self.agreement = config, Agreement(config)
        self._kept = defaultdict[bytes, list[KeptScan]](list)  # by mount
        # a little less, as scans come when they come
        first_s = 0.95 * config.spacing_s
        self._ages_s = [first_s * config.ages_grow**k for k in range(config.views)]

    def add(self, stamp_ns: int, T_map_robot: Float, seen: Observations) -> None:
        """Keep a scan that was tracked."""
        if self._config.settled_s == 0.0 or not len(seen.points_robot):
            return
        kept, config = self._kept[seen.T_robot_laser.tobytes()], self._config
        if len(kept) > 1 and stamp_ns - kept[-2].stamp_ns < config.spacing_s * NS_PER_S:
            kept.pop()  # the newest is always there
        points_map = np.empty(seen.points_robot.shape)
        placed(seen.points_robot, T_map_robot, points_map)
        kept.append(
            KeptScan(
                stamp_ns=stamp_ns,
                T_map_laser=se2.compose(T_map_robot, seen.T_robot_laser),
                points_map=points_map,
                limit=seen.view.limit,
                step=seen.view.step,
            )
        )
        oldest = stamp_ns - round(1.5 * self._ages_s[-1] * NS_PER_S)
        while kept[0].stamp_ns < oldest:
            del kept[0]

    def moved(self, T_new_old: Float) -> None:
        """The map moved: so did what was seen in it."""
        self.agreement.turned(float(T_new_old[2]))
        for kept in self._kept.values():
            kept[:] = [
                replace(
                    one,
                    T_map_laser=se2.compose(T_new_old, one.T_map_laser),
                    points_map=se2.transform(T_new_old, one.points_map),
                )
                for one in kept
            ]

    def _asked(self, stamp_ns: int, seen: Observations) -> list[KeptScan]:
        """The newest, and of the others about one of each age."""
        chosen, least_s = [], -math.inf
        for kept in reversed(self._kept[seen.T_robot_laser.tobytes()]):
            age_s = (stamp_ns - kept.stamp_ns) / NS_PER_S
            if kept.step != seen.view.step or age_s < least_s:
                continue
            chosen.append(kept)
            least_s = next((older_s for older_s in self._ages_s if older_s > age_s), math.inf)
        return chosen

    def weighted(
        self, stamp_ns: int, T_map_robot: Float, prior: Float, seen: Observations
    ) -> Observations:
        """With the weight of each return in [0, 1], and the share of them that was in view before.

        ``T_map_robot``: a pose predicted with a (3, 3) prior.
        """
        config, points, n = self._config, seen.points_robot, len(seen.points_robot)
        kept = self._asked(stamp_ns, seen) if config.settled_s > 0.0 else []
        if not kept or not n:
            return seen.weighted(np.ones(n))
        place, heading = max(float(prior[0, 0]), float(prior[1, 1])), float(prior[2, 2])
        spread = math.radians(config.spread_deg) + config.sigmas * math.sqrt(heading)
        asking = Asking(
            step=seen.view.step,
            margin=config.margin_m + config.sigmas * math.sqrt(place),
            spread=min(spread, 0.5 * math.pi),
            sure=1.0 / (1.0 + place / config.vague_m**2),  # else the prediction may be off
            settled_s=config.settled_s,
            came_s=config.came_s,
            left_s=config.left_s,
            left_m=config.left_m,
            along_m=config.along_m,
            thin_m=config.thin_m,
        )
        counts = [len(one.points_map) for one in kept]
        asked = Asked(
            lasers=np.concatenate([one.T_map_laser for one in kept]).reshape(-1, 3),
            limits=np.concatenate([one.limit for one in kept]).reshape(len(kept), -1),
            ages=np.array([(stamp_ns - one.stamp_ns) / NS_PER_S for one in kept]),
            points=np.concatenate([one.points_map for one in kept]),
            ends=np.array(list(accumulate(counts))),
        )
        now = Present(
            points=points,
            joined=seen.joined,
            limit=seen.view.limit,
            T_map_robot=T_map_robot,
            T_map_laser=se2.compose(T_map_robot, seen.T_robot_laser),
            T_robot_laser=seen.T_robot_laser,
        )
        scratch, bins = np.empty((6, max(n, *counts) + 1)), np.empty((2, len(now.limit)), np.int64)
        weights = np.empty(n)
        in_view = weigh(tuple(now), tuple(asked), tuple(asking), scratch, bins, weights)
        return seen.weighted(weights, in_view)
