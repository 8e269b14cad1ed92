# SPDX-License-Identifier: Apache-2.0
"""The scans of the last seconds, kept to say which present returns come from what stands."""

import math
from bisect import bisect_right
from dataclasses import dataclass, replace

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.frames import NS_PER_S
from slam.frontend.observations import Observations
from slam.tracker.standing.agreement import Agreement
from slam.tracker.standing.config import StandingConfig
from slam.tracker.standing.kernels import placed, votes


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


class _Asked:
    """The scans that are asked, side by side as the kernel takes them: from one present scan to the
    next only the newest is another, and no more is copied.

    lasers (k, 3), limits (k, bins), points (k, width, 2) of ``Look``; counts (k,) of the points
    """

    def __init__(self, most: int, bins: int, width: int) -> None:
        self.lasers, self.limits = np.empty((most, 3)), np.empty((most, bins))
        self.points, self.counts = np.empty((most, width, 2)), np.zeros(most, np.int64)
        self.ages_s = np.empty(most)
        self.scratch, self.bins = np.empty((6, width + 1)), np.empty((2, bins), np.int64)
        self._held: list[Look | None] = [None] * most

    def take(self, looks: list[Look], least: int, stamp_ns: int) -> bool:
        """Hold these, as they are at that time; False where there is no room for them, or for a
        present one of ``least`` points."""
        most, bins, held = self.points.shape[1], self.limits.shape[1], self._held
        if least > most:
            return False
        for k, look in enumerate(looks):
            self.ages_s[k] = (stamp_ns - look.stamp_ns) / NS_PER_S
            if held[k] is not look:
                n = len(look.points_map)
                if n > most or len(look.limit) != bins:
                    return False
                self.lasers[k], self.limits[k] = look.T_map_laser, look.limit
                self.points[k, :n], self.counts[k] = look.points_map, n
                held[k] = look
        return True


class Standing:
    """Gives each return its vote, by how long its place was not seen empty.

    agreement  of odometry with what was matched with these votes
    """

    def __init__(self, config: StandingConfig) -> None:
        self._config, self.agreement = config, Agreement(config)
        self._looks: list[Look] = []
        self._stamps_ns: list[int] = []  # theirs
        # a little less, as scans come when they come
        first_s = 0.95 * config.spacing_s
        ages_s = [first_s * config.ages_grow**k for k in range(config.views)]
        self._ages_ns = [whole_ns(age_s) for age_s in ages_s]
        self._oldest_ns = round(1.5 * ages_s[-1] * NS_PER_S)
        self._room = _Asked(0, 0, 0)

    def add(self, stamp_ns: int, T_map_robot: Float, seen: Observations) -> None:
        """Keep a scan that was tracked."""
        if self._config.settled_s == 0.0 or not len(seen.points_robot):
            return
        looks, config = self._looks, self._config
        if len(looks) > 1 and stamp_ns - looks[-2].stamp_ns < config.spacing_s * NS_PER_S:
            looks.pop()  # the newest is always there
            self._stamps_ns.pop()
        points_map = np.empty(seen.points_robot.shape)
        placed(seen.points_robot, T_map_robot, points_map)
        looks.append(
            Look(
                stamp_ns=stamp_ns,
                T_map_laser=se2.compose(T_map_robot, seen.T_robot_laser),
                points_map=points_map,
                limit=seen.view.limit,
                step=seen.view.step,
            )
        )
        self._stamps_ns.append(stamp_ns)
        oldest = stamp_ns - self._oldest_ns
        while looks[0].stamp_ns < oldest:
            del looks[0], self._stamps_ns[0]

    def moved(self, T_new_old: Float) -> None:
        """The map moved: so did what was seen in it."""
        self.agreement.turned(float(T_new_old[2]))
        self._looks = [
            replace(
                look,
                T_map_laser=se2.compose(T_new_old, look.T_map_laser),
                points_map=se2.transform(T_new_old, look.points_map),
            )
            for look in self._looks
        ]

    def _asked(self, stamp_ns: int, step: float) -> list[Look]:
        """The newest, and of the others about one of each age."""
        looks, chosen = self._looks, []
        k = len(looks)
        while k > 0:
            look = looks[k - 1]
            if look.step != step:
                k -= 1
                continue
            chosen.append(look)
            age = stamp_ns - look.stamp_ns
            older = bisect_right(self._ages_ns, age)
            if older == len(self._ages_ns):
                break
            k = bisect_right(self._stamps_ns, stamp_ns - self._ages_ns[older], 0, k - 1)
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
        place, heading = max(float(prior[0, 0]), float(prior[1, 1])), float(prior[2, 2])
        spread = math.radians(config.spread_deg) + config.sigmas * math.sqrt(heading)
        asking = (
            seen.view.step,
            config.margin_m + config.sigmas * math.sqrt(place),
            min(spread, 0.5 * math.pi),
            1.0 / (1.0 + place / config.vague_m**2),  # else the prediction may be what is off
            config.settled_s,
            config.left_m,
            config.along_m,
            config.thin_m,
        )
        if not self._room.take(asked, len(points), stamp_ns):
            width = 2 * max(len(points), *[len(look.points_map) for look in asked])
            self._room = _Asked(len(self._ages_ns) + 1, len(seen.view.limit), width)
            self._room.take(asked, len(points), stamp_ns)
        room = self._room
        out = np.empty(len(points))
        in_view = votes(
            points, seen.joined, seen.view.limit, T_map_robot,
            se2.compose(T_map_robot, seen.T_robot_laser), seen.T_robot_laser,
            room.lasers, room.limits, room.ages_s, room.points, room.counts,
            (len(asked), config.came_s, config.left_s), asking, room.scratch, room.bins, out,
        )  # fmt: skip
        return seen.with_votes(out, in_view)


def whole_ns(seconds: float) -> int:
    """The least whole ns that are that many seconds or more, as a division has them."""
    near = round(seconds * NS_PER_S)
    return next((k for k in range(near - 1, near + 2) if k / NS_PER_S >= seconds), near)
