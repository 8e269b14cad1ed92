# SPDX-License-Identifier: Apache-2.0
"""The odometry's own turning is learnt where the map tells the heading, and only there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.frontend.odometry_prior import HeadingBias

SAID = math.radians(0.3)  # per step, by odometry
WELL = np.diag([1e4, 1e4, 1e6])


def drive(
    bias: HeadingBias, per_m: float, per_rad: float, information: NDArray[np.float64], noise: float
) -> None:
    """300 steps of a robot whose heading the map corrects after each."""
    rng = np.random.default_rng(1)
    error = 0.0  # of the estimated heading
    for k in range(300):
        true = np.array([0.15, 0.0, 0.2 * math.sin(0.05 * k)])
        added = true[2] * per_rad + 0.15 * per_m + float(rng.normal(0.0, noise))
        odometry = true + np.array([0.0, 0.0, added])
        increment = bias.corrected(odometry)
        error += increment[2] - true[2]
        told, given = information[2, 2], SAID**2
        off = -error * told * given / (1.0 + told * given)
        bias.learn(increment, 0.2, (given, given), (1.0, off, information))
        error += off


def test_it_finds_what_the_wheels_add() -> None:
    bias = HeadingBias()
    drive(bias, 0.015, -0.03, WELL, SAID)
    assert bias.per_m == pytest.approx(0.015, abs=0.006)  # 2 sigma
    assert bias.per_rad == pytest.approx(-0.03, abs=0.02)


def test_it_learns_nothing_where_the_map_tells_nothing() -> None:
    bias = HeadingBias()
    drive(bias, 0.015, -0.03, np.diag([1e4, 1e4, 1.0]), SAID)
    assert (bias.per_m, bias.per_rad) == (0.0, 0.0)
    # A heading that a shift aside explains as well is not told either.
    coupled = np.array([[1e4, 0.0, 0.0], [0.0, 1e4, 1e5], [0.0, 1e5, 1e6 + 1.0]])
    drive(bias, 0.015, -0.03, coupled, SAID)
    assert (bias.per_m, bias.per_rad) == (0.0, 0.0)


def test_a_wheel_that_slips_teaches_nothing() -> None:
    bias = HeadingBias()
    drive(bias, 0.0, 0.0, WELL, 0.0)
    before = bias.per_m
    bias.learn(np.array([0.15, 0.0, 0.0]), 0.2, (SAID**2, SAID**2), (1.0, 10.0 * SAID, WELL))
    assert bias.per_m == before
