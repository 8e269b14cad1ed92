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


def fed(corrections: Array, config: StandingConfig = NUMBERS) -> Agreement:
    """After so many matches, each off its prediction by a row."""
    agreement = Agreement(config)
    for off in corrections:
        prediction = Prediction(
            T_map_robot=np.zeros(3), increment=np.zeros(3), covariance=np.diag(SIGMA**2),
            twist=np.zeros(3), elapsed=STEP_S,
        )  # fmt: skip
        agreement.take(prediction, off)
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


def test_only_among_what_has_no_vote_are_the_matches_blamed() -> None:
    agreement = fed(np.tile([SIGMA[0], 0.0, 0.0], (50, 1)))
    assert agreement.dragged(1.0) == 0.0
    assert 0.3 < agreement.dragged(0.4) < 0.6
    assert fed(np.zeros((50, 3))).dragged(0.0) == 0.0
    assert fed(np.ones((50, 3)), ALL_VOTE).dragged(0.0) == 0.0


def test_the_spread_of_both_explanations_is_the_share_of_the_sum_squared() -> None:
    agreement = fed(np.tile([SIGMA[0], -SIGMA[1], 0.0], (100, 1)))
    p = agreement.dragged(0.2)
    one_frame = agreement.covariance(p)
    window = agreement._windows[agreement._worst]
    whole = one_frame * window / STEP_S
    assert whole[0, 0] + whole[1, 1] == pytest.approx(agreement.off_m(p) ** 2, rel=1e-9)
    assert whole[0, 1] == pytest.approx(-whole[0, 0], rel=1e-9)
    assert np.linalg.eigvalsh(one_frame).min() > -1e-15


def test_a_robot_that_was_set_elsewhere_starts_anew() -> None:
    agreement = fed(np.tile([0.05, 0.0, 0.0], (20, 1)))
    assert agreement.ratio > 10.0
    agreement.forget()
    assert agreement.ratio == 0.0
    assert agreement.off_m(1.0) == 0.0
