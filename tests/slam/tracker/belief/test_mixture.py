# SPDX-License-Identifier: Apache-2.0
"""The covariance of a pose that may be at several places, and where they are followed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slam import se2
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, squared, turned
from slam.tracker.belief.episode import Episode, second_moment
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.places import Place, Places
from slam.tracker.belief.posterior import Odds
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.matcher import Matcher, unmatched
from tests.slam.tracker.belief.rooms import CONFIGS, KINDS, ORIGIN, known, seen
from tests.world2d import World2D, arena

ROOM = World2D(arena())
NETWORK: type[CellMap] = KINDS[0]
CONFIG = CONFIGS[NETWORK]


def place(x: float, y: float, heading: float = 0.0, scans: int = 1) -> Place:
    pose = np.array([x, y, heading])
    return Place(match=unmatched(pose, matched=1.0, score=0.0), evidence=Evidence(), scans=scans)


def test_the_moment_about_a_pose_is_that_of_samples() -> None:
    """Of poses drawn with these shares, about the one that is reported; headings wrap."""
    rng = np.random.default_rng(2)
    here = np.array([1.0, -2.0, 3.0])
    poses = [np.array([4.0, 1.0, -3.1]), np.array([-2.0, 0.5, 1.0]), here.copy()]
    shares = [0.2, 0.5, 0.3]
    drawn = np.array(poses)[rng.choice(3, 200_000, p=shares)] - here
    drawn[:, 2] = (drawn[:, 2] + math.pi) % math.tau - math.pi
    expected = drawn.T @ drawn / len(drawn)
    before = [pose.copy() for pose in poses]
    found = second_moment(poses, shares, here)
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=0.02)
    np.testing.assert_array_equal(found, found.T)
    np.testing.assert_array_equal(poses, before)


def test_places_that_are_one_are_followed_once_and_hopeless_ones_not() -> None:
    places = Places(known(NETWORK, ROOM, 1.0, ORIGIN), Matcher(CONFIG))
    numbers = CONFIG.tracking.relocalise
    beside, best = place(0.0, 0.0, scans=9), place(0.5 * numbers.same_m, 0.0, scans=5)
    again = place(0.5 * numbers.same_m + 0.01, 0.0)  # the same pose, found anew
    turned = place(0.0, 0.0, 2.0 * numbers.same_rad)
    far, hopeless = place(3.0, 0.0), place(-3.0, 0.0)
    nats = {id(beside): 0.0, id(best): 8.0, id(again): 9.0, id(turned): 2.0, id(far): 5.0}
    nats[id(hopeless)] = -50.0
    new = [beside, again, turned, hopeless, far, best]
    places.keep(new, lambda one: nats[id(one)], 20.0)
    assert [id(one) for one in places.followed] == [id(best), id(far), id(turned)]
    many = [place(float(k), 0.0) for k in range(2 * numbers.most)]
    places.keep(many, lambda one: float(one.match.T_map_robot[0]), 1e6)
    assert len(places.followed) == numbers.most
    assert places.followed[0] is many[-1]


def test_a_place_a_hand_away_speaks_for_the_motion_against_places_elsewhere() -> None:
    """The motion led a little off, and sees through much: what explains that is next to it."""
    odds = Odds(CONFIG.belief, CONFIG.carried_per_h)
    episode = Episode(known(NETWORK, ROOM, 1.0, ORIGIN), Matcher(CONFIG), odds, 0.1)
    near, elsewhere = place(0.2, 0.0), place(5.0, 0.0)
    near.evidence.known_m = elsewhere.evidence.known_m = 8.0
    episode.evidence.through_m = 20.0
    slip = 0.5 * episode.carried_there
    episode.places.followed = [replace(near, prior=slip), elsewhere]
    of = episode.weighed()
    assert of.followed > 0.99
    assert math.log(of.places[0] / of.followed) == pytest.approx(slip)  # it confirms no more
    leads = replace(place(0.3, 0.0), evidence=near.evidence, prior=slip, gain_m=2.0)
    both = [replace(near, prior=slip), leads]
    said = []
    for episode.places.followed in (both, both[::-1]):  # in no order
        one = episode.weighed()
        assert one.followed < 0.01 < max(one.places)
        said.append(sorted(one.places))
    np.testing.assert_allclose(said[0], said[1])
    episode.places.followed = [elsewhere]
    assert episode.weighed().places[0] > 100.0 * episode.weighed().followed


def test_a_room_that_is_new_may_look_like_one_that_is_known_unless_the_map_denies_it() -> None:
    """However much more of the known one is confirmed."""
    odds = Odds(CONFIG.belief, CONFIG.carried_per_h)
    episode = Episode(known(NETWORK, ROOM, 1.0, ORIGIN), Matcher(CONFIG), odds, 0.1)
    elsewhere, carried = place(5.0, 0.0), episode.carried_there
    episode.places.followed = [elsewhere]
    for known_m in (15.0, 30.0, 60.0):
        elsewhere.evidence.known_m = known_m
        one = episode.weighed()
        lead = math.log(one.places[0] / one.followed)
        assert lead == pytest.approx(CONFIG.belief.alike + carried)
    episode.evidence.through_m = 20.0  # what stood where motion led is seen through
    one = episode.weighed()
    lead = math.log(one.places[0] / one.followed)
    assert lead == pytest.approx(CONFIG.belief.alike + carried + odds.denied(20.0))


def test_a_place_as_far_off_as_odometry_may_be_is_no_slip() -> None:
    """A robot that saw nothing of its map for a while need not have been carried to be far off."""
    odds = Odds(CONFIG.belief, CONFIG.carried_per_h)
    episode = Episode(known(NETWORK, ROOM, 1.0, ORIGIN), Matcher(CONFIG), odds, 0.1)
    rng, step, sigma = np.random.default_rng(5), np.array([0.1, 0.0, 0.06]), np.array([0.03] * 3)
    drawn, pose = np.zeros((2000, 3)), np.array([1.0, 2.0, 3.0])
    drawn += pose
    for _ in range(40):
        heading = float(pose[2])
        pose = se2.compose(pose, step)
        episode.moved(
            Prediction(
                T_map_robot=pose,
                increment=step,
                twist=np.zeros(3),
                elapsed=0.1,
                covariance=turned(np.diag(sigma**2), heading),
            )
        )
        steps = step + sigma * rng.normal(size=(2000, 3))
        drawn = np.array([se2.compose(a, b) for a, b in zip(drawn, steps, strict=True)])
    off = drawn - pose
    off[:, 2] = (off[:, 2] + math.pi) % math.tau - math.pi
    np.testing.assert_allclose(episode.drift, off.T @ off / len(off), rtol=0.15, atol=0.01)
    far = off[np.hypot(off[:, 0], off[:, 1]) > 0.7]
    assert len(far) > 60  # of 2000
    usual = min(far, key=lambda one: squared(one, episode.drift))
    there = unmatched(pose + usual, matched=1.0, score=0.0)
    assert episode.prior(there, pose) > episode.carried_there + 5.0
    slip = odds.slipped(0.1, math.hypot(*usual[:2]), float(usual[2]))
    assert slip < episode.carried_there


def test_a_place_is_carried_on_by_odometry_and_matched_to_the_scan() -> None:
    """It begins at the origin while the robot is believed to be elsewhere, turned."""
    cell_map = known(NETWORK, ROOM, 20.0, ORIGIN)
    places = Places(cell_map, Matcher(CONFIG))
    places.followed = [place(0.0, 0.0)]
    truth = np.array([0.2, 0.0, 0.05])
    believed = np.array([3.0, 1.0, 2.0])
    prediction = Prediction(
        T_map_robot=believed, increment=truth + np.array([0.02, -0.02, 0.01]),
        covariance=np.diag([0.03**2, 0.03**2, 0.02**2]), twist=np.zeros(3), elapsed=0.2,
    )  # fmt: skip
    budget = Budget(CONFIG.matching.budget, 0.5)
    places.follow(seen(ROOM, truth, NETWORK), prediction, budget, Evidence())
    followed = places.followed[0]
    np.testing.assert_allclose(followed.match.T_map_robot, truth, atol=0.01)
    assert (followed.scans, followed.waited) == (2, 0)
    assert followed.evidence.known_m > 5.0
    assert followed.gain_m == followed.evidence.latest_m / 2.0  # the mean of its two scans


def stepped(places: Places, view: Observations, still: Prediction, share: float) -> list[Place]:
    """One scan with ``share`` of a budget; places that are new."""
    budget = Budget(CONFIG.matching.budget, share)
    places.follow(view, still, budget, Evidence())
    return places.explore(view, budget)


def test_the_search_of_the_whole_map_finds_the_robot_over_several_scans() -> None:
    """However little of it a scan may do."""
    cell_map = known(NETWORK, ROOM, 20.0, ORIGIN, np.array([0.0, 0.0, math.pi]))
    truth = np.array([1.5, -1.0, 0.7])
    view = seen(ROOM, truth, NETWORK)
    still = Prediction(
        T_map_robot=ORIGIN, increment=np.zeros(3), covariance=np.diag([1e-6] * 3),
        twist=np.zeros(3), elapsed=0.2,
    )  # fmt: skip
    took = []
    for share in (0.5, 0.05):
        places, steps = Places(cell_map, Matcher(CONFIG)), 0
        new: list[Place] = []
        while not new and steps < 1000:
            new, steps = stepped(places, view, still, share), steps + 1
        while places.searches == 0 and steps < 1000:
            new, steps = new + stepped(places, view, still, share), steps + 1
        off = min(np.abs(one.match.T_map_robot - truth).max() for one in new)
        assert off < 0.02
        took.append(steps)
    assert took[1] > took[0]
