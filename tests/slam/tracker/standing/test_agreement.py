# SPDX-License-Identifier: Apache-2.0
"""Corrections that odometry denies over seconds, though none of them alone is too large."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.frontend.odometry_prior import Prediction
from slam.tracker.standing.agreement import FEW, LEVER_M, Agreement
from slam.tracker.standing.config import StandingConfig

Array = NDArray[np.float64]
NUMBERS = StandingConfig()
SIGMA = np.array([0.003, 0.003, 0.003])  # of one step of odometry: m, m, rad
STEP_S = 0.2
KEEP = math.exp(-STEP_S / NUMBERS.window_s)
STILL = np.zeros(3)
NOTHING, A_ROOM = np.zeros(6), np.array([40.0, 0.0, 0.0, 40.0, 0.0, 200.0])  # old surface in view


def by_odometry(sigma: Array = SIGMA, increment: Array = STILL) -> Prediction:
    return Prediction(
        T_map_robot=np.zeros(3), increment=increment, covariance=np.diag(sigma**2),
        twist=np.zeros(3), elapsed=STEP_S,
    )  # fmt: skip


def fed(
    corrections: Array, old: Array = NOTHING, *, weight: float = 0.0, increment: Array = STILL
) -> Agreement:
    """After so many matches by returns of that weight, with that old surface in view, each off its
    prediction by a row."""
    agreement = Agreement(NUMBERS)
    for off in corrections:
        agreement.hold(old, STEP_S)
        agreement.take(by_odometry(increment=increment), off, weight)
    return agreement


def to_movers(agreement: Agreement) -> Array:
    """What of the corrections of the window movers may have made."""
    return agreement._by_movers


def test_chance_corrections_agree() -> None:
    rng = np.random.default_rng(5)
    ratios = [fed(rng.normal(0.0, SIGMA, (100, 3))).denied for _ in range(40)]
    assert 0.2 < np.mean(ratios) < 1.2  # with the matches' own error
    assert sum(ratio > NUMBERS.disagreed for ratio in ratios) <= 4


@pytest.mark.parametrize("old", [NOTHING, A_ROOM])
@pytest.mark.parametrize("way", [0.0, 0.1])
def test_small_corrections_to_one_side_add_up(old: Array, way: float) -> None:
    """0.6 sigma each: nothing in one scan, 2 cm in 2 s. Whatever their weight and whatever holds
    them: a board that stood for long is old surface, and moves one day.
    """
    n, weight = 200, float(old.any())
    rows = np.tile([0.6 * SIGMA[0], 0.0, 0.0], (n, 1))
    agreement = fed(rows, old, weight=weight, increment=np.array([0.0, way, 0.0]))
    S = 0.6 * SIGMA[0] * (1.0 - KEEP**n) / (1.0 - KEEP)
    V = SIGMA[0] ** 2 * (1.0 - KEEP ** (2 * n)) / (1.0 - KEEP**2)
    worn = NUMBERS.scale * way * (1.0 - KEEP**n) / (1.0 - KEEP)  # wheels
    expected = S * S / (V + NUMBERS.match_m**2 + worn**2) / 3.0
    assert agreement.denied == pytest.approx(expected, rel=1e-9)
    assert to_movers(fed(rows)) == pytest.approx([S, 0.0, 0.0], rel=1e-9)


def test_what_old_surface_shows_is_odometrys_error() -> None:
    """However large. Without old surface in view it may be movers'."""
    rows = np.tile(20.0 * SIGMA, (10, 1))
    left = to_movers(fed(rows, A_ROOM)) / to_movers(fed(rows))
    turn = LEVER_M**2
    assert left == pytest.approx([1.0 / 41.0] * 2 + [turn / (turn + 200.0)], rel=1e-9)


def test_where_all_returns_have_weight_nobody_moves() -> None:
    """A building that is seen the first time has no old surface, and no correction is a mover's."""
    rows = np.tile(20.0 * SIGMA, (10, 1))
    assert not to_movers(fed(rows, weight=1.0)).any()
    some = to_movers(fed(rows, weight=1.0 - 0.4 * FEW)) / to_movers(fed(rows))
    assert some == pytest.approx(0.4)
    assert to_movers(fed(rows, weight=1.0 - FEW)) == pytest.approx(to_movers(fed(rows)))


def test_a_corridor_holds_the_robot_across_and_not_along() -> None:
    """Its old walls show only one direction, whichever way it runs."""
    rows = np.tile([0.01, 0.0, 0.0], (10, 1))
    for angle in (0.0, 0.7, 2.0):
        c, s = math.cos(angle), math.sin(angle)
        walls = 40.0 * np.array([s * s, -s * c, 0.0, c * c, 0.0, 1.0])
        along = np.tile([0.01 * c, 0.01 * s, 0.0], (10, 1))
        across = np.tile([-0.01 * s, 0.01 * c, 0.0], (10, 1))
        whole = to_movers(fed(rows))[0]
        assert to_movers(fed(along, walls)) == pytest.approx([c * whole, s * whole, 0.0], abs=1e-12)
        held = 1.0 / 41.0 * whole
        assert to_movers(fed(across, walls)) == pytest.approx([-s * held, c * held, 0.0], abs=1e-12)


def test_surface_that_was_in_view_holds_for_half_a_second() -> None:
    """Then boards hide it, and a correction is theirs."""
    agreement = fed(np.zeros((50, 3)), A_ROOM)
    shares = []
    for _ in range(10):
        agreement.hold(NOTHING, STEP_S)
        before = KEEP * to_movers(agreement)[0]
        agreement.take(by_odometry(), np.array([0.001, 0.0, 0.0]), 0.0)
        shares.append((to_movers(agreement)[0] - before) / 0.001)
    assert shares[0] < 0.05
    assert np.all(np.diff(shares) > 0.0)
    assert shares[-1] > 0.5


def test_what_the_window_forgets_stays_in_the_map() -> None:
    """What is left behind adds up to the whole spread."""
    agreement = fed(np.tile([SIGMA[0], 0.0, 0.0], (100, 1)))
    whole, left_behind = agreement.covariance(), np.zeros((3, 3))
    for _ in range(400):
        left_behind += agreement.left_behind()
        agreement.take(by_odometry(1e-6 * SIGMA), np.zeros(3), 0.0)
    assert left_behind == pytest.approx(whole, rel=1e-6, abs=1e-15)


def test_odometry_leads_without_the_corrections_of_the_window_which_begins_anew() -> None:
    """All of them, however little old surface held: else who is taken along follows by half."""
    little, turn = np.array([2.0, 0.5, 0.0, 1.0, 0.0, 3.0]), 0.8
    rows = np.tile([0.05, -0.02, 0.01], (20, 1))
    agreement, turned = fed(rows, little), fed(rows, little)
    x, y, t = (rows[0] * (1.0 - KEEP**20) / (1.0 - KEEP)).tolist()
    assert abs(to_movers(agreement)[0]) < 0.5 * x
    assert agreement.led(np.array([1.0, 2.0, 3.1])) == pytest.approx([1.0 - x, 2.0 - y, 3.1 - t])
    assert abs(agreement.led(np.array([0.0, 0.0, -3.1]))[2]) < math.pi
    turned.turned(turn)
    c, s = math.cos(turn), math.sin(turn)
    assert turned.led(STILL) == pytest.approx([-(c * x - s * y), -(s * x + c * y), -t])
    for begin_anew in (agreement.put_back, turned.forget):
        begin_anew()
    for anew in (agreement, turned):
        assert anew.led(STILL) == pytest.approx(STILL)
        assert anew.denied == 0.0
        assert not anew.covariance().any()
        assert not anew.left_behind().any()
    held = agreement, turned  # who was set elsewhere sees other surface
    assert [one.shown(np.eye(3)).any() for one in held] == [True, False]


def test_a_match_that_is_not_believed_corrects_nothing() -> None:
    """Else the robot is put back by what it was never moved by."""
    believed = np.tile([0.01, -0.02, 0.003], (5, 1))
    agreement, taken = fed(believed), fed(np.vstack([believed, np.zeros((1, 3))]))
    agreement.take(by_odometry(), np.array([0.8, 0.5, 0.3]), 0.0)
    agreement.drop()
    pose = np.array([1.0, 2.0, 0.5])
    assert agreement.led(pose) == pytest.approx(taken.led(pose), abs=1e-12)
    assert to_movers(agreement) == pytest.approx(to_movers(taken), abs=1e-12)


def test_in_a_map_that_was_turned_the_old_surface_holds_as_before() -> None:
    """After a loop's correction: else all of the next one would be left to movers."""
    turn, rows = 0.8, np.tile([0.01, 0.0, 0.0], (10, 1))
    c, s = math.cos(turn), math.sin(turn)
    walls = np.array([40.0, 0.0, 0.0, 2.0, 3.0, 30.0])
    turned, asked = fed(rows, walls), fed(rows, walls)
    turned.turned(turn)
    asked.take(by_odometry(), np.array([0.02, 0.05, 0.0]), 0.0)
    turned.take(by_odometry(), np.array([c * 0.02 - s * 0.05, s * 0.02 + c * 0.05, 0.0]), 0.0)
    x, y, t = to_movers(asked)
    assert to_movers(turned) == pytest.approx([c * x - s * y, s * x + c * y, t])
    assert turned.denied == pytest.approx(asked.denied)


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
    assert along[1, 1] == pytest.approx(slip[1, 1] * 40.0 / (41.0))
    assert slanted @ np.array([c, s, 0.0]) == pytest.approx(np.zeros(3), abs=1e-12)
    assert (np.diag(room)[:2] / np.diag(slip)[:2] > 0.95).all()
    assert np.linalg.eigvalsh(slip - room).min() > 0.0
