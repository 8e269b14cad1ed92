# SPDX-License-Identifier: Apache-2.0
"""The fit finds the weights that data were drawn with, and the curve tells who is overconfident."""

import math
from dataclasses import replace

import numpy as np
import pytest

from scripts.integrity import fit, reliability, sources, weights
from scripts.integrity.belief_picture import shares
from scripts.integrity.kidnap import kidnapped, targets
from scripts.integrity.labelled import Labelled, labelled
from scripts.integrity.plane import StreamSpec, frames
from scripts.integrity.reliability import curve, off_by
from scripts.integrity.weights import JOINT, Scans, evidence, likelihood
from slam import se2
from slam.shunting import ShuntingSlam
from slam.tracker.belief.config import BeliefConfig
from slam.tracker.belief.evidence import Evidence
from slam.tracker.belief.posterior import Odds

TRUE = {
    "confirmed": 4.0, "confirmed_m": 0.6, "through": 3.0, "place": 3.0, "linear_m": 5.0,
}  # fmt: skip
START = {
    "confirmed": 7.0, "confirmed_m": 1.2, "through": 6.0, "place": 5.0, "linear_m": 5.0,
}  # fmt: skip


def places(rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 2) C and D of places as they come."""
    return np.stack([rng.exponential(1.5, count), rng.exponential(1.2, count)], axis=1)


def drawn(streams: int, scans: int) -> list[Labelled]:
    """Scans whose right place, or none, is drawn by the model; pairs likewise."""
    rng, out = np.random.default_rng(1), []
    for k in range(streams):
        one = Labelled(stream=str(k))
        for _ in range(scans):
            at = places(rng, 4)
            nats = np.append(evidence(TRUE, *at.T), TRUE["place"])
            p = np.exp(nats - np.logaddexp.reduce(nats))
            which = int(rng.choice(5, p=p / p.sum()))
            group = [(*where, n == which) for n, where in enumerate(at.tolist())]
            (one.none if which == 4 else one.found).append(group)
        at = places(rng, 2 * scans)
        p = 1.0 / (1.0 + np.exp(-evidence(TRUE, *at.T)))
        right = rng.random(len(p)) < p
        one.pairs.extend((*where, bool(is_)) for where, is_ in zip(at.tolist(), right, strict=True))
        out.append(one)
    return out


def test_what_a_search_finds_is_told_by_what_the_best_place_confirms() -> None:
    rng = np.random.default_rng(2)
    best_m = rng.uniform(0.0, 6.0, 4000)
    found = rng.random(4000) < 1.0 / (1.0 + np.exp(-0.9 * best_m))
    assert weights.searched(best_m, found, 2.0) == pytest.approx(0.9, abs=0.05)
    assert weights.searched(best_m[:0], found[:0], 2.0) == 2.0


@pytest.fixture(scope="module")
def synthetic() -> list[Labelled]:
    return drawn(6, 300)


def test_the_evidence_is_that_of_the_belief():
    rng, config = np.random.default_rng(0), BeliefConfig()
    values = {name: float(getattr(config, name)) for name in TRUE}
    odds, place = Odds(config, 1.0), Evidence()
    known, through = rng.exponential(5.0, 50), rng.exponential(2.0, 50)
    ours = evidence(values, known, through)
    for c, d, nats in zip(known.tolist(), through.tolist(), ours.tolist(), strict=True):
        place.known_m, place.through_m = c, d
        assert nats == pytest.approx(odds.evidence(place), abs=1e-9)


def test_weights_that_scans_were_drawn_with_are_found_again(synthetic):
    scans = Scans.of(synthetic)
    found = weights.fit(scans, START)
    # found and none count alike, and so do right and wrong pairs: as often as the other, by chance
    known, through = (grid.ravel() for grid in np.meshgrid([0.3, 1.0, 3.0, 8.0], [0.2, 1.0, 4.0]))
    of = evidence(found, known, through), evidence(TRUE, known, through)
    assert np.abs(of[0] - of[1]).max() < 1.2
    groups = len(scans.found.stream) / len(scans.none.stream)
    assert found["place"] == pytest.approx(TRUE["place"] + math.log(groups), abs=0.6)
    assert found["through"] == pytest.approx(TRUE["through"], rel=0.25)
    ones = np.ones(scans.streams)
    assert likelihood(found, scans, ones) >= likelihood(TRUE, scans, ones)
    assert weights.fit(scans, START) == found


def test_intervals_come_from_the_streams(synthetic):
    some = weights.fitted(synthetic, BeliefConfig(), resampled=3)
    assert set(some) == {*JOINT, *weights.ALONE}
    for name in ("through", "confirmed"):
        value, low, high = some[name]
        assert low < value * 1.2
        assert high > value * 0.8
        assert 0.0 < high - low < 2.0 * value
    alike = [replace(synthetic[0], stream=str(k)) for k in range(3)]
    value, low, high = weights.fitted(alike, BeliefConfig(), resampled=2)["through"]
    assert high - low < 1e-2 * value  # streams that are alike leave nothing open


def test_a_place_nearby_weighs_what_it_was_drawn_with():
    rng = np.random.default_rng(3)
    gains, prior = rng.uniform(-1.0, 2.0, 20_000), -6.0
    right = rng.random(len(gains)) < 1.0 / (1.0 + np.exp(-(12.0 * gains + prior)))
    slips = [(gain, prior, bool(is_)) for gain, is_ in zip(gains.tolist(), right, strict=True)]
    assert weights.nearby(slips, 5.0) == pytest.approx(12.0, rel=0.05)
    assert weights.nearby([(1.0, prior, True)], 5.0) == 5.0  # nothing wrong was seen


def said(rng: np.random.Generator, sharper: float) -> list[tuple[float, bool]]:
    """By somebody whose log odds are so many times what they should be."""
    odds = rng.normal(1.0, 2.5, 4000)
    right = rng.random(len(odds)) < 1.0 / (1.0 + np.exp(-odds))
    p = 1.0 / (1.0 + np.exp(-sharper * odds))
    return [(float(one), bool(is_)) for one, is_ in zip(p, right, strict=True)]


def test_a_calibrated_predictor_lies_on_the_diagonal_and_an_overconfident_one_does_not():
    rng = np.random.default_rng(0)
    bins = curve([said(rng, 1.0) for _ in range(10)])
    mean, most = off_by(bins)
    assert (mean < 0.01, most < 0.03) == (True, True)
    assert sum(one.n for one in bins) == 40_000
    assert sum(one.ends[0] <= one.mean <= one.ends[1] for one in bins) >= len(bins) - 1
    bins = curve([said(rng, 3.0) for _ in range(10)])
    mean, most = off_by(bins)
    assert (mean > 0.05, most > 0.1) == (True, True)
    assert bins[-1].ends[1] < bins[-1].mean
    assert bins[0].ends[0] > bins[0].mean


def test_test_streams_are_not_those_of_the_fit():
    training = sources.sources([*sources.TRACKS, *sources.PLANES], range(3))
    trained = {one.seed for one in training}
    tested = reliability.specs(reliability.TESTED, [fit.FIRST_TEST_SEED], 150.0)
    assert not trained & {spec.seed for _, spec in tested}
    assert {name for name, _ in tested} == set(reliability.TESTED)
    for one, other in sources.with_others(training):
        assert sources.building_of(one) != sources.building_of(other)


def test_labels_of_a_stream():
    stream = frames(StreamSpec(kind="chairs8", seed=4, seconds=27.0))
    other = frames(StreamSpec(kind="quiet", seed=3, seconds=20.0))
    found = labelled("a", stream, other)
    right = [place for place in found.pairs if place[2]]
    wrong = [place for place in found.pairs if not place[2]]
    assert 0 < 2 * len(right) == len(wrong)
    assert len(found.found) == len(found.none) == len(right)
    assert min(place[0] - place[1] for place in right) > 0.0
    assert np.mean([place[1] for place in wrong]) > np.mean([place[1] for place in right])
    assert any(place[2] for place in found.found[-1])
    assert min(found.going) > 0.3
    assert max(found.carried, default=0.0) < 0.5


def test_probabilities_of_a_kidnapped_robot_add_up():
    spec = StreamSpec(kind="chairs8", seed=4, seconds=30.0)
    stream, later = frames(spec), frames(replace(spec, again=1))
    slam = ShuntingSlam()
    for frame in stream:
        slam.update(frame.without_truth())
    start = next(iter(targets(stream, later, 10, 1)))
    seen = []
    for frame in kidnapped(stream, later, start, 10):
        slam.update(frame.without_truth())
        truth = se2.between(stream[0].truth, frame.truth)
        hypotheses = reliability.weighed(slam, truth)
        assert sum(shares(slam)) == pytest.approx(1.0)
        if hypotheses:
            seen.append(hypotheses)
            assert sum(p for p, _ in hypotheses) == pytest.approx(1.0)
            assert any(right for _, right in hypotheses)
    assert seen  # it doubted


def test_unknown_streams_are_refused(tmp_path, capsys):
    assert fit.main(["--streams", "boats", "--folder", str(tmp_path), "--no-page"]) == 1
    assert capsys.readouterr().err.startswith("--streams must be of moving-day")
