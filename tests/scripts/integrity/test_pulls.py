# SPDX-License-Identifier: Apache-2.0
"""What is said of movers' pull against what it was: the sums, and a stream gone through again."""

import math

import numpy as np
import pytest

from scripts.integrity.pulls import Event, recorded, variances
from scripts.integrity.ways import Case
from slam.frames import Float
from slam.frontend.odometry_prior import Prediction
from slam.tracker.standing.agreement import Agreement, Pull

STEP_S, N = 0.1, 60
OFF = np.array([0.01, 0.0, 0.0])  # m, each correction


def corrections(erred: Float, old: Float) -> list[Event]:
    """``N`` matches that correct by ``OFF``, whose poses err by ``erred`` more each."""
    prediction = Prediction(
        T_map_robot=np.zeros(3), increment=np.zeros(3), covariance=np.eye(3) * 1e-6,
        twist=np.zeros(3), elapsed=STEP_S,
    )  # fmt: skip
    each: list[Event] = [
        (Agreement.hold, (old, STEP_S), None),
        (Agreement.take, (prediction, OFF, 0.5), erred),
    ]
    return each * N


def test_what_nothing_holds_is_said_to_be_the_movers_and_counted_as_the_error_is() -> None:
    true, said, left = variances(corrections(OFF, np.zeros(6)), Pull())
    keep = math.exp(-STEP_S / 2.0)
    sums = OFF[0] * np.cumsum(keep ** np.arange(N))
    assert true == pytest.approx((1.0 - keep**2) * (sums**2).sum(), rel=1e-9)
    assert said == pytest.approx(true, rel=1e-9)
    assert left == pytest.approx(0.0, abs=1e-15)


def test_held_matches_are_said_to_be_right() -> None:
    wall = np.array([99.0, 0.0, 0.0, 99.0, 0.0, 99.0])
    true, said, left = variances(corrections(np.zeros(3), wall), Pull(holds=1.0))
    assert true == 0.0
    assert left == said
    whole, _, _ = variances(corrections(OFF, np.zeros(6)), Pull())
    assert said == pytest.approx(whole * 0.01**2, rel=1e-9)


def test_a_match_that_was_not_used_does_not_count() -> None:
    events = corrections(OFF, np.zeros(6))
    forgotten: list[Event] = [*events, (Agreement.forget, (), None)]
    assert variances(forgotten, Pull())[0] < variances(events, Pull())[0]


def test_a_stream_is_gone_through_again_with_other_numbers() -> None:
    case = Case(way="crowd", number=0, slam="", first_seed=300_000, seconds=12.0)
    events = recorded(case)
    assert sum(what is Agreement.take for what, _, _ in events) > 100
    true, said, _ = variances(events, Pull())
    assert 0.0 < true < 1e-3  # a good robot: 3 cm at most
    assert said < 1e-2
    assert variances(events, Pull(holds=100.0))[1] > 2.0 * said
