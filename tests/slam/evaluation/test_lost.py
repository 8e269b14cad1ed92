# SPDX-License-Identifier: Apache-2.0
"""Lost is far off for long enough; found again is near for as long."""

from __future__ import annotations

import numpy as np
import pytest

from slam.evaluation.lost import found_again_at, lost_at

SECONDS = np.arange(0.0, 10.0, 0.1)
ZERO = np.zeros(100)


def off(first, last, value):
    return np.where((first <= SECONDS + 1e-9) & (last > SECONDS + 1e-9), value, 0.0)


def test_a_short_slip_is_not_lost_and_a_long_one_is_from_its_start():
    assert lost_at(SECONDS, off(2.0, 2.9, 0.6), ZERO) is None
    assert lost_at(SECONDS, off(2.0, 3.5, 0.6), ZERO) == pytest.approx(2.0)
    assert lost_at(SECONDS, off(2.0, 3.5, 0.4), ZERO) is None


def test_a_wrong_heading_is_lost_too_either_way_round():
    assert lost_at(SECONDS, ZERO, off(1.0, 4.0, -0.4)) == pytest.approx(1.0)
    assert lost_at(SECONDS, ZERO, off(1.0, 4.0, 0.3)) is None


def test_found_again_is_near_for_a_while_after_it_was_lost():
    distances = off(2.0, 5.0, 0.6)
    assert found_again_at(SECONDS, distances, ZERO, 2.0) == pytest.approx(5.0)
    assert found_again_at(SECONDS, distances + 0.3, ZERO, 2.0) is None
