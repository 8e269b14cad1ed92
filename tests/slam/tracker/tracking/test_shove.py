# SPDX-License-Identifier: Apache-2.0
"""A shove is undone where what stands says so, also in a crowd, and a crowd alone is none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.frontend.observations import Observations, from_scan
from slam.frontend.odometry_prior import Prediction, inverted
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.tracking.shove import best_around, is_denied
from tests.slam.tracker.matching.test_matcher import CONFIG, room_scan
from tests.slam.tracker.standing.test_rival import ROOM

Array = NDArray[np.float64]
LIMITS = CONFIG.tracking.relocalise
PRIOR = np.diag([0.01**2, 0.01**2, 0.005**2])
MATCHER = Matcher(CONFIG)


def seen(*, hidden: float) -> Observations:
    """From the origin; so large a share of the beams ends at people who came near."""
    scan = room_scan(np.zeros(3))
    ranges = scan.ranges.copy()
    ranges[: int(hidden * len(ranges))] = 0.7
    return from_scan(replace(scan, ranges=ranges), np.zeros(3), CONFIG)


def asked(believed: Array, observations: Observations) -> tuple[Match, Match | None, bool]:
    """The match at the believed pose, the best place around, and whether that denies it."""
    prediction = Prediction(
        T_map_robot=believed, increment=np.zeros(3), covariance=PRIOR, twist=np.zeros(3),
        elapsed=0.5,
    )  # fmt: skip
    here = MATCHER.climb(ROOM, observations, believed, believed, inverted(PRIOR))
    there = best_around(ROOM, MATCHER, observations, prediction)
    denied = there is not None and is_denied(ROOM, LIMITS, observations, here, there, 0.95)
    return here, there, denied


@pytest.mark.parametrize("hidden", [0.0, 0.25])
@pytest.mark.parametrize("turn_deg", [-50.0, 12.0, 31.0])
def test_a_shove_is_undone_among_people_who_hide_a_part(hidden: float, turn_deg: float) -> None:
    believed = np.array([0.25, -0.2, math.radians(turn_deg)])
    _, there, denied = asked(believed, seen(hidden=hidden))
    assert denied
    assert there is not None
    np.testing.assert_allclose(there.T_map_robot, 0.0, atol=0.05)


@pytest.mark.parametrize("hidden", [0.0, 0.25, 0.6])
def test_people_alone_are_no_shove(hidden: float) -> None:
    _, _, denied = asked(np.array([0.01, 0.0, 0.004]), seen(hidden=hidden))
    assert not denied


def test_too_little_in_view_decides_nothing() -> None:
    observations = seen(hidden=0.0)
    few = replace(observations, weights=observations.weights * 0.01)
    _, there, denied = asked(np.array([0.0, 0.0, 0.5]), few)
    assert there is None
    assert not denied
