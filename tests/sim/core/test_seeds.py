# SPDX-License-Identifier: Apache-2.0
"""Streams of randomness and the dynamism curves."""

import math

import numpy as np
import pytest

from sim.core.dynamism import Dynamism
from sim.core.seeds import STREAMS, Seeds, between, normal, uniform, waiting
from slam.errors import InvalidValueError, UnknownNameError


def test_the_seed_and_only_the_seed_decides_a_stream():
    for name in STREAMS:
        same, again, other = (Seeds(s).generator(name).random(8) for s in (7, 7, 8))
        np.testing.assert_array_equal(same, again)
        assert not np.array_equal(same, other)


def test_the_first_counters_do_not_depend_on_how_many_there_are():
    np.testing.assert_array_equal(
        Seeds(3).counters("chairs", 4), Seeds(3).counters("chairs", 9)[:4]
    )


@pytest.mark.parametrize("seed", [-1, 1.5, True, "1"])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(InvalidValueError, match="seed"):
        Seeds(seed)


def test_an_unknown_stream_is_named():
    with pytest.raises(UnknownNameError, match="Did you mean 'chairs'"):
        Seeds(1, chair=2)


def test_compiled_draws_have_their_distributions():
    counters = Seeds(1).counters("people", 1)
    n = 20_000
    flat = np.array([uniform(counters, 0) for _ in range(n)])
    assert flat.min() >= 0.0
    assert flat.max() < 1.0
    assert abs(flat.mean() - 0.5) < 4.0 * math.sqrt(1.0 / 12.0 / n)
    assert abs(np.corrcoef(flat[:-1], flat[1:])[0, 1]) < 4.0 / math.sqrt(n)
    bell = np.array([normal(counters, 0) for _ in range(n)])
    assert abs(bell.mean()) < 4.0 / math.sqrt(n)
    assert abs(bell.std() - 1.0) < 4.0 / math.sqrt(2.0 * n)
    waits = np.array([waiting(counters, 0, 0.5) for _ in range(n)])
    assert abs(waits.mean() - 2.0) < 4.0 * 2.0 / math.sqrt(n)
    assert waiting(counters, 0, 0.0) == math.inf
    assert 2.0 <= between(counters, 0, 2.0, 3.0) < 3.0


def test_every_rate_rises_with_the_dynamism():
    rows = [Dynamism.at(d) for d in (0.0, 0.25, 0.5, 1.0)]
    for name in ("chair_push_rate", "bin_kick_rate", "door_rate"):
        rates = [getattr(row, name) for row in rows]
        assert rates == sorted(set(rates))
    stays = [row.stay_mean for row in rows]
    assert stays == sorted(set(stays), reverse=True)


def test_people_walk_in_proportion_to_the_dynamism():
    way_s = 10.0  # between two goals
    walking = [way_s / (way_s + Dynamism.at(d).stay_mean) for d in (0.25, 0.5, 0.75, 1.0)]
    assert walking == pytest.approx([d * 5.0 / 6.0 for d in (0.25, 0.5, 0.75, 1.0)])


@pytest.mark.parametrize("dynamism", [-0.1, 1.1, 2, math.nan, "much", True])
def test_dynamism_lies_between_0_and_1(dynamism):
    with pytest.raises(InvalidValueError, match="dynamism"):
        Dynamism.at(dynamism)


@pytest.mark.parametrize(
    "field", [{"door_rate": -1.0}, {"stay_mean": 0.0}, {"push_speed_min": 2.0}, {"pace": math.nan}]
)
def test_rates_are_checked(field):
    with pytest.raises(InvalidValueError, match=next(iter(field)).rsplit("_", 1)[0]):
        Dynamism(**field)
