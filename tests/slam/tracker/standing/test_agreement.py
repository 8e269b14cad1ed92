# SPDX-License-Identifier: Apache-2.0
"""Corrections that odometry denies over seconds, though none of them alone is too large."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.frontend.odometry_prior import Prediction
from slam.tracker.standing.agreement import Agreement
from slam.tracker.standing.config import ALL_VOTE, StandingConfig

Array = NDArray[np.float64]
NUMBERS = StandingConfig()
SIGMA = np.array([0.003, 0.003, 0.003])  # of one step of odometry: m, m, rad
STEP_S = 0.2


def fed(corrections: Array, config: StandingConfig = NUMBERS, vote: float = 0.0) -> Agreement:
    """After so many matches by returns of that vote, each off its prediction by a row."""
    agreement = Agreement(config)
    for off in corrections:
        prediction = Prediction(
            T_map_robot=np.zeros(3), increment=np.zeros(3), covariance=np.diag(SIGMA**2),
            twist=np.zeros(3), elapsed=STEP_S,
        )  # fmt: skip
        agreement.take(prediction, off, vote)
    return agreement


def test_chance_corrections_agree() -> None:
    rng = np.random.default_rng(5)
    ratios = [fed(rng.normal(0.0, SIGMA, (100, 3))).ratio for _ in range(40)]
    assert 0.2 < np.mean(ratios) < 1.5  # the larger of two windows, with the matches' own error
    assert max(ratios) < 6.0


def test_small_corrections_to_one_side_add_up() -> None:
    """Half a sigma each: nothing in one scan, 2 cm in 2 s."""
    n = 200
    agreement = fed(np.tile([0.5 * SIGMA[0], 0.0, 0.0], (n, 1)))
    expected = []
    for window in (NUMBERS.window_s, NUMBERS.long_window_s):
        keep = math.exp(-STEP_S / window)
        S = 0.5 * SIGMA[0] * (1.0 - keep**n) / (1.0 - keep)
        V = SIGMA[0] ** 2 * (1.0 - keep ** (2 * n)) / (1.0 - keep**2)
        expected.append(S * S / (V + NUMBERS.match_m**2) / 3.0)
    assert agreement.ratio == pytest.approx(max(expected), rel=1e-9)
    assert agreement.ratio > 4.0


def test_a_rare_large_correction_among_returns_of_weight_is_odometrys_own() -> None:
    """Heavy tails: one or some of 30 sigma, to either side; 1/3 of as many as a window holds."""
    rows = np.zeros((20, 3))
    rows[-1] = 30.0 * SIGMA
    assert fed(rows, vote=1.0).ratio < 1.0 / 3.0
    assert fed(rows, vote=0.0).ratio > 100.0
    rng = np.random.default_rng(5)
    heavy = [rng.standard_t(1.5, (100, 3)) * SIGMA for _ in range(40)]
    usual = [fed(one, vote=1.0).ratio for one in heavy]
    assert np.mean([fed(one).ratio for one in heavy]) > NUMBERS.disagreed
    assert max(usual) < NUMBERS.disagreed


def test_while_wheels_slip_corrections_are_no_sign_of_movers() -> None:
    agreement, pull = Agreement(NUMBERS), np.tile([20.0 * SIGMA[0], 0.0, 0.0], (10, 1))
    for off in pull:
        prediction = Prediction(
            T_map_robot=np.zeros(3), increment=np.zeros(3), covariance=np.diag(SIGMA**2),
            twist=np.zeros(3), elapsed=STEP_S, slips=True,
        )  # fmt: skip
        agreement.take(prediction, off, 0.0)
    assert agreement.ratio == 0.0
    assert fed(pull).ratio > NUMBERS.disagreed


def test_a_steady_drift_disagrees_also_among_returns_of_weight() -> None:
    assert fed(np.tile([0.5 * SIGMA[0], 0.0, 0.0], (200, 1)), vote=0.9).ratio > NUMBERS.disagreed


def test_only_among_what_has_no_vote_are_the_matches_blamed() -> None:
    agreement = fed(np.tile([SIGMA[0], 0.0, 0.0], (50, 1)))
    assert agreement.dragged(1.0) == 0.0
    assert agreement.dragged(0.4) == pytest.approx(0.6, abs=0.01)
    assert fed(np.zeros((50, 3))).dragged(0.0) < 0.02
    assert fed(np.ones((50, 3)), ALL_VOTE).dragged(0.0) == 0.0


def test_the_probability_is_half_of_what_has_no_vote_at_the_ratio_that_says_nothing() -> None:
    agreement = fed(np.zeros((1, 3)))
    agreement.ratio = NUMBERS.disagreed
    assert agreement.dragged(0.3) == pytest.approx(0.35)
    # each unit of the ratio is a likelihood of exp(3 / 2), for three numbers
    agreement.ratio = NUMBERS.disagreed + 1.0
    p = agreement.dragged(0.0)
    assert p / (1.0 - p) == pytest.approx(math.exp(1.5))
    agreement.ratio = 1e9
    assert agreement.dragged(0.3) == pytest.approx(0.7)


def test_the_spread_of_both_explanations_is_the_share_of_the_sum_squared() -> None:
    agreement = fed(np.tile([SIGMA[0], -SIGMA[1], 0.0], (100, 1)))
    p = agreement.dragged(0.2)
    spread = agreement.covariance(p)
    assert spread == pytest.approx(
        p * np.outer(agreement._sums[0], agreement._sums[0]), rel=1e-9
    ) or (spread == pytest.approx(p * np.outer(agreement._sums[1], agreement._sums[1]), rel=1e-9))
    assert spread[0, 1] == pytest.approx(-spread[0, 0], rel=1e-9)
    assert np.linalg.eigvalsh(spread).min() > -1e-15


def test_what_the_window_forgets_stays_in_the_map() -> None:
    """With the same probability all along, what is left behind adds up to the whole spread."""
    agreement = fed(np.tile([SIGMA[0], 0.0, 0.0], (100, 1)))
    whole, left_behind = agreement.covariance(0.5), np.zeros((3, 3))
    for _ in range(400):
        left_behind += agreement.left_behind(0.5)
        prediction = Prediction(
            T_map_robot=np.zeros(3), increment=np.zeros(3), covariance=np.diag(1e-12 * SIGMA**2),
            twist=np.zeros(3), elapsed=STEP_S,
        )  # fmt: skip
        worst = agreement._worst
        agreement.take(prediction, np.zeros(3), 0.0)
        agreement._worst = worst
    assert left_behind == pytest.approx(whole, rel=1e-6, abs=1e-15)


def test_a_pose_that_was_put_back_may_have_been_right() -> None:
    """Off by the whole sum with the rest of the probability, said once; the sums begin anew."""
    agreement = fed(np.tile([SIGMA[0], 0.0, 0.0], (50, 1)))
    p, spread = agreement.dragged(0.4), agreement.covariance(1.0)
    pose = agreement.undragged(np.zeros(3), 0.4)
    assert pose[0] ** 2 == pytest.approx(spread[0, 0])
    assert agreement.left_behind(0.0) == pytest.approx(p * (1.0 - p) * spread)
    assert not agreement.left_behind(0.0).any()
    assert agreement.ratio == 0.0


def test_a_robot_that_was_set_elsewhere_starts_anew() -> None:
    agreement = fed(np.tile([0.05, 0.0, 0.0], (20, 1)))
    assert agreement.ratio > 10.0
    agreement.forget()
    assert agreement.ratio == 0.0
    assert not agreement.covariance(1.0).any()
