# SPDX-License-Identifier: Apache-2.0
"""When an error counts as a divergence, and when it does not."""

from __future__ import annotations

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
    largest_rise_m,
)

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
