# SPDX-License-Identifier: Apache-2.0
"""The UMBmark squares: they close, and give the systematic errors back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from scripts.experiments.umbmark import TRACK, measure_unit, square
from sim.sensors.odometry.encoders import OdometryConfig


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_robot_without_errors_comes_back(way: float) -> None:
    rims = square(way)[-1]
    assert (rims[1] - rims[0]) / TRACK == pytest.approx(way * math.tau)
    np.testing.assert_allclose(measure_unit("ideal", 0, runs=1).ends, 0.0, atol=1e-9)


@pytest.mark.parametrize(("track_std", "ratio_std"), [(0.005, 0.0), (0.0, 0.003)])
def test_the_formulas_give_the_systematic_errors_back(track_std: float, ratio_std: float) -> None:
    """Borenstein and Feng's are of first order: good to a tenth of the error."""
    systematic = replace(OdometryConfig(), diameter_ratio_std=ratio_std, track_std=track_std)
    for seed in range(5):
        unit = measure_unit(systematic, seed, runs=1)
        _, track, ratio = unit.errors
        eb, ed = unit.estimate
        if track_std > 0.0:
            assert eb - 1.0 == pytest.approx(track - 1.0, rel=0.1)
        else:
            assert ed - 1.0 == pytest.approx(ratio - 1.0, rel=0.1)


def test_the_clouds_of_a_pioneer_lie_off_zero_and_its_centres_apart() -> None:
    units = [measure_unit("pioneer3dx", seed) for seed in range(3)]
    assert max(unit.worst for unit in units) > 0.2
    assert all(unit.ends.shape == (2, 5, 2) for unit in units)
