# SPDX-License-Identifier: Apache-2.0
"""Compiled motions are those of ``se2``, to the last bit."""

import math

import numba
import numpy as np

from slam import se2
from slam.frontend.motions import chained, extended, wrapped

ENDS = (0.0, -0.0, math.pi, -math.pi, 3.0 * math.pi, -3.0 * math.pi, math.tau, 1e-300, 1e9, -1e9)


@numba.njit
def _wrapped(angle: float) -> float:
    return wrapped(angle)


def test_angles_are_wrapped_as_python_does() -> None:
    rng = np.random.default_rng(0)
    odd = [math.nextafter(end, away) for end in ENDS for away in (-math.inf, math.inf)]
    drawn = [*rng.uniform(-20.0, 20.0, 2000).tolist(), *rng.normal(0.0, 1e6, 500).tolist()]
    for angle in (*ENDS, *odd, *drawn):
        assert _wrapped(angle).hex() == se2.wrap(angle).hex(), angle


def test_an_increment_and_where_it_leads_are_those_of_se2() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        before, now, at = rng.normal(0.0, 3.0, (3, 3))
        biases = float(rng.normal(0.0, 0.1)), float(rng.normal(0.0, 0.1))
        increment, T_map_robot = np.empty(3), np.empty(3)
        ends = tuple(before.tolist()), tuple(now.tolist())
        chained(*ends, at, biases, increment, T_map_robot)
        x, y, turn = se2.between(before, now).tolist()
        turn = turn * (1.0 - biases[1]) - x * biases[0]
        np.testing.assert_array_equal(increment, [x, y, turn])
        np.testing.assert_array_equal(T_map_robot, se2.compose(at, increment))


def test_a_step_goes_on_with_its_covariance_as_se2_has_it() -> None:
    rng = np.random.default_rng(2)
    for _ in range(300):
        step, motion = rng.normal(0.0, 2.0, (2, 3))
        roots = rng.normal(0.0, 0.3, (2, 3, 3))
        covariance, more = (root @ root.T for root in roots)
        covariance, more = 0.5 * (covariance + covariance.T), 0.5 * (more + more.T)
        wanted = se2.propagate(covariance, step, motion, more), se2.compose(step, motion)
        extended(step, covariance, motion, more)
        np.testing.assert_array_equal(covariance, wanted[0])
        np.testing.assert_array_equal(step, wanted[1])
