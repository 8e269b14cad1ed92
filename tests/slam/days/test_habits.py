# SPDX-License-Identifier: Apache-2.0
"""Habits of places: their mathematics by hand, and what they promise."""

import math

import numpy as np
import pytest
import scipy.linalg
from scipy import integrate

from slam.days.habits import HOUR_S, TEMPOS, Habits, log_score, near_hours, relaxed
from slam.days.history import DAY_S
from slam.errors import InvalidValueError


def test_a_chain_of_two_states_relaxes_as_its_matrix_exponential():
    emerges, goes, t = 0.3 / HOUR_S, 0.1 / HOUR_S, 2.5 * HOUR_S
    rates = np.array([[-emerges, emerges], [goes, -goes]])
    moves = scipy.linalg.expm(rates * t)
    usual = np.full(1, emerges / (emerges + goes))
    for state in (0, 1):
        told = relaxed(usual, usual, np.full(1, float(state)), emerges + goes, np.full(1, t))
        assert told[0] == pytest.approx(moves[state, 1], abs=1e-12)


def test_a_chain_whose_rates_follow_the_hour_relaxes_to_its_cycle():
    """The usual share is that of the settled cycle, not of the rates at the moment."""
    rate = 1.0 / (5.0 * HOUR_S)

    def wanted(t):
        return 0.5 + 0.4 * math.sin(math.tau * t / DAY_S)

    def run(start, t0, t1):
        solved = integrate.solve_ivp(
            lambda t, p: rate * (wanted(t) - p), (t0, t1), [start], rtol=1e-9, atol=1e-12
        )
        return float(solved.y[0, -1])

    settled_then = run(0.5, -20.0 * DAY_S, 9.0 * HOUR_S)
    settled_now = run(0.5, -20.0 * DAY_S, 2.0 * HOUR_S)
    told = relaxed(
        np.array([settled_then]), np.array([settled_now]), np.array([1.0]), rate, 7.0 * HOUR_S
    )
    assert told[0] == pytest.approx(run(1.0, 2.0 * HOUR_S, 9.0 * HOUR_S), abs=1e-5)


def test_hours_go_round_the_clock():
    np.testing.assert_allclose(
        near_hours(np.array([23.0, 0.0, 1.0, 12.0]), 0.0, 3.0), [2 / 3, 1.0, 2 / 3, 0.0]
    )


def test_habits_learn_the_hour_of_a_door_and_the_patience_of_a_thing():
    """Place 0 is open by day only; place 1 came after five days and stays; place 2 is a wall."""
    habits = Habits(3)
    for day in range(10):
        for hour in (1.0, 9.0, 12.0, 15.0, 19.0):
            open_ = float(8.0 <= hour <= 16.0)
            habits.see(day * DAY_S + hour * HOUR_S, np.array([open_, float(day >= 5), 1.0]))
    for hour, low, high in ((9.0, 0.75, 1.0), (1.0, 0.0, 0.25)):
        door, thing, wall = habits.probability(11.0 * DAY_S + hour * HOUR_S)
        assert low <= door <= high
        assert thing > 0.75
        assert wall > 0.9
    assert habits.stays_s()[2] > habits.stays_s()[0]
    np.testing.assert_allclose(habits.weights().sum(axis=0), 1.0)
    assert habits.weights().shape == (len(TEMPOS), 3)


def test_habits_give_probabilities_and_refuse_what_is_no_sighting():
    habits = Habits(3)
    for k, row in enumerate([[1.0, np.nan, 0.0], [np.nan, np.nan, 1.0], [1.0, np.nan, 0.0]]):
        habits.see(k * HOUR_S, np.array(row))
    told = habits.probability(50.0 * HOUR_S)
    assert told.shape == (3,)
    assert ((told >= 0.0) & (told <= 1.0)).all()
    for time_s, values in ((HOUR_S, [0.0] * 3), (9.0 * HOUR_S, [2.0] * 3), (9.0 * HOUR_S, [0.0])):
        with pytest.raises(InvalidValueError):
            habits.see(time_s, np.array(values))


def test_scores():
    np.testing.assert_allclose(
        log_score(np.array([0.7, 0.0]), np.array([1.0, 1.0])), [-math.log(0.7), -math.log(0.01)]
    )
