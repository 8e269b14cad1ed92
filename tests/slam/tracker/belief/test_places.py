# SPDX-License-Identifier: Apache-2.0
"""Places where the robot may be: found, carried on, asked, and which of them are kept."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slam import se2
from slam.frontend.observations import Observations
from slam.frontend.odometry_prior import Prediction, turned
from slam.tracker.belief.likelihood import evidence, probabilities
from slam.tracker.belief.places import ANEW, MOST_ANEW, Place, Places, is_same, novelty
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.matcher import Matcher, unmatched
from slam.tracker.network import Network
from tests.slam.tracker.belief.drives import LONG_TURN, ROOMS, mapped, still
from tests.slam.tracker.belief.drives import estimates as said
from tests.slam.tracker.belief.rooms import CONFIGS, ORIGIN, known, seen
from tests.world2d import World2D, arena, going_on

ROOM = World2D(arena())
CONFIG = CONFIGS[Network]
NUMBERS = CONFIG.tracking.relocalise
BACK = np.array([0.0, 0.0, math.pi])


@pytest.fixture(scope="module")
def room() -> CellMap:
    """The room, looked at for long; nobody writes to it."""
    return known(Network, ROOM, 20.0, ORIGIN, BACK)


def place(x: float, y: float, heading: float = 0.0, **more: Any) -> Place:
    pose = np.array([x, y, heading])
    return Place(match=unmatched(pose, matched=1.0, score=0.0), **more)


def by(increment: Any, believed: Any = ORIGIN, sigma: float = 0.03) -> Prediction:
    """Odometry of one scan, of a robot that is believed to be there."""
    return Prediction(
        T_map_robot=se2.compose(np.array(believed), np.array(increment)),
        increment=np.array(increment), covariance=np.diag([sigma**2] * 3), twist=np.zeros(3),
        elapsed=0.2,
    )  # fmt: skip


def budget(share: float = 0.5) -> Budget:
    return Budget(CONFIG.matching.budget, share)


def test_a_scan_is_as_new_as_the_robot_has_moved() -> None:
    assert novelty(np.zeros(3)) == 0.0
    for k in range(3):
        moved = np.zeros(3)
        for share in (0.1, 0.5, 1.0, 3.0):
            moved[k] = share * ANEW[k]
            assert novelty(moved) == pytest.approx(min(share, 1.0))
    assert novelty(0.5 * ANEW) == pytest.approx(0.5)  # the most of the three: they say the same
    assert novelty(np.array([0.1, 0.2, 0.3]) * ANEW) == pytest.approx(0.3)


def test_a_scan_weighs_by_its_novelty_and_says_less_for_what_is_found(room: CellMap) -> None:
    """Who stands learns as much in many scans as in few."""
    view, sums = seen(ROOM, ORIGIN, Network), []
    for step in (0.03, 0.1):
        places = Places(room, Matcher(CONFIG))
        places.followed = [place(0.0, 0.0)]
        for _ in range(round(0.6 / step)):
            back = unmatched(np.array([-step, 0.0, 0.0]), matched=1.0, score=0.0)
            places.followed = [replace(places.followed[0], match=back)]
            places.follow(view, replace(by([step, 0.0, 0.0]), elapsed=0.01), budget(1.0))
        sums.append(places.followed[0].nats)
        of_one = places.evidence(places.followed[0].match)
        assert sums[-1] == pytest.approx(0.6 / ANEW[0] * of_one, rel=0.05)
    assert sums[0] == pytest.approx(sums[1], rel=0.02)
    share = places.followed[0].match.overlapped / places._matcher.usual.match
    assert of_one == pytest.approx(evidence(CONFIG.belief, share) - CONFIG.belief.new)
    assert of_one > 0.0 > places.evidence(unmatched(ORIGIN, matched=0.0, score=0.0))


def test_a_place_s_evidence_is_bounded_and_lags_behind_the_prior(room: CellMap) -> None:
    """Of many new scans the mean says as much as a few; further ones see the same again."""
    for anew in (0.5, MOST_ANEW, 4.0 * MOST_ANEW):
        for each in (-2.0, 5.0):
            nats = place(0.0, 0.0, evidence=anew * each, anew=anew).nats
            assert nats == pytest.approx(min(anew, MOST_ANEW) * each)
    places = Places(room, Matcher(CONFIG))
    places.followed = [place(0.0, 0.0, evidence=10.0 * MOST_ANEW, anew=2.0 * MOST_ANEW, lag=0.5)]
    places.lag(1.5)
    assert places.followed[0].nats == pytest.approx(5.0 * MOST_ANEW - 2.0)


def test_places_that_are_one_are_followed_once_and_hopeless_ones_not(room: CellMap) -> None:
    places, near = Places(room, Matcher(CONFIG)), 0.5 * NUMBERS.same_m
    beside, best = place(0.0, 0.0, scans=9, evidence=0.0), place(near, 0.0, scans=5, evidence=8.0)
    again = place(near + 0.01, 0.0, evidence=9.0)  # the same pose, found anew
    aside, far = (
        place(0.0, 0.0, 2.0 * NUMBERS.same_rad, evidence=2.0),
        place(3.0, 0.0, evidence=5.0),
    )
    hopeless = place(-3.0, 0.0, evidence=7.9 - CONFIG.belief.hopeless)
    assert is_same(best.match, again.match)
    assert not is_same(best.match, beside.match)
    places.followed = [best]
    places.keep([beside, again, aside, hopeless, far])
    assert [id(one) for one in places.followed] == [id(best), id(far), id(aside)]
    places.keep([])
    assert len(places.followed) == 3
    many = [place(float(k), 0.0, evidence=float(k)) for k in range(2 * NUMBERS.most)]
    places.followed = []
    places.keep(many)
    assert places.followed == many[: -NUMBERS.most - 1 : -1]


def test_headings_that_differ_by_a_whole_turn_are_one() -> None:
    one, other = place(0.0, 0.0, math.pi - 0.01), place(0.0, 0.0, 0.01 - math.pi)
    assert is_same(one.match, other.match)
    assert one.is_at(other.match.T_map_robot, NUMBERS)


def test_a_place_is_carried_on_by_odometry_and_matched_to_the_scan(room: CellMap) -> None:
    """It begins at the origin while the robot is believed to be elsewhere, turned."""
    places = Places(room, Matcher(CONFIG))
    places.followed = [place(0.0, 0.0)]
    truth = np.array([0.2, 0.0, 0.05])
    off = truth + np.array([0.02, -0.02, 0.01])
    places.follow(seen(ROOM, truth, Network), by(off, believed=(3.0, 1.0, 2.0)), budget())
    (followed,) = places.followed
    np.testing.assert_allclose(followed.match.T_map_robot, truth, atol=0.01)
    assert (followed.scans, followed.waited) == (2, 0)
    assert followed.latest > 0.0
    np.testing.assert_allclose(followed.way, [math.hypot(0.22, 0.02), 0.06, 0.2])
    assert not followed.asked.any()
    assert followed.nats == pytest.approx(novelty(followed.way) * followed.latest)


def test_who_waits_is_carried_on_by_odometry_which_may_be_off(room: CellMap) -> None:
    """Against sampling; the map's axes are turned by 2 rad against where it is believed to be."""
    places, rng = Places(room, Matcher(CONFIG)), np.random.default_rng(5)
    step, sigma, n = np.array([0.1, 0.0, 0.06]), np.array([0.03, 0.01, 0.02]), 4000
    places.followed = [place(1.0, 2.0, 3.0, evidence=3.0)]
    drawn, believed = np.tile(places.followed[0].match.T_map_robot, (n, 1)), np.zeros(3)
    believed[2] = 1.0
    for _ in range(10):
        covariance = turned(np.diag(sigma**2), float(believed[2]))
        places.wait(replace(by(step, believed), covariance=covariance))
        believed = se2.compose(believed, step)
        steps = step + sigma * rng.normal(size=(n, 3))
        drawn = np.array([se2.compose(a, b) for a, b in zip(drawn, steps, strict=True)])
    (one,) = places.followed
    off = drawn - one.match.T_map_robot
    off[:, 2] = (off[:, 2] + math.pi) % math.tau - math.pi
    np.testing.assert_allclose(one.drift, off.T @ off / n, rtol=0.2, atol=4e-4)
    assert (one.scans, one.waited, one.nats) == (1, 10, 3.0)
    np.testing.assert_allclose(one.asked, [1.0, 0.6, 2.0])


def test_places_are_asked_by_turns_where_the_budget_ends(room: CellMap) -> None:
    places, still_there = Places(room, Matcher(CONFIG)), by(np.zeros(3), sigma=1e-3)
    places.followed = [place(x, 0.0) for x in (0.0, 0.5, 1.0)]
    view = seen(ROOM, ORIGIN, Network)
    for _ in range(6):
        places.follow(view, still_there, budget(1e-6))
        assert sum(one.waited == 0 for one in places.followed) == 1
    assert [one.scans for one in places.followed] == [3, 3, 3]


def stepped(places: Places, view: Observations, share: float) -> list[Place]:
    """One scan with ``share`` of a budget; places that are new."""
    left = budget(share)
    places.follow(view, by(np.zeros(3), sigma=1e-3), left)
    return places.explore(view, left)


def test_the_search_of_the_whole_map_finds_the_robot_over_several_scans(room: CellMap) -> None:
    """However little of it a scan may do."""
    truth = np.array([1.5, -1.0, 0.7])
    view, took = seen(ROOM, truth, Network), []
    for share in (0.5, 0.05):
        places, steps = Places(room, Matcher(CONFIG)), 0
        new: list[Place] = []
        while places.searches == 0 and steps < 1000:
            new, steps = new + stepped(places, view, share), steps + 1
        best = max(new, key=lambda one: one.nats)
        assert np.abs(best.match.T_map_robot - truth).max() < 0.02
        assert best.nats == pytest.approx(best.latest)
        took.append(steps)
    assert took[1] > took[0]


def test_the_covariance_is_that_of_the_mixture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of poses drawn with these probabilities, about the one that is reported; headings wrap."""
    system, last = mapped(ROOMS, LONG_TURN)
    said(system, going_on(still(ROOMS, (3.0, 2.5, -1.0), 0.2), last)[:1])
    belief, rng, here = system._belief, np.random.default_rng(2), np.array([1.0, -2.0, 3.0])
    assert belief._doubt is not None
    poses = [np.array([4.0, 1.0, -3.1]), np.array([-2.0, 0.5, 1.0])]
    belief._doubt.places.followed = [place(*poses[0], evidence=0.5), place(*poses[1], evidence=1.5)]
    monkeypatch.setattr(belief, "_unknown", 1.0)
    best = CONFIG.belief.best  # of all found in the whole map
    shares = probabilities([0.0, 1.0, 1.5 - best, 2.5 - best])
    drawn = rng.choice(4, 200_000, p=shares)
    off = np.array([here, here, *poses])[drawn] - here  # the unknown counts by itself
    off[:, 2] = (off[:, 2] + math.pi) % math.tau - math.pi
    anywhere = np.diag([9.0, 4.0, 1.0])
    belief._weigh(belief._doubt)
    found = belief.spread_about(here, lambda _: anywhere)
    assert belief.p_lost == pytest.approx(1.0 - shares[0])
    expected = off.T @ off / len(off) + belief.p_lost * anywhere
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=0.03)
    belief._doubt = None
    assert not belief.spread_about(here, lambda _: anywhere).any()
