# SPDX-License-Identifier: Apache-2.0
"""Labelled scans of a training stream: what they say of places that are right, and of wrong ones.

A SLAM runs over the stream. Every few seconds its map is asked what the next scan confirms (C) and
sees through (D) from the places that a search of the whole map finds for it, from the true place,
and from places a few metres beside that. The same is asked of a scan of another building, for which
no place is right. Copies of the SLAM are pushed and carried, for what slips and breaks look like.
"""

import copy
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from scripts.integrity.kidnap import kidnapped, targets
from slam import se2
from slam.frames import NS_PER_S, Float, Frame
from slam.frontend.observations import Observations, observe
from slam.shunting import ShuntingSlam
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.places import coarse
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.matcher import Match, Usual
from slam.tracker.matching.whole_search import WholeSearch

RIGHT_M, RIGHT_RAD = 0.15, 0.1  # a place nearer than both is right
WRONG_M, WRONG_RAD = 0.5, 0.3  # one farther by either is wrong; what lies between has no label
SURE_M, SURE_RAD = 0.05, 0.03  # off from scan to scan at most; else no scan is asked
SURE_S = 2.0  # all that time
MAPPED_S, EVERY_S = 15.0, 3.0  # before the first scan that is asked, and between two
BESIDE_M, BESIDE_RAD, BESIDE = (1.0, 5.0), 1.0, 2  # places beside the true one, a scan
PUSHES, CARRIED, FOLLOWED = 8, 6, 6  # copies that are pushed, and carried; scans after a push
PUSH_M, PUSH_RAD = 0.3, math.radians(5.0)
NEAR_M, NEAR_RAD = 0.1, 0.03  # a place nearby is right within both, and wrong beyond twice either
MOST_STEPS = 1000  # of a search
Place = tuple[float, float, bool]
"""C and D, m, and whether the place is right."""


@dataclass(frozen=True, kw_only=True)
class Labelled:
    """Of one stream.

    found    of each scan the places found for it; ``none``: of each scan of another building
    pairs    the true place of each scan, and places beside it
    reached  of each scan: most C of a place that a search found, and whether the true one is
    slips    places nearby: trace gained over where motion led, m, nats of the slip, and whether the
             place is right, not where motion led
    going    share of the usual match of scans at right poses; ``carried``: of carried robots
    """

    stream: str
    found: list[list[Place]] = field(default_factory=list)
    none: list[list[Place]] = field(default_factory=list)
    pairs: list[Place] = field(default_factory=list)
    reached: list[tuple[float, bool]] = field(default_factory=list)
    slips: list[tuple[float, float, bool]] = field(default_factory=list)
    going: list[float] = field(default_factory=list)
    carried: list[float] = field(default_factory=list)


def labelled(name: str, stream: Sequence[Frame], other: Sequence[Frame]) -> Labelled:
    """Of a stream with truth; ``other``, made in other rooms, gives the scans with no place."""
    one = _Collector(name, stream, other)
    with _noted() as shares:
        one.run(shares)
    return one.out


def off(pose: Float, truth: Float) -> tuple[float, float]:
    """By how many m and rad."""
    x, y, turn = (pose - truth).tolist()
    return math.hypot(x, y), abs(se2.wrap(turn))


class _Collector:
    """One pass of a SLAM over a stream."""

    def __init__(self, name: str, stream: Sequence[Frame], other: Sequence[Frame]) -> None:
        self._stream, self._other = stream, other
        self.out = Labelled(stream=name)
        self._rng = np.random.default_rng(len(stream))
        self._slam = ShuntingSlam()
        self._coarse = coarse(self._slam.config.tracking.relocalise)
        self._sure = _Sure(_world(stream[0]))

    def run(self, shares: list[float]) -> None:
        """``shares`` gets what goes on of the usual match at each scan."""
        stream, count = self._stream, len(self._stream)
        pushes = self._rng.integers(int(0.3 * count), int(0.9 * count), PUSHES).tolist()
        kidnaps = self._rng.integers(int(0.4 * count), int(0.9 * count), CARRIED).tolist()
        asked_s = MAPPED_S
        for k, frame in enumerate(stream):
            seconds = (frame.stamp_ns - stream[0].stamp_ns) / NS_PER_S
            if self._sure.of(seconds):
                if seconds >= asked_s:
                    asked_s = seconds + EVERY_S
                    self._ask(frame, self._other[k % len(self._other)])
                if k in pushes:
                    self._push(k, turned=pushes.index(k) % 2 == 1)
                if k in kidnaps:
                    self._carry(k, shares)
            shares.clear()
            pose = self._slam.update(frame.without_truth()).T_map_robot
            right = self._sure.follows(seconds, pose, _world(frame))
            if right and shares and seconds >= 1.0:
                self.out.going.append(shares[0])

    def _truth(self, frame: Frame) -> Float:
        """In the map, as it is around the pose before."""
        return self._sure.T_map(_world(frame))

    def _ask(self, frame: Frame, foreign: Frame) -> None:
        observations, truth = self._observed(frame), self._truth(frame)
        out, rng = self.out, self._rng
        known_m, through_m = self._evidence(observations, self._matched(observations, truth))
        out.pairs.append((known_m, through_m, True))
        for _ in range(BESIDE):
            way, far = rng.uniform(0.0, math.tau), rng.uniform(*BESIDE_M)
            turn = rng.uniform(-BESIDE_RAD, BESIDE_RAD)
            beside = truth + np.array([far * math.cos(way), far * math.sin(way), turn])
            out.pairs.append((*self._evidence(observations, beside), False))
        group = []
        for pose in self._searched(observations):
            m, rad = off(pose, truth)
            right = m < RIGHT_M and rad < RIGHT_RAD
            if right or m >= WRONG_M or rad >= WRONG_RAD:
                group.append((*self._evidence(observations, pose), right))
        out.found.append(group)
        best_m = max((found_m for found_m, _, _ in group), default=0.0)
        out.reached.append((best_m, any(right for _, _, right in group)))
        others = self._observed(foreign)
        out.none.append([(*self._evidence(others, at), False) for at in self._searched(others)])

    def _observed(self, frame: Frame) -> Observations:
        twist = frame.odometry.twist
        moving = np.zeros(3) if twist is None else np.asarray(twist)
        return observe(frame.without_truth(), moving, self._slam.config)

    def _matched(self, observations: Observations, pose: Float) -> Float:
        return self._slam.matched(observations, pose, self._coarse).T_map_robot

    def _searched(self, observations: Observations) -> Iterator[Float]:
        """The poses that a search of the whole map finds, matched."""
        config, matcher = self._slam.config, self._slam._matcher
        whole = CoarseMap(self._slam.cell_map, matcher.reward.short_term)
        points, most = observations.points_robot, config.tracking.relocalise.most
        search = WholeSearch(whole, points, most, config.matching.whole)
        for _ in range(MOST_STEPS):
            if search.done:
                return
            for pose in search.advance(Budget(config.matching.budget, 1.0)):
                yield self._matched(observations, pose)

    def _evidence(self, observations: Observations, pose: Float) -> tuple[float, float]:
        look = Evidence().add(self._slam.cell_map, observations, pose)
        return look.known, look.through

    def _push(self, k: int, *, turned: bool) -> None:
        """What the belief of a pushed copy, and of one that was not, makes of places nearby."""
        way = self._rng.uniform(0.0, math.tau)
        by = np.array([PUSH_M * math.cos(way), PUSH_M * math.sin(way), 0.0])
        if turned:
            by = np.array([0.0, 0.0, math.copysign(PUSH_RAD, way - math.pi)])
        for push in (by, np.zeros(3)):
            slam = copy.deepcopy(self._slam)
            slam.displace(push)
            for frame in self._stream[k : k + FOLLOWED]:
                slam.update(frame.without_truth())
                self._note_slips(slam, self._truth(frame))

    def _note_slips(self, slam: ShuntingSlam, truth: Float) -> None:
        episode = slam._belief._episode
        if episode is None:
            return
        led = _near(episode.match, truth)
        for place in episode.places.followed:
            slipped = place.prior > episode.carried_there and place.waited == 0
            right = _near(place.match, truth)
            if slipped and {led, right} == {True, False}:
                self.out.slips.append((place.gain_m, place.prior, right is True))

    def _carry(self, k: int, shares: list[float]) -> None:
        """What goes on of the usual match where a copy is put elsewhere."""
        whole = list(self._stream)
        for start in targets(whole[:k], whole, 1, 1):
            slam = copy.deepcopy(self._slam)
            shares.clear()
            for frame in kidnapped(whole[:k], whole, start, 1):
                slam.update(frame.without_truth())
            self.out.carried.extend(shares[:1])


def _world(frame: Frame) -> Float:
    assert frame.truth is not None
    return frame.truth


def _near(match: Match, truth: Float) -> bool | None:
    """None where it is neither right nor as wrong as after a push."""
    m, rad = off(match.T_map_robot, truth)
    if m < NEAR_M and rad < NEAR_RAD:
        return True
    return False if m > 2.0 * NEAR_M or rad > 2.0 * NEAR_RAD else None


class _Sure:
    """Whether a SLAM moves as its robot does, and where the robot is in its map.

    A map may be off as a whole, by what was drawn before much was known; so the latest pose and
    truth tie map and world.
    """

    def __init__(self, start: Float) -> None:
        self._start = self._truth = start
        self._pose = np.zeros(3)
        self._since_s = math.inf

    def of(self, seconds: float) -> bool:
        return seconds - self._since_s >= SURE_S

    def T_map(self, truth: Float) -> Float:
        return se2.compose(self._pose, se2.between(self._truth, truth))

    def follows(self, seconds: float, pose: Float, truth: Float) -> bool:
        """Take in the next pose; whether it is right in the world."""
        m, rad = off(pose, se2.between(self._start, truth))
        step_m, step_rad = off(pose, self.T_map(truth))
        right = m < WRONG_M and rad < WRONG_RAD
        if not right or step_m > SURE_M or step_rad > SURE_RAD:
            self._since_s = math.inf
        elif math.isinf(self._since_s):
            self._since_s = seconds
        self._pose, self._truth = pose, truth
        return right


@contextmanager
def _noted() -> Iterator[list[float]]:
    """All that ``Usual.share`` says."""
    said: list[float] = []
    plain = Usual.share

    def share(self: Usual, match: Match, observations: Observations) -> float:
        said.append(plain(self, match, observations))
        return said[-1]

    Usual.share = share  # type: ignore[method-assign]
    try:
        yield said
    finally:
        Usual.share = plain  # type: ignore[method-assign]
