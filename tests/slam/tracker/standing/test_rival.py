# SPDX-License-Identifier: Apache-2.0
"""A second pose: found where the first has slipped, carried until one fails, and never a worse."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.frontend.observations import Observations, from_scan
from slam.frontend.odometry_prior import Prediction, inverted
from slam.shunting.config import ShuntingConfig
from slam.shunting.map.network import Network
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.rasterise import rasterise
from slam.tracker.standing.recent import Standing
from slam.tracker.standing.rival import Rival
from tests.slam.tracker.matching.test_matcher import CONFIG, room_scan

Array = NDArray[np.float64]
PUSHES = [(0.3, 0.0, 0.0), (-0.2, 0.22, 0.0), (0.0, 0.0, math.radians(10.0))]
STEP_S = 0.2
PRIOR = np.diag([0.01**2, 0.01**2, 0.005**2])
NUMBERS = CONFIG.standing


class Denied(Standing):
    """Takes the vote from half of the returns wherever they are seen from."""

    def votes(self, stamp_ns: int, T_map_robot: Array, prior: Array, seen: Observations) -> Array:
        out = np.ones(len(seen.points_robot))
        out[::2] = 0.0
        return out


def known_room() -> Network:
    """Looked at for 20 s from the origin."""
    network, seen = Network(CONFIG), from_scan(room_scan(np.zeros(3)), np.zeros(3), CONFIG)
    for _ in range(20):
        rasterise(network, seen, np.zeros(3))
        network.integrate(seen.view, seen.T_robot_laser, 1.0, write=True)
    return network


ROOM = known_room()


class Asked:
    """A robot that stands at the origin and is believed to be elsewhere."""

    def __init__(self, config: ShuntingConfig = CONFIG) -> None:
        matcher = Matcher(config)
        standing = Denied(config.standing)
        self.matcher, self.rival = matcher, Rival(matcher, standing)
        seen = from_scan(room_scan(np.zeros(3)), np.zeros(3), CONFIG)
        votes = standing.votes(0, np.zeros(3), PRIOR, seen)
        self.seen = replace(seen, votes=votes)

    def at(self, pose: tuple[float, float, float]) -> tuple[Match, Match]:
        """The match of the believed pose, and what is made of it, one scan on."""
        T = np.array(pose)
        prediction = Prediction(
            T_map_robot=T, increment=np.zeros(3), covariance=PRIOR, twist=np.zeros(3),
            elapsed=STEP_S,
        )  # fmt: skip
        match = self.matcher.climb(ROOM, self.seen, T, T, inverted(PRIOR))
        return match, self.rival.decided(ROOM, 0, self.seen, prediction, match)

    def settled(self) -> Asked:
        """After 10 s at the right place."""
        for _ in range(50):
            match, decided = self.at((0.0, 0.0, 0.0))
            assert decided is match
            assert not self.rival.undecided
        return self


@pytest.mark.parametrize("push", PUSHES)
def test_after_a_push_the_right_place_is_carried_and_then_taken(
    push: tuple[float, float, float],
) -> None:
    asked = Asked().settled()
    for _ in range(NUMBERS.rival_scans - 1):
        match, decided = asked.at(push)
        assert decided is match  # not at once: a crowd may be in the way
        assert asked.rival.undecided
    _, decided = asked.at(push)
    assert decided.slipped
    assert not asked.rival.undecided
    assert math.hypot(*decided.T_map_robot[:2].tolist()) < 0.01
    assert abs(float(decided.T_map_robot[2])) < math.radians(0.2)


def test_the_first_pose_stays_once_it_explains_as_much() -> None:
    asked = Asked().settled()
    asked.at((0.3, 0.0, 0.0))
    assert asked.rival.undecided
    match, decided = asked.at((0.0, 0.0, 0.0))
    assert decided is match
    assert not asked.rival.undecided


def test_a_place_out_of_reach_is_not_found() -> None:
    asked = Asked().settled()
    for _ in range(10):
        match, decided = asked.at((3.0 * NUMBERS.rival_m, 0.0, 1.0))
        assert decided is match


def test_where_all_returns_vote_nothing_speaks_for_a_slip() -> None:
    asked = Asked().settled()
    asked.seen = replace(asked.seen, votes=np.ones(len(asked.seen.points_robot)))
    for _ in range(10):
        match, decided = asked.at((0.3, 0.0, 0.0))
        assert decided is match


def test_it_can_be_taken_out() -> None:
    asked = Asked(CONFIG.changed({"standing.fallen": 0.0}))
    for _ in range(10):
        match, decided = asked.at((0.3, 0.0, 0.0))
        assert decided is match
