# SPDX-License-Identifier: Apache-2.0
"""The scanner's systematic error, from surfaces seen twice: known errors in a known room."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from slam.frames import Float, Frame
from slam.frontend.range_error import KNOT_M, RangeCorrection, RangeError, hats
from tests import world2d

DRIVE_S = 32.0


@cache
def exact() -> tuple[Frame, ...]:
    """A drive in circles through a room, ranges without any error."""
    world = world2d.World2D(world2d.arena())
    drive = world2d.wander(DRIVE_S)
    return tuple(world2d.frames(world, drive, rate_hz=4.7, noise_m=0.0))


def learnt(error: Callable[[Float], Float], pose_m: float = 0.0) -> RangeCorrection:
    """What is learnt from that drive with an error of range, 10 mm of noise, codes of 1 cm.

    ``pose_m``: deviation of the poses at which the scans are said to be taken.
    """
    rng = np.random.default_rng(7)
    correction = RangeCorrection(0.010)
    for frame in exact():
        assert frame.scan is not None
        assert frame.truth is not None
        ranges = frame.scan.ranges.astype(np.float64)
        noisy = ranges + error(ranges) + rng.normal(0.0, 0.010, len(ranges))
        coded = np.maximum(np.round(noisy / 0.01) * 0.01, 0.0).astype(np.float32)
        reported = replace(frame, scan=replace(frame.scan, ranges=coded))
        pose = frame.truth + rng.normal(0.0, 1.0, 3) * [pose_m, pose_m, 0.3 * pose_m]
        twist = np.asarray(frame.odometry.twist)
        correction.learn(reported, twist, pose, tracked=True)
    return correction


def without_scale(values: Float, ranges: Float, weights: Float) -> Float:
    """Less what is proportional to the range: the scale that nobody can observe."""
    out: Float = values - ranges * (weights @ (values * ranges)) / (weights @ ranges**2)
    return out


def seen_knots(error: RangeError) -> tuple[Float, Float]:
    """(k,) ranges of the knots and how often each was seen, those that were seen well."""
    weights = error.reach / error.reach.sum()
    knots = KNOT_M * np.arange(error.knots)
    return knots[weights > 0.03], weights[weights > 0.03]


def wave(ranges: Float) -> Float:
    """m; 15 mm up and down, once in 4 m, and 8 mm of offset."""
    out: Float = 0.008 + 0.015 * np.sin(math.tau * ranges / 4.0)
    return out


@pytest.mark.parametrize("pose_m", [0.0, 0.01])
def test_a_known_error_is_recovered_but_for_its_scale(pose_m: float) -> None:
    correction = learnt(wave, pose_m)
    ranges, weights = seen_knots(correction.error)
    true = without_scale(wave(ranges), ranges, weights)
    off = without_scale(correction.error.at(ranges), ranges, weights) - true
    before = math.sqrt(weights @ true**2)
    assert correction.error.found
    assert math.sqrt(weights @ off**2) < 0.3 * before


def test_a_scanner_with_noise_only_is_left_alone() -> None:
    correction = learnt(np.zeros_like)
    error = correction.error
    ranges, weights = seen_knots(error)
    assert not correction.error.found
    assert error.odds < 0.0
    assert math.sqrt(weights @ error.at(ranges) ** 2) < 0.002
    assert (np.abs(error.at(ranges)) < 3.0 * error.sigma_m(ranges)).all()
    frame = exact()[0]
    assert correction.seen(frame) is frame


def test_the_scale_stays_zero() -> None:
    """An error in proportion to the range is a larger room: nothing is learnt from it."""
    correction = learnt(lambda ranges: 0.01 * ranges)
    error = correction.error
    knots = KNOT_M * np.arange(error.knots)
    scale = error.reach @ (error.coefficients[:-1] * knots) / (error.reach @ knots**2)
    assert abs(scale) < 1e-6
    ranges, weights = seen_knots(error)
    assert math.sqrt(weights @ error.at(ranges) ** 2) < 0.003


def test_what_is_learnt_is_taken_off_the_valid_ranges() -> None:
    correction = learnt(wave)
    frame = exact()[3]
    assert frame.scan is not None
    holes = frame.scan.ranges.copy()
    holes[:3] = [np.nan, np.inf, 0.0]
    seen = correction.seen(replace(frame, scan=replace(frame.scan, ranges=holes))).scan
    assert seen is not None
    assert np.array_equal(seen.ranges[:3], holes[:3], equal_nan=True)
    off = frame.scan.ranges[3:] - correction.error.at(frame.scan.ranges[3:].astype(np.float64))
    assert np.allclose(seen.ranges[3:], off, atol=1e-6)


def test_hats_share_every_range_among_its_knots() -> None:
    shares = hats(np.array([0.0, 0.3, 0.75, 14.9, 99.0]), 21, 0.75)
    assert np.allclose(shares.sum(axis=1), 1.0)
    assert shares[1, 0] == pytest.approx(0.6)
    assert shares[-1, -1] == 1.0


def test_after_a_jump_nothing_is_compared_with_before() -> None:
    correction = learnt(np.zeros_like)
    seen_before = correction.error.reach.sum()
    frame = exact()[-1]
    twist = np.zeros(3)
    correction.learn(frame, twist, np.zeros(3), tracked=False)
    correction.learn(frame, twist, np.array([3.0, 0.0, 0.0]), tracked=True)
    assert correction.error.reach.sum() <= seen_before  # they only fade
