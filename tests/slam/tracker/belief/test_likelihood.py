# SPDX-License-Identifier: Apache-2.0
"""The equations of the belief: what a scan says, what priors cost, and that it adds up."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slam.frontend.observations import Observations
from slam.tracker.belief.belief import MOST_LOST, Belief
from slam.tracker.belief.config import BeliefConfig
from slam.tracker.belief.likelihood import (
    ENDS,
    LEAST_S,
    MOST_NATS,
    S_PER_H,
    carried,
    evidence,
    probabilities,
    sum_of,
)
from tests.slam.tracker.belief.drives import FAST, ROOMS, at, mapped, still
from tests.slam.tracker.belief.drives import estimates as said
from tests.world2d import going_on

CONFIG = BeliefConfig()


def test_a_scan_says_the_more_the_more_of_it_is_explained_and_no_more_than_its_bounds() -> None:
    nats = np.array([evidence(CONFIG, share) for share in np.linspace(0.0, 1.0, 101)])
    assert (np.diff(nats) > 0.0).all()
    most = CONFIG.slope * math.log((1.0 + ENDS) / ENDS)
    assert (nats[0], nats[-1]) == pytest.approx((CONFIG.known - most, CONFIG.known + most))
    assert (evidence(CONFIG, -3.0), evidence(CONFIG, 7.0)) == (nats[0], nats[-1])
    assert nats[50] == pytest.approx(CONFIG.known)
    np.testing.assert_allclose(nats + nats[::-1], 2.0 * CONFIG.known, atol=1e-9)
    nothing = replace(CONFIG, slope=0.0, known=0.0)
    assert evidence(nothing, 0.0) == evidence(nothing, 1.0) == 0.0


@pytest.mark.parametrize("shares", [[0.3], [0.9, 0.2, 0.7], [0.5] * 20])
def test_scans_multiply_the_odds(shares: list[float]) -> None:
    """Each with ((s + e) / (1 - s + e))^a exp(b)."""
    odds = 0.01
    for s in shares:
        odds *= ((s + ENDS) / (1.0 - s + ENDS)) ** CONFIG.slope * math.exp(CONFIG.known)
    p, _ = probabilities([math.log(0.01) + sum(evidence(CONFIG, s) for s in shares), 0.0])
    assert p == pytest.approx(odds / (1.0 + odds))


def test_the_prior_of_being_carried_is_a_rate_an_hour() -> None:
    assert math.exp(carried(3.0, 0.2)) == pytest.approx(3.0 * 0.2 / S_PER_H)
    assert carried(3.0, 0.0) == carried(3.0, LEAST_S)
    assert carried(0.0, 1e6) == -MOST_NATS
    assert probabilities([-MOST_NATS + 60.0, carried(0.0, 60.0)])[1] < 1e-20


@pytest.mark.parametrize("steps", [1, 7, 500])
def test_the_prior_adds_up_over_a_gap_however_often_it_is_asked(steps: int) -> None:
    nats = -MOST_NATS
    for _ in range(steps):
        nats = sum_of([nats, carried(2.0, 100.0 / steps)])
    assert nats == pytest.approx(math.log(2.0 * 100.0 / S_PER_H))


def test_what_scans_say_of_the_motion_is_bounded_either_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Who went on for hours is lost by one kidnap; who was lost for hours is believed in time."""
    system, last = mapped(ROOMS)
    for nats, bound in ((1e3, -MOST_NATS), (-1e3, MOST_LOST)):
        monkeypatch.setattr(
            Belief, "_going_on", lambda *_, evidence=nats: (evidence >= 0.0, evidence)
        )
        stream = going_on(still(ROOMS, at(system), 0.8), last)
        said(system, stream)
        last = stream[-1]
        assert system._belief._unknown == pytest.approx(bound, abs=1e-6)
    monkeypatch.undo()
    assert 8.0 * evidence(CONFIG, 1.0) > MOST_LOST


def test_too_little_in_view_says_nothing() -> None:
    system, last = mapped(ROOMS)
    seen: list[Observations] = []
    belief, plain = system._belief, system._belief._match

    def matched(observations: Observations, *more):  # type: ignore[no-untyped-def]
        seen.append(observations)
        return plain(observations, *more)

    belief._match = matched
    said(system, going_on(still(ROOMS, at(system), 0.2), last)[:1])
    match = matched(seen[0], system._predict(last), system.cell_map)
    few = FAST.tracking.relocalise.least_weight / seen[0].amount
    for share, silent in ((0.99 * few, True), (1.01 * few, False)):
        less = replace(seen[0], shares=share * seen[0].shares)
        goes_on, nats = belief._going_on(None, less, match, 1.0)
        assert (goes_on, nats == 0.0) == (True, silent)


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
