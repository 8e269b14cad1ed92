# SPDX-License-Identifier: Apache-2.0
"""Which returns vote: what stands, what was never seen, and what is too thin to be missed."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.frames import NS_PER_S, Scan
from slam.frontend.observations import Observations, from_scan
from slam.shunting.slam import ShuntingConfig
from slam.tracker.matching.matcher import Matcher, seen_by
from slam.tracker.standing.config import ALL_VOTE, StandingConfig
from slam.tracker.standing.recent import Standing, whole_ns
from tests.slam.tracker.matching.test_matcher import CONFIG, room
from tests.world2d import World2D, laser, rectangle

Array = NDArray[np.float64]
HERE = np.zeros(3)
SURE = np.diag([1e-10, 1e-10, 1e-10])
ROOM = rectangle(-3.0, -3.0, 5.0, 3.0)
NUMBERS = StandingConfig()


def seen(*boxes: Array) -> Observations:
    spec = laser(361)
    ranges = World2D(np.vstack([ROOM, *boxes])).ranges(
        0.0, np.tile(spec.T_robot_laser, (361, 1)), spec.angles, 80.0
    )
    scan = Scan(stamp_ns=0, ranges=ranges.astype(np.float32), spec=spec)
    return from_scan(scan, np.zeros(3), CONFIG)


def box(x: float, y: float, half: float = 0.25) -> Array:
    return rectangle(x - half, y - half, x + half, y + half)


def votes(
    before: Observations, now: Observations, age_s: float, *, prior: Array = SURE
) -> tuple[Array, Array]:
    """Of what is nearer than the walls, and of the walls, ``age_s`` after the only earlier scan."""
    standing = Standing(NUMBERS)
    standing.add(0, HERE, before)
    found = seen_by(standing.with_votes(round(age_s * NS_PER_S), HERE, prior, now)).votes
    x, y = now.points_robot.T
    inside = (np.abs(x - 1.0) < 3.8) & (np.abs(y) < 2.8)
    return found[inside], found[~inside]


def test_who_came_to_where_it_was_empty_has_no_vote_and_the_walls_have_theirs() -> None:
    came, walls = votes(seen(), seen(box(2.0, 0.0)), 0.2)
    assert len(came) > 20
    assert came.max() < 0.01
    assert walls.min() == 1.0


@pytest.mark.parametrize("age_s", [0.5, 2.0, 5.0, 9.0])
def test_the_vote_grows_with_the_time_that_it_may_have_stood(age_s: float) -> None:
    came, _ = votes(seen(), seen(box(2.0, 0.0)), age_s)
    square = (age_s / NUMBERS.settled_s) ** 2
    assert came == pytest.approx(square / (1.0 + square), rel=1e-3)


def test_what_stands_as_before_votes_and_so_does_a_wall_that_was_hidden() -> None:
    stands, walls = votes(seen(box(2.0, 0.0)), seen(box(2.0, 0.0)), 0.2)
    assert stands.min() == 1.0
    assert walls.min() == 1.0
    _, revealed = votes(seen(box(2.0, 0.0)), seen(), 0.2)
    assert revealed.min() == 1.0


def test_who_walks_away_into_its_own_shadow_is_told_by_the_place_that_it_left() -> None:
    away, walls = votes(seen(box(2.0, 0.0)), seen(box(2.2, 0.0)), 0.2)
    assert away.max() < 0.01
    assert walls.min() == 1.0


def test_a_thing_too_thin_to_be_hit_by_every_scan_keeps_its_vote() -> None:
    came, _ = votes(seen(), seen(box(2.0, 0.0, half=0.02)), 0.2)
    assert len(came) > 0
    assert came.min() == 1.0


def test_where_the_prediction_is_vague_nobody_loses_the_vote() -> None:
    vague = np.diag([0.3**2, 0.3**2, 0.1**2])
    came, _ = votes(seen(), seen(box(2.0, 0.0)), 0.2, prior=vague)
    assert came.min() > 0.9


def test_what_no_scan_had_in_view_is_told_apart() -> None:
    """Where the robot has turned to, and what a box hid: no scan can have seen what is there."""
    standing, now = Standing(NUMBERS), seen()
    standing.add(0, HERE, now)
    again = standing.with_votes(NS_PER_S // 5, HERE, SURE, now)
    turned = standing.with_votes(NS_PER_S // 5, np.array([0.0, 0.0, 0.5 * np.pi]), SURE, now)
    hidden = Standing(NUMBERS)
    hidden.add(0, HERE, seen(box(1.0, 0.0)))
    behind = hidden.with_votes(NS_PER_S // 5, HERE, SURE, now)
    assert again.in_view > 0.98
    assert turned.in_view < 0.5
    assert 0.6 < behind.in_view < 0.95
    assert Standing(NUMBERS).with_votes(0, HERE, SURE, now).in_view == 1.0


def test_all_vote_without_earlier_scans_and_when_it_is_off() -> None:
    now = seen(box(2.0, 0.0))
    assert seen_by(Standing(NUMBERS).with_votes(0, HERE, SURE, now)).votes.min() == 1.0
    off = Standing(ALL_VOTE)
    off.add(0, HERE, seen())
    assert seen_by(off.with_votes(NS_PER_S // 5, HERE, SURE, now)).votes.min() == 1.0


def test_scans_are_kept_for_seconds_at_any_rate_and_few_are_asked() -> None:
    scan = seen()
    for period_ns in (26_666_667, 213_333_333, NS_PER_S):
        standing = Standing(NUMBERS)
        for k in range(20 * NS_PER_S // period_ns):
            standing.add(k * period_ns, HERE, scan)
        now_ns = (k + 1) * period_ns
        asked = [now_ns - look.stamp_ns for look in standing._asked(now_ns, scan.view.step)]
        assert asked[0] == period_ns
        assert len(asked) <= NUMBERS.views + 1
        assert asked == sorted(asked)
        assert 4 * NS_PER_S < asked[-1] < 12 * NS_PER_S


def test_with_all_votes_a_match_is_bit_for_bit_one_without() -> None:
    network, matcher, scan = room(), Matcher(CONFIG), seen()
    same = np.ones(len(scan.points_robot))
    start, firm = np.array([0.01, 0.01, 0.0]), np.diag([1e4, 1e4, 1e6])
    one = matcher.climb(network, scan, start, HERE, firm)
    other = matcher.climb(network, _voting(scan, same), start, HERE, firm)
    assert one.T_map_robot.tobytes() == other.T_map_robot.tobytes()
    assert one.matched == other.matched == other.overlapped
    assert seen_by(scan).votes.min() == 1.0


def test_without_a_vote_what_is_young_says_nothing_and_is_not_missed() -> None:
    config = ShuntingConfig(cell_m=0.05, trace_s=0.0)  # the map is all young
    network, scan = room(), seen()
    network.cells.y[:] = 0.0
    matcher = Matcher(config)
    nobody = _voting(scan, np.zeros(len(scan.points_robot)))
    match = matcher.climb(network, nobody, HERE, HERE, np.eye(3))
    assert match.information.any() == False  # noqa: E712 (numpy)
    assert match.overlapped == 0.0
    assert np.array_equal(match.T_map_robot, HERE)


def _voting(scan: Observations, given: Array) -> Observations:
    return replace(scan, votes=given)


@pytest.mark.parametrize("seconds", [0.19, 0.475, 1.1875, 2.96875, 7.421875, 1e-9, 3e17])
def test_whole_ns_say_the_same_as_seconds(seconds: float) -> None:
    least = whole_ns(seconds)
    assert least / NS_PER_S >= seconds
    assert (least - 1) / NS_PER_S < seconds or seconds > 1e6


def test_one_of_each_age_is_asked_however_often_scans_come() -> None:
    now, rng = seen(), np.random.default_rng(3)
    for gap_s in (0.027, 0.2, 0.7, 5.0):
        standing, stamp_ns = Standing(NUMBERS), 0
        for _ in range(150):
            standing.add(stamp_ns, HERE, now)
            stamp_ns += round(rng.uniform(0.5, 1.5) * gap_s * NS_PER_S)
            ages_s = [0.95 * NUMBERS.spacing_s * NUMBERS.ages_grow**k for k in range(NUMBERS.views)]
            wanted, least_s = [], -np.inf
            for look in reversed(standing._looks):
                age_s = (stamp_ns - look.stamp_ns) / NS_PER_S
                if age_s >= least_s:
                    wanted.append(look)
                    least_s = min((a for a in ages_s if a > age_s), default=np.inf)
            assert standing._asked(stamp_ns, now.view.step) == wanted
        assert standing._asked(stamp_ns, 0.5 * now.view.step) == []


def test_scans_of_any_size_and_a_map_that_moved_are_asked_alike() -> None:
    fewer = seen(box(2.0, 0.0))
    fewer = replace(
        fewer,
        **{
            name: getattr(fewer, name)[:90].copy()
            for name in ("points_robot", "covariances", "weights", "tangents", "joined", "facings")
        },
    )
    scans, stamps_ns = [seen(), fewer, seen(box(1.0, 1.0))], [0, NS_PER_S // 4, NS_PER_S // 2]
    going_on = Standing(NUMBERS)
    for k, (scan, stamp_ns) in enumerate(zip(scans, stamps_ns, strict=True)):
        going_on.add(stamp_ns, HERE, scan)
        going_on.with_votes(stamp_ns + 10**7, HERE, SURE, scan)
        by = np.array([0.1 * k, 0.0, 0.0])
        going_on.moved(by)
        fresh = Standing(NUMBERS)
        fresh._looks, fresh._stamps_ns = list(going_on._looks), list(going_on._stamps_ns)
        a, b = (s.with_votes(NS_PER_S, by, SURE, scan).votes for s in (going_on, fresh))
        assert a is not None
        np.testing.assert_array_equal(a, b)
