# SPDX-License-Identifier: Apache-2.0
"""Which returns have weight: what stands, what was never seen, and what is too thin."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.frames import NS_PER_S, Scan
from slam.frontend.observations import Observations, from_scan
from slam.shunting.slam import ShuntingConfig
from slam.tracker.matching.matcher import Matcher, seen_by
from slam.tracker.standing.config import FULL_WEIGHT, StandingConfig
from slam.tracker.standing.recent import Standing
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


def weights(
    before: Observations, now: Observations, age_s: float, *, prior: Array = SURE
) -> tuple[Array, Array]:
    """Of what is nearer than the walls, and of the walls, ``age_s`` after the only earlier scan."""
    standing = Standing(NUMBERS)
    standing.add(0, HERE, before)
    found = seen_by(standing.weighted(round(age_s * NS_PER_S), HERE, prior, now)).weights
    x, y = now.points_robot.T
    inside = (np.abs(x - 1.0) < 3.8) & (np.abs(y) < 2.8)
    return found[inside], found[~inside]


def test_who_came_to_where_it_was_empty_has_no_vote_and_the_walls_have_theirs() -> None:
    came, walls = weights(seen(), seen(box(2.0, 0.0)), 0.2)
    assert len(came) > 20
    assert came.max() < 0.01
    assert walls.min() == 1.0


@pytest.mark.parametrize("age_s", [0.5, 2.0, 5.0, 9.0])
def test_the_vote_grows_with_the_time_that_it_may_have_stood(age_s: float) -> None:
    came, _ = weights(seen(), seen(box(2.0, 0.0)), age_s)
    square = (age_s / NUMBERS.settled_s) ** 2
    assert came == pytest.approx(square / (1.0 + square), rel=1e-3)


def test_what_stands_as_before_votes_and_so_does_a_wall_that_was_hidden() -> None:
    stands, walls = weights(seen(box(2.0, 0.0)), seen(box(2.0, 0.0)), 0.2)
    assert stands.min() == 1.0
    assert walls.min() == 1.0
    _, revealed = weights(seen(box(2.0, 0.0)), seen(), 0.2)
    assert revealed.min() == 1.0


def test_who_walks_away_into_its_own_shadow_is_told_by_the_place_that_it_left() -> None:
    away, walls = weights(seen(box(2.0, 0.0)), seen(box(2.2, 0.0)), 0.2)
    assert away.max() < 0.01
    assert walls.min() == 1.0


def test_a_thing_too_thin_to_be_hit_by_every_scan_keeps_its_vote() -> None:
    came, _ = weights(seen(), seen(box(2.0, 0.0, half=0.02)), 0.2)
    assert len(came) > 0
    assert came.min() == 1.0


def test_where_the_prediction_is_vague_nobody_loses_the_vote() -> None:
    vague = np.diag([0.3**2, 0.3**2, 0.1**2])
    came, _ = weights(seen(), seen(box(2.0, 0.0)), 0.2, prior=vague)
    assert came.min() > 0.9


def test_what_no_scan_had_in_view_is_told_apart() -> None:
    """Where the robot has turned to, and what a box hid: no scan can have seen what is there."""
    standing, now = Standing(NUMBERS), seen()
    standing.add(0, HERE, now)
    again = standing.weighted(NS_PER_S // 5, HERE, SURE, now)
    turned = standing.weighted(NS_PER_S // 5, np.array([0.0, 0.0, 0.5 * np.pi]), SURE, now)
    hidden = Standing(NUMBERS)
    hidden.add(0, HERE, seen(box(1.0, 0.0)))
    behind = hidden.weighted(NS_PER_S // 5, HERE, SURE, now)
    assert again.in_view > 0.98
    assert turned.in_view < 0.5
    assert 0.6 < behind.in_view < 0.95
    assert Standing(NUMBERS).weighted(0, HERE, SURE, now).in_view == 1.0


def test_all_vote_without_earlier_scans_and_when_it_is_off() -> None:
    now = seen(box(2.0, 0.0))
    assert seen_by(Standing(NUMBERS).weighted(0, HERE, SURE, now)).weights.min() == 1.0
    off = Standing(FULL_WEIGHT)
    off.add(0, HERE, seen())
    assert seen_by(off.weighted(NS_PER_S // 5, HERE, SURE, now)).weights.min() == 1.0


def test_without_a_vote_what_is_young_says_nothing_and_is_not_missed() -> None:
    config = ShuntingConfig(cell_m=0.05, trace_s=0.0)  # the map is all young
    network, scan = room(), seen()
    network.cells.y[:] = 0.0
    matcher = Matcher(config)
    nobody = _weighing(scan, np.zeros(len(scan.points_robot)))
    match = matcher.climb(network, nobody, HERE, HERE, np.eye(3))
    assert match.information.any() == False  # noqa: E712 (numpy)
    assert match.overlapped == 0.0
    assert np.array_equal(match.T_map_robot, HERE)


def _weighing(scan: Observations, given: Array) -> Observations:
    return replace(scan, weights=given)
