# SPDX-License-Identifier: Apache-2.0
"""Scans of a made room with known errors: the card gives back what was put in, no more, no less."""

import math
from dataclasses import dataclass
from itertools import count

import numpy as np
import pytest

from slam.errors import InvalidValueError
from slam.evaluation.scanner.card import STATISTICS, measure
from slam.evaluation.scanner.figures import NOTHING, Figure, apart, median, ratio
from slam.evaluation.scanner.noise import flicker_variance, sigma_as_sent, sigma_before_rounding
from slam.evaluation.scanner.stretches import CREPT_M, LEAST_STANDING
from slam.evaluation.scanner.walls import walls
from slam.frames import Frame, LaserSpec, Odometry, Scan, Stream, StreamMetadata, to_ns
from tests.world2d import frame_at

pytestmark = pytest.mark.slow
SPEC = LaserSpec(n_beams=181, angle_min=-math.pi / 2, angle_increment=math.radians(1.0))
ROOM = ((-4.0, -2.5), (5.0, -2.5), (5.0, 3.5), (-4.0, 3.5))
PILLAR = ((2.0, -0.3), (2.0, 0.5), (2.2, 0.5), (2.2, -0.3))
SCANS = 12


@dataclass(frozen=True)
class Errors:
    """What is done to exact ranges, in m and shares."""

    sigma: float = 0.0
    grows: float = 0.0  # by so much of the range
    step: float = 0.0
    coarse_beyond: float = math.inf
    lost: float = 0.0
    mixed: float = 0.0
    offset: float = 0.0
    drift: float = 0.0
    rough: float = 0.0


def sides(*outlines):
    for outline in outlines:
        yield from zip(outline, (*outline[1:], outline[0]), strict=True)


def exact(x, y, yaw, outlines):
    """(n,) m to the nearest side."""
    along = np.stack([np.cos(SPEC.angles + yaw), np.sin(SPEC.angles + yaw)])
    best = np.full(SPEC.n_beams, np.inf)
    for (ax, ay), (bx, by) in sides(*outlines):
        across = along[0] * (by - ay) - along[1] * (bx - ax)
        with np.errstate(divide="ignore", invalid="ignore"):
            far = ((ax - x) * (by - ay) - (ay - y) * (bx - ax)) / across
            part = ((ax - x) * along[1] - (ay - y) * along[0]) / across
        hit = (far > 0.0) & (part >= 0.0) & (part <= 1.0)
        best = np.where(hit, np.minimum(best, far), best)
    return best


def seen(true, errors, rng, fixed):
    """One scan, from exact ranges; ``fixed`` draws what is the same in all of a stretch."""
    ranges = true.copy()
    jump = np.abs(np.diff(true)) > 0.4
    for k in np.flatnonzero(jump):
        if fixed["chance"][k] < errors.mixed:
            low, high = sorted((true[k], true[k + 1]))
            farther = k if true[k] > true[k + 1] else k + 1
            ranges[farther] = low + fixed["place"][k] * (high - low)
    ranges = ranges + errors.offset + errors.rough * fixed["rough"]
    sigma = errors.sigma + errors.grows * true
    ranges = ranges + sigma * rng.standard_normal(ranges.size)
    if errors.step:
        step = np.where(ranges > errors.coarse_beyond, 5.0 * errors.step, errors.step)
        ranges = np.rint(ranges / step) * step
    ranges[rng.random(ranges.size) < errors.lost] = np.inf
    return ranges


def log(errors, *, places=12, outlines=(ROOM,), scans=SCANS, seed=0, driving=False, wheels=True):
    """Stands at ``places`` for ``scans`` each; with ``driving`` it moves a little between scans."""
    rng, frames, clock = np.random.default_rng(seed), [], count()
    for _ in range(places):
        x, y, yaw = rng.uniform(-1.5, 1.2), rng.uniform(-1.5, 2.0), rng.uniform(-math.pi, math.pi)
        fixed = {"chance": rng.random(181), "place": rng.uniform(0.2, 0.8, 181),
                 "rough": rng.standard_normal(181)}  # fmt: skip
        still = exact(x, y, yaw, outlines)
        for k in range(scans):
            moved = 0.02 * k if driving else 0.0
            true = (exact(x + moved, y, yaw, outlines) if moved else still) + errors.drift * k
            stamp = to_ns(0.1 * next(clock))
            ranges = seen(true, errors, rng, fixed)
            frames.append(frame_at(stamp, (x + moved, y, yaw), ranges, SPEC))
    return Stream(metadata=StreamMetadata(source="made", laser=SPEC, odometry=wheels),
                  frames=lambda: frames)  # fmt: skip


def figure(stream, key) -> Figure:
    return measure(stream).figures[key]


# -- noise and rounding ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sigma", "step"),
    [(0.002, 0.0), (0.02, 0.0), (0.0, 0.01), (0.003, 0.01), (0.015, 0.0025)],
)
def test_noise_of_a_standing_robot_is_what_was_put_in(sigma, step):
    card = measure(log(Errors(sigma=sigma, step=step), places=16))
    noise, sent = card.figures["standing"], math.hypot(sigma, step / math.sqrt(12.0))
    assert card.standing_stretches == 16
    assert noise.value == pytest.approx(sent, rel=0.06)
    if sigma > 0.0:  # rounding alone is the same in every stretch, and has no interval
        assert 0.97 * noise.low <= sent <= 1.03 * noise.high
        assert noise.high - noise.low < 0.2 * sent + 1e-9
    assert card.figures["step"].value == step


@pytest.mark.parametrize("sigma", [0.003, 0.01, 0.018])
def test_deviation_about_walls_is_noise_and_roughness(sigma):
    plain = figure(log(Errors(sigma=sigma)), "wall")
    assert plain.value == pytest.approx(sigma, rel=0.06)
    rough = figure(log(Errors(sigma=0.6 * sigma, rough=0.8 * sigma), places=24), "wall")
    assert rough.value == pytest.approx(sigma, rel=0.12)
    rest = figure(log(Errors(sigma=0.6 * sigma, rough=0.8 * sigma)), "standing")
    assert rest.value == pytest.approx(0.6 * sigma, rel=0.06)  # roughness is no noise


def test_noise_that_grows_with_range_is_found_in_its_bins():
    even = figure(log(Errors(sigma=0.005), seed=1), "standing.1-2")
    assert even.value == pytest.approx(0.005, rel=0.06)
    grown = measure(log(Errors(grows=0.004), seed=1)).figures
    assert 0.004 < grown["standing.1-2"].value < 0.008
    assert 0.008 < grown["standing.2-4"].value < 0.016
    assert apart(grown["standing.1-2"], grown["standing.2-4"])


@pytest.mark.parametrize("sigma", [0.0, 0.0003, 0.001, 0.003, 0.006, 0.02])
def test_flicker_of_rounded_ranges_by_sampling_and_back(sigma):
    step, rng = 0.01, np.random.default_rng(1)
    places = (np.arange(4000) + 0.5) / 4000 * step
    sent = np.rint((places[:, None] + sigma * rng.standard_normal((4000, 200))) / step) * step
    sampled = float(sent.var(axis=1, ddof=1).mean())
    assert flicker_variance(sigma, step) == pytest.approx(sampled, rel=0.03, abs=1e-12)
    back = sigma_before_rounding(flicker_variance(sigma, step), step)
    assert back == pytest.approx(sigma, abs=2e-5)
    total = math.sqrt(float(((sent - places[:, None]) ** 2).mean()))
    assert sigma_as_sent(sampled, step) == pytest.approx(total, rel=0.02)


def test_a_device_that_counts_five_steps_at_once_far_away():
    card = measure(log(Errors(sigma=0.02, step=0.01, coarse_beyond=4.0), places=16)).figures
    assert card["step"].value == 0.01
    assert card["coarse.0-4"].value == pytest.approx(0.2, abs=0.03)
    assert card["coarse.4-80"].value > 0.97


# -- lost beams and edges -------------------------------------------------------------------------


@pytest.mark.parametrize("lost", [0.0, 0.01, 0.05])
def test_lost_beams_are_counted_once(lost):
    card = measure(log(Errors(sigma=0.005, lost=lost), places=16)).figures
    for key in ("no_return", "holes"):
        assert card[key].value == pytest.approx(lost, rel=0.15, abs=1e-9), key


@pytest.mark.parametrize("mixed", [0.0, 0.3, 0.8])
def test_ranges_between_the_sides_of_an_edge(mixed):
    stream = log(Errors(sigma=0.005, mixed=mixed), places=80, scans=10, outlines=(ROOM, PILLAR))
    card = measure(stream).figures
    bins = [card[s.key] for s in STATISTICS if s.key.startswith("between.")]
    found = [f for f in bins if math.isfinite(f.value)]
    assert found
    for one in found:
        assert one.value == pytest.approx(mixed, abs=0.17 if mixed else 0.0)


# -- what is looked at ----------------------------------------------------------------------------


def test_only_a_robot_at_rest_stands():
    moving = measure(log(Errors(sigma=0.005), driving=True))
    assert moving.standing_stretches == 0
    assert math.isnan(moving.figures["standing"].value)
    assert moving.figures["wall"].value == pytest.approx(0.005, rel=0.1)
    blind = measure(log(Errors(sigma=0.005), wheels=False))  # nobody knows whether it stood
    assert blind.standing_stretches == 0
    short = measure(log(Errors(sigma=0.005), scans=LEAST_STANDING - 1))
    assert short.standing_stretches == 0


def test_odometry_that_comes_late_is_found_by_the_ranges():
    late = measure(log(Errors(sigma=0.005, drift=5.0 * CREPT_M / SCANS)))
    assert late.standing_stretches == 0
    assert late.crept == 12


def test_walls_are_found_where_they_are_and_corners_split_them():
    true = exact(0.0, 0.0, 0.3, (ROOM,))
    found = walls(true, SPEC.angles)
    assert 2 <= len(found) <= 3
    for wall in found:
        assert np.abs(wall.residuals).max() < 1e-6
        assert wall.holes == 0
    arc = np.full(181, 3.0)  # a round room has no straight wall longer than its tolerance
    assert all(len(wall.beams) < 45 for wall in walls(arc, SPEC.angles))


def test_logs_of_one_scanner_only():
    with pytest.raises(InvalidValueError, match="must have laser scans, got none"):
        measure(Stream(metadata=StreamMetadata(source="made"), frames=list))
    with pytest.raises(InvalidValueError, match="needs a log"):
        measure()
    other = LaserSpec(n_beams=91, angle_min=-math.pi / 2, angle_increment=math.radians(2.0))
    scan = Scan(stamp_ns=0, ranges=np.full(91, 2.0, np.float32), spec=other)
    frame = Frame(stamp_ns=0, odometry=Odometry(stamp_ns=0, T_odom_robot=np.zeros(3)), scan=scan)
    two = Stream(metadata=StreamMetadata(source="made", laser=other), frames=lambda: [frame])
    with pytest.raises(InvalidValueError, match="one scanner, got 181 and 91 beams"):
        measure(log(Errors(), places=1), two)
    assert measure(two).figures["standing"] == NOTHING
    assert set(measure(two).figures) == {row.key for row in STATISTICS}


# -- intervals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("stretches", "repeats"), [(4, 300), (30, 60)])
@pytest.mark.parametrize("kind", ["ratio", "median"])
def test_intervals_hold_the_truth_as_often_as_they_say(stretches, repeats, kind):
    """Beams of a stretch share an error: an interval from beams would be far too narrow."""
    rng, held = np.random.default_rng(5), 0
    for _ in range(repeats):
        values = 10.0 + rng.standard_normal((stretches, 1))
        values = values + 0.3 * rng.standard_normal((stretches, 40))
        own = ratio(values.sum(axis=1), [40] * stretches) if kind == "ratio" else median(values)
        held += own.low <= 10.0 <= own.high
    assert 0.84 <= held / repeats <= 0.99


def test_few_stretches_have_no_interval():
    assert not ratio([1.0, 2.0], [4.0, 4.0]).has_interval
    assert ratio([1.0, 2.0], [4.0, 4.0]).value == 0.375
    assert ratio([1.0, 0.0], [4.0, 0.0]).stretches == 1
    assert ratio([], []) == NOTHING
    assert median([np.zeros(0)]) == NOTHING
    assert apart(NOTHING, NOTHING) is None
