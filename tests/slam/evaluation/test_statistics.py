# SPDX-License-Identifier: Apache-2.0
"""Statistics against closed forms, NumPy and SciPy."""

import math

import numpy as np
import pytest
from scipy.stats import binom, bootstrap

from slam.errors import InvalidValueError
from slam.evaluation.statistics import (
    bootstrap_draws,
    drawn_medians,
    median_interval,
    paired,
    quantile,
    ratio_interval,
    share_interval,
)

INF = math.inf


def test_quantiles_are_numpys_where_all_is_finite():
    values = np.random.default_rng(1).normal(size=11).tolist()
    for share in (0.0, 0.1, 0.25, 0.5, 0.77, 1.0):
        assert quantile(values, share) == pytest.approx(np.quantile(values, share), abs=1e-12)
    assert math.isnan(quantile([], 0.5))


def test_quantiles_bear_infinities():
    assert quantile([1.0, 2.0, INF], 0.5) == 2.0
    assert quantile([1.0, INF, INF], 0.5) == INF
    assert quantile([1.0, INF], 0.25) == INF
    assert quantile([-INF, INF], 0.5) == 0.0
    assert quantile([-INF, 3.0], 0.5) == -INF


def test_intervals_bear_infinities_as_quantiles_do():
    always_better = [-INF, -INF, -INF, -3.0, -2.0, -1.0]
    low, high = median_interval(always_better)
    assert low == -INF
    assert high < 0.0
    assert median_interval([-v for v in always_better]) == (-high, INF)


def test_medians_of_things_drawn_are_those_of_all_that_each_has():
    rng = np.random.default_rng(3)
    owners = rng.integers(0, 5, 40)
    values = rng.choice([-INF, -1.0, 0.0, 0.3, 2.5, INF], 40)
    draws = bootstrap_draws(5)
    drawn = ([v for k in draw for v in values[owners == k].tolist()] for draw in draws)
    assert drawn_medians(values, draws, owners).tolist() == [quantile(all_, 0.5) for all_ in drawn]


def test_the_interval_of_a_ratio_is_the_paired_bootstraps():
    before = np.random.default_rng(3).lognormal(size=10)
    after = 2.0 * before + 0.1 * np.random.default_rng(4).lognormal(size=10)
    theirs = bootstrap(
        (before, after), lambda a, b, axis: np.median(b, axis) / np.median(a, axis), paired=True,
        n_resamples=20_000, method="percentile", rng=0,
    ).confidence_interval  # fmt: skip
    low, high = ratio_interval(before.tolist(), after.tolist())
    spread = theirs.high - theirs.low
    assert (low, high) == pytest.approx((theirs.low, theirs.high), abs=0.1 * spread)
    assert ratio_interval(before.tolist(), (3.0 * before).tolist()) == pytest.approx((3.0, 3.0))


def test_the_interval_of_a_ratio_bears_infinities_and_zeros():
    assert ratio_interval([1.0] * 6, [INF] * 6) == (INF, INF)
    assert ratio_interval([0.0] * 6, [0.0] * 6) == (1.0, 1.0)
    assert all(map(math.isnan, ratio_interval([], [])))
    with pytest.raises(InvalidValueError, match="2 values before must have as many after, got 1"):
        ratio_interval([1.0, 2.0], [1.0])


@pytest.mark.parametrize("n", [9, 10])
def test_the_interval_is_the_percentile_bootstraps(n: int):
    values = np.random.default_rng(n).lognormal(size=n)
    theirs = bootstrap(
        (values,), np.median, n_resamples=20_000, method="percentile", rng=0
    ).confidence_interval
    low, high = median_interval(values.tolist())
    spread = theirs.high - theirs.low
    assert low == pytest.approx(theirs.low, abs=0.1 * spread)
    assert high == pytest.approx(theirs.high, abs=0.1 * spread)
    assert median_interval(values.tolist()) == (low, high)  # the same each time


def test_the_interval_covers_the_true_median_nineteen_times_in_twenty():
    rng = np.random.default_rng(3)
    hit = 0
    for _ in range(200):
        low, high = median_interval(rng.normal(5.0, 1.0, 15).tolist())
        hit += low <= 5.0 <= high
    assert 0.88 <= hit / 200 <= 0.99


def test_wilson():
    """Closed form at 0 of n: 0 to z^2 / (n + z^2)."""
    z2 = 1.959963984540054**2
    low, high = share_interval(0, 10)
    assert low == pytest.approx(0.0, abs=1e-12)
    assert high == pytest.approx(z2 / (10.0 + z2), rel=1e-9)


def test_pairs():
    found = paired([1.0, 2.0, 3.0, 5.0, INF], [2.0, 2.0, 5.0, 4.0, INF], less_is_better=True)
    assert (found["wins"], found["ties"], found["losses"], found["n"]) == (2, 2, 1, 5)
    assert found["median_difference"] == 0.0
    assert found["p_sign"] == pytest.approx(1.0)
    other = paired([1.0, 2.0], [2.0, 3.0], less_is_better=False)
    assert (other["wins"], other["losses"]) == (0, 2)


def test_the_sign_test_is_the_binomials():
    found = paired([0.0] * 9 + [2.0], [1.0] * 10, less_is_better=True)
    assert found["p_sign"] == pytest.approx(2.0 * binom.cdf(1, 10, 0.5))


def test_a_failure_loses_to_whoever_came_through():
    found = paired([INF, INF, INF], [1.0, 2.0, 3.0], less_is_better=True)
    assert (found["losses"], found["median_difference"]) == (3, INF)
