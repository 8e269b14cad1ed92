# SPDX-License-Identifier: Apache-2.0
"""When a frame is held against the map: worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from slam.tracker.tracking.config import QualityConfig
from slam.tracker.tracking.quality import TrackingQuality

QUALITY = QualityConfig()

STEP, JUMP = np.array([0.1, 0.0, 0.05]), np.array([0.0, 0.6, 0.0])


def grown(freeze_below: float = 0.35) -> TrackingQuality:
    """After 12.5 s in which 0.8 of each scan matched and 0.9 of the map in view was confirmed."""
    quality = TrackingQuality(freeze_below, QUALITY)
    for _ in range(50):
        quality.learn(0.8, 9.0, 1.0, 0.25)
    return quality


def test_a_young_map_cannot_deny_and_a_grown_one_can():
    assert not TrackingQuality(0.35, QUALITY).suspicious
    assert grown().suspicious
    assert grown().usual_match() == pytest.approx(0.8)
    assert grown().usual_support() == pytest.approx(0.72)
    assert grown().tracked_s == 12.5 > QUALITY.grown_s


def test_only_a_match_far_below_the_usual_raises_the_question():
    assert not grown().arises(0.57)  # 0.71 of the usual match
    assert grown().arises(0.55)
    assert not TrackingQuality(0.35, QUALITY).arises(
        0.36
    )  # nothing is known yet: the usual match is taken to be 1
    assert TrackingQuality(0.35, QUALITY).arises(0.34)


def test_a_third_of_the_map_in_view_denied_raises_doubt_and_a_fifth_keeps_it_up():
    quality = grown()
    assert not quality.denied(0.5, 75.0, 25.0, STEP)
    assert quality.denied(0.5, 69.0, 31.0, STEP)
    quality.count(True)
    assert quality.denied(0.5, 75.0, 25.0, STEP)
    quality.count(False)
    assert not quality.denied(0.5, 75.0, 25.0, STEP)


def test_next_to_nothing_that_matches_is_a_doubt_unless_the_robot_went_far():
    assert grown().denied(0.2, 1.0, 0.0, STEP)
    assert not grown().denied(0.2, 1.0, 0.0, JUMP)


def test_the_paper_s_map_is_never_in_doubt():
    quality = grown(0.0)
    assert not quality.arises(0.0)
    assert not quality.denied(0.0, 0.0, 1.0, STEP)


def test_giving_up_lets_the_map_grow_anew():
    quality = grown()
    quality.give_up()
    assert quality.scans == QUALITY.patience
    assert not quality.suspicious


def test_a_place_found_is_not_denied_by_what_it_was_accepted_with() -> None:
    config = QualityConfig()
    quality = TrackingQuality(0.6, config)
    assert not quality.excuses(1.0)
    quality.relocated(0.8)
    assert quality.excuses(config.excused * 0.8)
    assert not quality.excuses(0.9 * config.excused * 0.8)
    for _ in range(config.remembered):
        quality.excuses(0.8)
    assert not quality.excuses(0.8)
