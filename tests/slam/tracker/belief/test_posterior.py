# SPDX-License-Identifier: Apache-2.0
"""The equations of the belief: what evidence weighs, what priors cost, and that it adds up."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from slam import se2
from slam.frontend.odometry_prior import Prediction
from slam.tracker.belief.config import BeliefConfig
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.posterior import (
    LEAST_M,
    LEAST_S,
    MOST_NATS,
    S_PER_H,
    Odds,
    probabilities,
    sum_of,
)
from slam.tracker.cells import Look

Array = NDArray[np.float64]
CONFIG = BeliefConfig()
ODDS = Odds(CONFIG, carried_per_h=1.0)
NEVER = replace(CONFIG, slips_per_m=1e-300)  # a slip costs more than any innovation here


def seen(known_m: float, through_m: float = 0.0) -> Evidence:
    evidence = Evidence()
    evidence.known_m, evidence.through_m = known_m, through_m
    return evidence


def nats(known_m: float, through_m: float = 0.0, odds: Odds = ODDS) -> float:
    return odds.evidence(seen(known_m, through_m))


def predicted(prior: Array, way_m: float = 0.0) -> Prediction:
    return Prediction(
        T_map_robot=np.array([1.0, -2.0, 3.1]), increment=np.array([way_m, 0.0, 0.0]),
        covariance=prior, twist=np.zeros(3), elapsed=0.2,
    )  # fmt: skip


def test_nothing_seen_says_nothing() -> None:
    assert nats(0.0) == 0.0
    assert ODDS.denied(0.0) == 0.0


@pytest.mark.parametrize("through_m", [0.0, 2.0])
def test_what_is_confirmed_counts_ever_less_and_then_alike(through_m: float) -> None:
    """Concave up to ``linear_m``, a straight line beyond, and no corner between."""
    linear, step = CONFIG.linear_m, CONFIG.linear_m / 20.0
    gains = np.diff([nats(step * k, through_m) for k in range(61)])
    assert (gains > 0.0).all()
    assert (np.diff(gains[:20]) < 0.0).all()
    np.testing.assert_allclose(gains[20:], gains[20], rtol=1e-9)
    tiny = 1e-5 * linear
    before, after = (nats(linear + d, through_m) - nats(linear + d - tiny, through_m)
                     for d in (0.0, tiny))  # fmt: skip
    assert after == pytest.approx(before, rel=1e-3)


def test_what_is_seen_through_costs_ever_less() -> None:
    prices = np.array([ODDS.denied(0.1 * k) for k in range(1000)])
    assert (np.diff(prices) > 0.0).all()
    assert (np.diff(prices, 2) < 0.0).all()
    assert ODDS.denied(4.0) == pytest.approx(2.0 * CONFIG.through)
    assert ODDS.denied(400.0) == pytest.approx(20.0 * CONFIG.through)


@pytest.mark.parametrize("numbers", [{}, {"through": 1e-3}, {"outdated": 500.0}])
def test_in_a_room_that_has_changed_the_first_metres_are_paid(numbers: dict[str, float]) -> None:
    belief = replace(CONFIG, **numbers)
    now, then = Odds(belief, 1.0), Odds(belief, 1.0, changed=True)
    paid_m = (belief.outdated / belief.through) ** 2
    assert then.denied(0.0) == 0.0
    for through_m in (0.1, 1.0, 10.0):
        told = now.denied(paid_m + through_m) - belief.outdated
        assert then.denied(through_m) == pytest.approx(told, abs=1e-6)
        assert then.denied(through_m) < now.denied(through_m)


def test_a_scan_and_many_weigh_by_the_same_law() -> None:
    look = Look(confirmed=9.0, contradicted=3.0, visited=40, known=1.7, through=0.4)
    assert ODDS.evidence(look) == nats(1.7, 0.4)


def test_a_break_costs_nothing_where_scans_go_on_and_never_more_than_all() -> None:
    shares = np.linspace(0.0, 1.5, 151)
    prices = np.array([ODDS.broken(float(share)) for share in shares])
    assert (np.diff(prices) <= 0.0).all()
    assert prices[0] == ODDS.broken(CONFIG.breaks) == CONFIG.broken
    assert ODDS.broken(CONFIG.goes_on) == prices[-1] == 0.0
    half = 0.5 * (CONFIG.breaks + CONFIG.goes_on)
    assert ODDS.broken(half) == pytest.approx(0.5 * CONFIG.broken)
    assert ODDS.broken(1.0, 0.5 * CONFIG.vanished) == pytest.approx(0.5 * CONFIG.broken)
    assert ODDS.broken(half, CONFIG.vanished) == ODDS.broken(0.0, 1.0) == CONFIG.broken
    step = Odds(replace(CONFIG, goes_on=CONFIG.breaks), 1.0)  # no division by nothing
    assert step.broken(CONFIG.breaks + 0.01) == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_a_correction_costs_its_innovation(seed: int) -> None:
    """Half the squared Mahalanobis distance, headings wrapped, the prior with its correlations and
    with what movers pull.
    """
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 0.05, (3, 3))
    prior = root @ root.T + 1e-4 * np.eye(3)
    by = np.linalg.cholesky(prior) @ rng.normal(0.0, 1.0, 3)
    prediction = predicted(prior, way_m=0.3)
    match = prediction.T_map_robot + by
    match[2] = se2.wrap(float(match[2]))  # 3.1 rad and a little more: past the turn
    pulled = np.diag([CONFIG.pulled_m**2, CONFIG.pulled_m**2, CONFIG.pulled_rad**2])
    expected = 0.5 * by @ np.linalg.solve(prior + pulled, by)
    assert Odds(NEVER, 1.0).corrected(prediction, match) == pytest.approx(expected, rel=1e-6)
    held = ODDS.corrected(prediction, match)
    assert held <= expected * (1.0 + 1e-9)


def test_a_correction_costs_no_more_than_the_slip_that_explains_it() -> None:
    prediction = predicted(np.diag([1e-6, 1e-6, 1e-6]), way_m=0.3)
    for off in (np.array([0.9, -1.2, 0.1]), np.array([0.0, 0.0, -0.9])):
        slip = -ODDS.slipped(0.3, math.hypot(off[0], off[1]), float(off[2]))
        assert ODDS.corrected(prediction, prediction.T_map_robot + off) == pytest.approx(slip)


def test_the_prior_of_a_slip_is_a_rate_a_metre_times_a_gaussian() -> None:
    here = ODDS.slipped(2.0, 0.0, 0.0)
    assert here == pytest.approx(math.log(2.0 * CONFIG.slips_per_m))
    for m, rad in ((0.1, 0.0), (0.4, -0.3), (0.0, 0.7)):
        squares = (m / CONFIG.slip_m) ** 2 + (rad / CONFIG.slip_rad) ** 2
        assert ODDS.slipped(2.0, m, rad) - here == pytest.approx(-0.5 * squares)
        assert ODDS.slipped(2.0, m, -rad) == ODDS.slipped(2.0, m, rad)
    assert ODDS.slipped(4.0, 0.1, 0.1) - ODDS.slipped(2.0, 0.1, 0.1) == pytest.approx(math.log(2.0))
    assert ODDS.slipped(0.0, 0.1, 0.0) == ODDS.slipped(LEAST_M, 0.1, 0.0)  # who stands is pushed


@pytest.mark.parametrize("seed", range(5))
def test_the_prior_of_a_drift_is_its_gaussian_and_what_the_best_of_many_places_costs(
    seed: int,
) -> None:
    """As likely, at its middle, as a place that is found has a share in what odometry allows."""
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 0.4, (3, 3))
    drift, found = root @ root.T + 1e-4 * np.eye(3), np.diag([0.01, 0.01, 7e-4])
    off = rng.normal(0.0, 0.4, 3)
    shares = np.linalg.det(found) / np.linalg.det(drift + found)
    expected = -0.5 * off @ np.linalg.solve(drift, off) + 0.5 * math.log(shares)
    assert Odds.drifted(off, drift, found) == pytest.approx(expected)


def test_the_prior_of_being_carried_is_a_rate_an_hour() -> None:
    assert math.exp(Odds(CONFIG, 3.0).carried(0.2)) == pytest.approx(3.0 * 0.2 / S_PER_H)
    assert Odds(CONFIG, 3.0).carried(0.0) == Odds(CONFIG, 3.0).carried(LEAST_S)


def test_nobody_carries_a_robot_of_rate_0() -> None:
    never = Odds(CONFIG, 0.0)
    assert not never.asked
    assert never.carried(1e6) == -MOST_NATS
    here = never.evidence(seen(0.0, 100.0)) - CONFIG.broken
    assert probabilities([here, never.carried(60.0)])[1] < 1e-100


@pytest.mark.parametrize(
    "weights",
    [[0.0], [0.0, 0.0, 0.0], [1e5, 0.0, -1e5], [-1e5, -1e5 - 1.0], [5e4, 5e4 + 3.0, -MOST_NATS]],
)
def test_probabilities_sum_to_one_however_far_apart_the_weights(weights: list[float]) -> None:
    found = probabilities(weights)
    assert sum(found) == pytest.approx(1.0)
    assert all(0.0 <= p <= 1.0 for p in found)
    assert np.argmax(found) == np.argmax(weights)
    shifted = probabilities([w + 123.0 for w in weights])
    np.testing.assert_allclose(shifted, found, rtol=1e-9, atol=1e-300)


def test_probabilities_are_those_of_the_weights() -> None:
    weights = [0.3, -2.0, 1.1, -0.4]
    expected = np.exp(weights) / np.exp(weights).sum()
    np.testing.assert_allclose(probabilities(weights), expected, rtol=1e-12)
    assert sum_of(weights) == pytest.approx(float(np.log(np.exp(weights).sum())))
