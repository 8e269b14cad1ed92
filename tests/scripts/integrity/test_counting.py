# SPDX-License-Identifier: Apache-2.0
"""What is hazardous, how long an outage lasts, and bounds against the distributions they invert."""

import math

import numpy as np
import pytest
import scipy.stats

from scripts.integrity.counting import (
    Moments,
    bin_quantile,
    binned,
    most_of_time,
    most_of_trials,
    stretches,
)
from scripts.metrics.judged import Judged
from slam.trajectory import Trajectory

HZ = 10.0


def moments(off, trusted=None, told=None, turned=None, level=None) -> Moments:
    n = len(off)
    every = np.ones(n, dtype=bool)
    return Moments(
        seconds=np.arange(n) / HZ,
        off=np.array(off, float),
        turned=np.zeros(n) if turned is None else np.array(turned, float),
        trusted=every if trusted is None else np.array(trusted, bool),
        told=every if told is None else np.array(told, bool),
        level=np.zeros(n) if level is None else np.array(level, float),
    )


def test_each_scan_has_its_place_in_the_diagram():
    run = moments(
        off=[0.01, 0.2, 0.2, 0.6, 0.6, 0.6],
        trusted=[1, 1, 1, 1, 1, 0],
        told=[0, 0, 1, 0, 1, 1],
        level=[0.4, 0.4, 0.7, 0.4, 0.7, 0.2],
    )
    assert run.misleading().tolist() == [False, True, False, False, False, False]
    assert run.hazardous().tolist() == [False, False, False, True, True, False]
    assert run.right().tolist() == [True, True, True, False, False, False]
    assert run.right(0.1).tolist() == [True] + 5 * [False]
    assert run.protected().tolist() == [True, True, False, True, False, False]


def test_the_protection_level_is_three_deviations_in_the_worst_direction():
    stamps = np.arange(3) * 10**9
    poses = Trajectory(stamps_ns=stamps, poses=np.zeros((3, 3)))
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    P = turn @ np.diag([0.2**2, 0.1**2, 9.0]) @ turn.T
    covariances = np.stack([np.zeros((3, 3)), P, np.diag([0.04, 0.04, 0.0])])
    judged = Judged(estimate=poses, truth=poses, covariances=covariances)
    assert judged.protection_levels() == pytest.approx([0.0, 0.6, 0.6])


def test_a_wrong_place_is_one_that_is_come_to_be_trusted():
    slides = moments(off=[0.0, 0.6, 0.7], trusted=[1, 1, 1])
    assert slides.wrong_places() == 0
    found = moments(off=[0.6, 0.7, 0.8, 0.9, 0.1], trusted=[0, 1, 1, 0, 1])
    assert found.wrong_places() == 1
    assert slides.since(1).wrong_places(trusted_before=False) == 1  # who never doubts


def test_after_an_event_half_a_second_is_spared_and_a_scan_at_least():
    run = moments(off=[9.0] * 10)
    assert run.hazardous().sum() == 10
    assert run.after_alert().seconds[0] == 0.5
    slow = moments(off=[9.0] * 3)
    slow = Moments(**{**vars(slow), "seconds": np.arange(3) * 2.0})
    assert slow.after_alert().seconds.tolist() == [2.0, 4.0]


def test_recovered_is_right_for_a_second():
    off = [5.0] * 10 + [0.1] * 5 + [5.0] * 5 + [0.1] * 15
    assert moments(off).recovered_s() == pytest.approx(2.0)
    assert moments(off).recovered_s(12) == pytest.approx(0.8)
    assert math.isinf(moments([5.0] * 10 + [0.1] * 5).recovered_s())
    assert math.isinf(moments(off, turned=[0.5] * len(off)).recovered_s())


def test_outages_follow_each_other():
    trusted = np.ones(60, dtype=bool)
    trusted[5:8] = trusted[30:32] = False
    off = np.zeros(60)
    off[34:36] = 0.7  # within a second of the second outage: the same one
    assert moments(off, trusted).outages() == pytest.approx([0.3, 0.6])
    off[58:] = 0.7
    assert moments(off, trusted).outages()[2] == math.inf
    assert moments(np.zeros(60)).outages() == []
    assert stretches(np.array([1, 1, 0, 1, 0, 0, 1], bool)) == 3
    assert stretches(np.zeros(0, bool)) == 0


def test_bounds_invert_the_binomial_and_the_poisson():
    for hits, n in ((0, 10), (0, 1000), (3, 50), (49, 50)):
        assert scipy.stats.binom.cdf(hits, n, most_of_trials(hits, n)) == pytest.approx(0.05)
    for events in (0, 1, 12):
        rate = most_of_time(events, 4.0)
        assert scipy.stats.poisson.cdf(events, 4.0 * rate) == pytest.approx(0.05)
    assert most_of_trials(7, 7) == 1.0
    assert math.isnan(most_of_trials(0, 0))
    assert math.isnan(most_of_time(0, 0.0))


def test_quantiles_of_bins_are_those_of_the_values_to_a_bin():
    rng = np.random.default_rng(1)
    values = np.exp(rng.normal(0.0, 1.0, 20_000))
    bins = [binned(values[:5000]), binned(values[5000:])]
    for share in (0.5, 0.99, 0.999):
        assert bin_quantile(bins, share) == pytest.approx(np.quantile(values, share), rel=0.045)
    assert math.isnan(bin_quantile([], 0.5))
