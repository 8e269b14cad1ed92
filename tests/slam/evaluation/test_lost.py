# SPDX-License-Identifier: Apache-2.0
"""Lost is far off for long enough, found again near for as long; a divergence rises and stays."""

import math

import numpy as np
import pytest

from slam import se2
from slam.errors import InvalidValueError
from slam.evaluation.lost import (
    Rule,
    error_m,
    errors_since_m,
    first_divergence,
    found_again_at,
    largest_rise_m,
    lost_at,
)

SECONDS = np.arange(0.0, 10.0, 0.1)
ZERO = np.zeros(100)


def off(first, last, value):
    return np.where((first <= SECONDS + 1e-9) & (last > SECONDS + 1e-9), value, 0.0)


def test_a_short_slip_is_not_lost_and_a_long_one_is_from_its_start():
    assert lost_at(SECONDS, off(2.0, 2.9, 0.6), ZERO) is None
    assert lost_at(SECONDS, off(2.0, 3.5, 0.6), ZERO) == pytest.approx(2.0)
    assert lost_at(SECONDS, off(2.0, 3.5, 0.4), ZERO) is None


def test_a_wrong_heading_is_lost_too_either_way_round():
    assert lost_at(SECONDS, ZERO, off(1.0, 4.0, -0.4)) == pytest.approx(1.0)
    assert lost_at(SECONDS, ZERO, off(1.0, 4.0, 0.3)) is None


def test_found_again_is_near_for_a_while_after_it_was_lost():
    distances = off(2.0, 5.0, 0.6)
    assert found_again_at(SECONDS, distances, ZERO, 2.0) == pytest.approx(5.0)
    assert found_again_at(SECONDS, distances + 0.3, ZERO, 2.0) is None


STAMPS = np.arange(0, 20_000_000_000, 100_000_000)  # 20 s at 10 Hz
TIMES = STAMPS * 1e-9
TRUTH = np.column_stack([0.5 * TIMES + 3.0, 0.0 * TIMES, 0.0 * TIMES])  # m, m, rad in the world


def beside(errors):
    """A run whose estimate is that far to the left: stamps, truth, estimate."""
    estimate = TRUTH - TRUTH[0]
    estimate[:, 1] = errors
    return STAMPS, TRUTH, estimate


def test_a_jump_that_stays_is_found_where_it_begins():
    errors = np.where(TIMES > 8.05, 0.6, 0.1)
    found = first_divergence(*beside(errors))
    assert found is not None
    assert TIMES[found.begins] == pytest.approx(8.0)
    assert TIMES[found.found] == pytest.approx(8.1)
    assert found.rise_m == pytest.approx(0.5)


def test_a_ramp_is_found_where_it_has_risen_enough():
    errors = np.clip(0.2 * (TIMES - 5.0), 0.0, 1.0)
    found = first_divergence(*beside(errors), Rule(threshold_m=0.25))
    assert found is not None
    assert TIMES[found.begins] == pytest.approx(5.2, abs=0.11)
    assert TIMES[found.found] == pytest.approx(6.3, abs=0.11)


@pytest.mark.parametrize(
    ("name", "errors"),
    [
        ("slow drift", 0.1 * TIMES),
        ("a glitch", np.where((TIMES > 8.0) & (TIMES < 8.5), 2.0, 0.0)),
        ("a correction", np.where(TIMES > 8.0, 0.0, 2.0)),
        ("nothing", np.zeros(len(TIMES))),
    ],
)
def test_what_is_no_divergence(name, errors):
    assert first_divergence(*beside(errors)) is None, name


def test_the_first_of_two_and_the_largest_rise():
    errors = np.where(TIMES > 5.0, 0.4, 0.0) + np.where(TIMES > 12.0, 3.0, 0.0)
    found = first_divergence(*beside(errors))
    assert found is not None
    assert TIMES[found.found] == pytest.approx(5.1, abs=0.11)
    assert largest_rise_m(*beside(errors)) == pytest.approx(3.0)
    assert largest_rise_m(STAMPS[:0], TRUTH[:0], TRUTH[:0]) == 0.0


def test_driving_on_with_an_old_heading_error_is_none():
    """0.4 rad off from the start, at 0.5 m/s: 0.4 m further off in 2 s, and no new mistake."""
    stamps, truth, estimate = beside(0.0 * TIMES)
    turned = np.column_stack([se2.transform([0.0, 0.0, 0.4], estimate[:, :2]), 0.0 * TIMES + 0.4])
    errors = errors_since_m((truth[0], np.zeros(3)), truth, turned)
    assert errors[60] - errors[40] > 0.35
    assert first_divergence(stamps, truth, turned) is None
    assert largest_rise_m(stamps, truth, turned) < 1e-9
    assert errors_since_m((truth[5], turned[5]), truth[5:], turned[5:]).max() < 1e-9


def test_a_heading_counts_at_a_lever_of_a_metre_and_wraps():
    assert error_m(np.array([3.0, 4.0, 0.0]), np.zeros(3)) == 5.0
    a, b = np.array([0.0, 0.0, math.pi - 0.1]), np.array([0.0, 0.0, 0.1 - math.pi])
    assert error_m(a, b) == pytest.approx(0.2)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "much"])
def test_a_rule_is_checked(value):
    with pytest.raises(InvalidValueError, match=r"Rule\.threshold_m must be"):
        Rule(threshold_m=value)
