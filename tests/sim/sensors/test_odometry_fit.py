# SPDX-License-Identifier: Apache-2.0
"""The fit finds how odometry errs, and draws errors of the same size."""

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
    assert fit.words()["m per sqrt m"] == pytest.approx(
        0.04 / np.sqrt(2.0), rel=0.2
    )  # x alone errs
    again = fitted(fit.drawn(true, np.random.default_rng(1)), true)
    assert again.words()["m per sqrt m"] == pytest.approx(fit.words()["m per sqrt m"], rel=0.2)
    assert again.turn_per_m == pytest.approx(fit.turn_per_m, abs=0.003)


def test_what_the_reference_jitters_is_no_drift_of_the_wheels() -> None:
    true, sigma = _way(2000), (0.05, 0.05, 0.04)
    jitter = np.random.default_rng(2).normal(0.0, sigma, (2000, 3))
    reference = np.array([se2.compose(a, b) for a, b in zip(true, jitter, strict=True)])
    fit = fitted(_wheels(true, 0.01, 5), reference).words()
    assert fit["rad per m"] == pytest.approx(-0.05, abs=0.002)
    assert fit["rad of the reference"] == pytest.approx(0.04 * np.sqrt(2.0), rel=0.1)
    drift = fit["rad per sqrt m"] ** 2 * 0.6 + fit["rad per sqrt rad"] ** 2 * 0.24  # of a mean step
    assert drift == pytest.approx(0.02**2 * 0.6, rel=0.5)


def test_backwards_the_distance_counts_the_other_way() -> None:
    true = _way(600)
    turned = np.array([se2.compose(pose, [0.0, 0.0, np.pi]) for pose in true])  # looking back
    wheels = np.zeros_like(turned)
    for k in range(1, len(turned)):
        step = se2.between(turned[k - 1], turned[k])
        error = [0.03 * step[0], 0.02 * step[0], -0.05 * step[0]]
        wheels[k] = se2.compose(wheels[k - 1], step + error)
    fit = fitted(wheels, turned)
    found = (fit.scale, fit.side, fit.turn_per_m, fit.turn_scale)
    assert found == pytest.approx((0.03, 0.02, -0.05, 0.0), abs=1e-6)


def test_too_short_a_log_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="more than 10"):
        fitted(_way(5), _way(5))
