# SPDX-License-Identifier: Apache-2.0
"""Corrections that odometry denies over seconds, though none of them alone is too large."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.frontend.odometry_prior import Prediction
from slam.tracker.standing.agreement import Agreement, Pull
from slam.tracker.standing.config import ALL_VOTE, StandingConfig

Array = NDArray[np.float64]
NUMBERS = StandingConfig()
SIGMA = np.array([0.003, 0.003, 0.003])  # of one step of odometry: m, m, rad
STEP_S = 0.2
PULL = Pull()
NOTHING, A_ROOM = np.zeros(6), np.array([40.0, 0.0, 0.0, 40.0, 0.0, 200.0])  # old surface in view


def by_odometry(sigma: Array = SIGMA) -> Prediction:
    return Prediction(
        T_map_robot=np.zeros(3), increment=np.zeros(3), covariance=np.diag(sigma**2),
        twist=np.zeros(3), elapsed=STEP_S,
    )  # fmt: skip


def fed(
    corrections: Array, old: Array = NOTHING, *, vote: float = 0.0, config: StandingConfig = NUMBERS
) -> Agreement:
    """After so many matches by returns of that vote, with that old surface in view, each off its
    prediction by a row."""
    agreement = Agreement(config)
    for off in corrections:
        agreement.hold(old, STEP_S)
        agreement.take(by_odometry(), off, vote)
    return agreement


def test_chance_corrections_agree() -> None:
    rng = np.random.default_rng(5)
    ratios = [fed(rng.normal(0.0, SIGMA, (100, 3))).ratio for _ in range(40)]
    assert 0.2 < np.mean(ratios) < 1.2  # with the matches' own error
    assert max(ratios) < 6.0


def test_small_corrections_to_one_side_add_up() -> None:
    """0.6 sigma each: nothing in one scan, 2 cm in 2 s."""
    n, keep = 200, math.exp(-STEP_S / NUMBERS.window_s)
    agreement = fed(np.tile([0.6 * SIGMA[0], 0.0, 0.0], (n, 1)))
    S = 0.6 * SIGMA[0] * (1.0 - keep**n) / (1.0 - keep)
    V = SIGMA[0] ** 2 * (1.0 - keep ** (2 * n)) / (1.0 - keep**2)
    assert agreement.ratio == pytest.approx(S * S / (V + NUMBERS.match_m**2) / 3.0, rel=1e-9)
    assert agreement.by_movers == pytest.approx([S, 0.0, 0.0], rel=1e-9)


def test_odometry_denies_corrections_that_old_surface_held_too() -> None:
    """A board that stood for long is old surface, and moves one day: the map is asked."""
    rows, n = np.tile([4.0 * SIGMA[0], 0.0, 0.0], (10, 1)), 10
    held, keep = fed(rows, A_ROOM, vote=1.0), math.exp(-STEP_S / NUMBERS.window_s)
    F = 4.0 * SIGMA[0] * (1.0 - keep**n) / (1.0 - keep)
    V = SIGMA[0] ** 2 * (1.0 - keep ** (2 * n)) / (1.0 - keep**2)
    assert held.denied == pytest.approx(F * F / (V + NUMBERS.match_m**2) / 3.0, rel=1e-9)
    assert held.suspected
    assert held.dragged() < 0.02  # but nobody is in view who moves
    rng = np.random.default_rng(5)
    usual = [fed(rng.normal(0.0, SIGMA, (100, 3)), A_ROOM).suspected for _ in range(40)]
    assert sum(usual) <= 4
    assert not fed(rows, A_ROOM, vote=1.0, config=ALL_VOTE).suspected
    seldom = replace(by_odometry(), elapsed=1.01 * NUMBERS.window_s)
    held.take(seldom, 40.0 * SIGMA, 1.0)
    assert held.denied > NUMBERS.disagreed
    assert not held.suspected  # one correction is no sum


def test_what_old_surface_shows_is_odometrys_error() -> None:
    """However large: a slip in a known room is no sign of movers. Without one it is."""
    rows = np.tile(20.0 * SIGMA, (10, 1))
    assert fed(rows, A_ROOM).ratio < NUMBERS.disagreed < 100.0 < fed(rows).ratio
    left = fed(rows, A_ROOM).by_movers / fed(rows).by_movers
    turn = PULL.holds * PULL.lever_m**2
    expected = [PULL.holds / (PULL.holds + 40.0)] * 2 + [turn / (turn + 200.0)]
    assert left == pytest.approx(expected, rel=1e-9)


def test_where_all_returns_have_weight_nobody_moves() -> None:
    """A building that is seen the first time has no old surface, and no correction is a mover's."""
    rows = np.tile(20.0 * SIGMA, (10, 1))
    assert not fed(rows, vote=1.0).by_movers.any()
    some = fed(rows, vote=1.0 - 0.4 * PULL.few).by_movers / fed(rows).by_movers
    assert some == pytest.approx(0.4)
    assert fed(rows, vote=1.0 - PULL.few).by_movers == pytest.approx(fed(rows).by_movers)


def test_a_corridor_holds_the_robot_across_and_not_along() -> None:
    """Its old walls show only one direction, whichever way it runs."""
    rows = np.tile([0.01, 0.0, 0.0], (10, 1))
    for angle in (0.0, 0.7, 2.0):
        c, s = math.cos(angle), math.sin(angle)
        walls = 40.0 * np.array([s * s, -s * c, 0.0, c * c, 0.0, 1.0])
        along = np.tile([0.01 * c, 0.01 * s, 0.0], (10, 1))
        across = np.tile([-0.01 * s, 0.01 * c, 0.0], (10, 1))
        whole = fed(rows).by_movers[0]
        assert fed(along, walls).by_movers == pytest.approx([c * whole, s * whole, 0.0], abs=1e-12)
        held = PULL.holds / (PULL.holds + 40.0) * whole
        assert fed(across, walls).by_movers == pytest.approx([-s * held, c * held, 0.0], abs=1e-12)


def test_surface_that_was_in_view_holds_for_half_a_second() -> None:
    """Then boards hide it, and a correction is theirs."""
    agreement = fed(np.zeros((50, 3)), A_ROOM)
    shares = []
    for _ in range(10):
        agreement.hold(NOTHING, STEP_S)
        before = agreement.by_movers[0] * math.exp(-STEP_S / NUMBERS.window_s)
        agreement.take(by_odometry(), np.array([0.001, 0.0, 0.0]), 0.0)
        shares.append((agreement.by_movers[0] - before) / 0.001)
    assert shares[0] < 0.05
    assert np.all(np.diff(shares) > 0.0)
    assert shares[-1] > 0.5


def test_while_the_pose_is_in_doubt_the_map_holds_no_position_but_a_heading() -> None:
    agreement = fed(np.zeros((20, 3)), A_ROOM)
    agreement.take(by_odometry(), np.array([0.02, -0.01, 0.03]), 0.0, in_doubt=True)
    x, y, turn = agreement.by_movers
    assert (x, y) == pytest.approx((0.02, -0.01))
    assert turn < 0.01 * 0.03


def test_half_of_the_matches_are_blamed_at_the_ratio_that_says_nothing() -> None:
    agreement = fed(np.zeros((1, 3)))
    agreement.ratio = NUMBERS.disagreed
    assert agreement.dragged() == pytest.approx(0.5)
    # each unit of the ratio is a likelihood of exp(3 / 2), for three numbers
    agreement.ratio = NUMBERS.disagreed + 1.0
    p = agreement.dragged()
    assert p / (1.0 - p) == pytest.approx(math.exp(1.5))
    assert fed(np.zeros((50, 3))).dragged() < 0.02
    off = fed(np.ones((50, 3)), config=ALL_VOTE)
    assert off.dragged() == 0.0
    assert not off.covariance().any()


def test_the_spread_is_the_sum_squared() -> None:
    agreement = fed(np.tile([SIGMA[0], -SIGMA[1], 0.0], (100, 1)))
    S = agreement.by_movers
    assert agreement.covariance() == pytest.approx(np.outer(S, S), rel=1e-9)
    assert S[1] == pytest.approx(-S[0])


def test_what_the_window_forgets_stays_in_the_map() -> None:
    """What is left behind adds up to the whole spread."""
    agreement = fed(np.tile([SIGMA[0], 0.0, 0.0], (100, 1)))
    whole, left_behind = agreement.covariance(), np.zeros((3, 3))
    for _ in range(400):
        left_behind += agreement.left_behind()
        agreement.take(by_odometry(1e-6 * SIGMA), np.zeros(3), 0.0)
    assert left_behind == pytest.approx(whole, rel=1e-6, abs=1e-15)


def test_a_pose_that_was_put_back_may_have_been_right() -> None:
    """Off by the whole sum with the rest of the probability, said once; the sums begin anew."""
    agreement = fed(np.tile([SIGMA[0], 0.0, 0.0], (50, 1)))
    p, spread = agreement.dragged(), agreement.covariance()
    pose = agreement.undragged(np.zeros(3), agreement.dragged())
    assert pose[0] ** 2 == pytest.approx(spread[0, 0])
    assert agreement.left_behind() == pytest.approx(p * (1.0 - p) * spread)
    assert not agreement.left_behind().any()
    assert agreement.ratio == 0.0


def test_a_pose_is_put_back_to_where_odometry_leads_however_little_old_surface_held() -> None:
    """Else a robot that a board takes along is put back by half of each correction, and follows."""
    little, turn = np.array([2.0, 0.5, 0.0, 1.0, 0.0, 3.0]), 0.8
    rows, keep = np.tile([0.05, -0.02, 0.01], (20, 1)), math.exp(-STEP_S / NUMBERS.window_s)
    agreement, turned = fed(rows, little), fed(rows, little)
    whole = rows[0] * (1.0 - keep**20) / (1.0 - keep)
    assert abs(agreement.by_movers[0]) < 0.5 * whole[0]
    pose = np.array([1.0, 2.0, 0.5])
    assert agreement.undragged(pose, 0.7) == pytest.approx(pose - whole, rel=1e-9)
    assert agreement.undragged(pose, 0.7) == pytest.approx(pose)  # all is taken back once
    turned.turned(turn)
    c, s = math.cos(turn), math.sin(turn)
    x, y, t = whole.tolist()
    expected = [-(c * x - s * y), -(s * x + c * y), -t]
    assert turned.undragged(np.zeros(3), 0.7) == pytest.approx(expected)


def test_a_robot_that_was_set_elsewhere_starts_anew() -> None:
    agreement = fed(np.tile([0.05, 0.0, 0.0], (20, 1)))
    assert agreement.ratio > 10.0
    agreement.forget()
    assert agreement.ratio == 0.0
    assert not agreement.covariance().any()


def test_in_a_map_that_was_turned_the_old_surface_holds_as_before() -> None:
    """After a loop's correction: else all of the next one would be left to movers."""
    turn, rows = 0.8, np.tile([0.01, 0.0, 0.0], (10, 1))
    c, s = math.cos(turn), math.sin(turn)
    walls = np.array([40.0, 0.0, 0.0, 2.0, 3.0, 30.0])
    turned, asked = fed(rows, walls), fed(rows, walls)
    turned.turned(turn)
    asked.take(by_odometry(), np.array([0.02, 0.05, 0.0]), 0.0)
    turned.take(by_odometry(), np.array([c * 0.02 - s * 0.05, s * 0.02 + c * 0.05, 0.0]), 0.0)
    x, y, t = asked.by_movers
    assert turned.by_movers == pytest.approx([c * x - s * y, s * x + c * y, t])
    assert turned.ratio == pytest.approx(asked.ratio)


def test_old_surface_shows_an_error_across_it_and_none_along() -> None:
    """A slip along a bare corridor does not show: its best place for a scan is any."""
    slip = np.diag([0.25**2, 0.25**2, 0.2**2])
    c, s = math.cos(0.7), math.sin(0.7)
    corridor = np.array([0.0, 0.0, 0.0, 40.0, 0.0, 200.0])
    turned = np.array([40.0 * s * s, -40.0 * s * c, 0.0, 40.0 * c * c, 0.0, 200.0])
    nothing, along, slanted, room = (
        fed(np.zeros((20, 3)), old).shown(slip) for old in (NOTHING, corridor, turned, A_ROOM)
    )
    assert nothing == pytest.approx(np.zeros((3, 3)), abs=1e-12)
    assert along[0] == pytest.approx(np.zeros(3), abs=1e-12)
    assert along[1, 1] == pytest.approx(slip[1, 1] * 40.0 / (40.0 + PULL.holds))
    assert slanted @ np.array([c, s, 0.0]) == pytest.approx(np.zeros(3), abs=1e-12)
    assert (np.diag(room)[:2] / np.diag(slip)[:2] > 0.95).all()
    assert np.linalg.eigvalsh(slip - room).min() > 0.0
