# SPDX-License-Identifier: Apache-2.0
"""The fit finds how odometry errs, and draws errors of the same size."""

from __future__ import annotations

import numpy as np
import pytest

from sim.sensors.odometry.fit import fitted
from slam import se2
from slam.errors import InvalidValueError


def _way(n: int) -> np.ndarray:
    rng, out = np.random.default_rng(3), np.zeros((n, 3))
    for k in range(1, n):
        step = np.array([rng.uniform(0.2, 1.0), 0.0, rng.normal(0.0, 0.3)])
        out[k] = se2.compose(out[k - 1], step)
    return out


def _wheels(true: np.ndarray, sigma: float, seed: int) -> np.ndarray:
    rng, out = np.random.default_rng(seed), np.zeros_like(true)
    for k in range(1, len(true)):
        step = se2.between(true[k - 1], true[k])
        metres = np.hypot(step[0], step[1])
        step[0] += 0.03 * metres + sigma * np.sqrt(metres) * rng.normal()
        step[2] += -0.05 * metres + 0.02 * np.sqrt(metres) * rng.normal()
        out[k] = se2.compose(out[k - 1], step)
    return out


def test_slopes_and_spread_are_found_and_drawn_again() -> None:
    true = _way(2000)
    fit = fitted(_wheels(true, 0.04, 5), true)
    assert fit.scale == pytest.approx(0.03, abs=0.004)
    assert fit.turn_per_m == pytest.approx(-0.05, abs=0.002)
    assert fit.words()["m per sqrt m"] == pytest.approx(0.04, rel=0.2)
    again = fitted(fit.drawn(true, np.random.default_rng(1)), true)
    assert again.words()["m per sqrt m"] == pytest.approx(fit.words()["m per sqrt m"], rel=0.2)
    assert again.turn_per_m == pytest.approx(fit.turn_per_m, abs=0.003)


def test_too_short_a_log_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="more than 10"):
        fitted(_way(5), _way(5))
