# SPDX-License-Identifier: Apache-2.0
"""The EKF's compiled arithmetic against the same written with NumPy."""

import numpy as np
import pytest

from slam import se2
from slam.landmarks import kernels
from slam.landmarks.association import distances
from slam.landmarks.filter import EkfFilter


def looked_around(n: int, seed: int = 0, std: float = 0.05) -> EkfFilter:
    """A filter with n landmarks, everything correlated."""
    rng = np.random.default_rng(seed)
    ekf = EkfFilter()
    for _ in range(3):
        ekf.predict([0.5, 0.1, 0.3], np.diag([std**2, std**2, 0.02**2]))
    ekf.add(rng.uniform(-6.0, 6.0, (n, 2)), np.tile(np.eye(2) * 0.03**2, (n, 1, 1)))
    ekf.predict([0.4, 0.0, -0.2], np.diag([std**2, std**2, 0.03**2]))
    return ekf


def seen(ekf: EkfFilter, chosen: np.ndarray, std: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (m, 2) off by ``std`` and their covariances."""
    points = se2.transform(se2.inverse(ekf.pose), ekf.landmarks[chosen])
    points += np.random.default_rng(9).normal(0.0, std, points.shape)
    return points, np.tile(np.array([[2.0, 0.3], [0.3, 1.0]]) * std**2, (len(chosen), 1, 1))


@pytest.mark.parametrize("size", range(1, 10))
@pytest.mark.parametrize("terms", [4, 12])
def test_products_are_subtracted_and_mirrored_within_the_size_only(size, terms):
    rng = np.random.default_rng(size)
    A, root = rng.normal(size=(terms, size)), rng.normal(size=(terms, terms))
    B = (root + root.T) @ A  # so that A'B is symmetric
    P = rng.normal(size=(size + 3, size + 3))
    P = P + P.T
    got = P.copy()
    kernels.subtract_products(got, size, A, B)
    np.testing.assert_allclose(got[:size, :size], P[:size, :size] - A.T @ B, atol=1e-12)
    np.testing.assert_array_equal(got[:size, :size], got[:size, :size].T)
    np.testing.assert_array_equal(got[size:], P[size:])
    np.testing.assert_array_equal(got[:, size:], P[:, size:])


@pytest.mark.parametrize("size", [1, 2, 5, 8, 11])
def test_linear_equations_are_solved(size):
    rng = np.random.default_rng(size)
    root, b = rng.normal(size=(size, size)), rng.normal(size=(size, 7))
    S = root @ root.T + np.eye(size)
    L, x = S.copy(), b.copy()
    assert kernels.cholesky(L)
    kernels.solve(L, x)
    np.testing.assert_allclose(S @ x, b, atol=1e-12)


@pytest.mark.slow
def test_a_thousand_precise_updates_of_a_vague_state_leave_it_positive():
    """1 mm seen from a pose that was lost by 10 m, again and again."""
    ekf = looked_around(15, std=10.0)
    chosen = np.arange(15)
    for k in range(1000):
        some = chosen[k % 5 :: 5]
        z, R = seen(ekf, some, 0.001)
        ekf.update(some, z, R)
    values = np.linalg.eigvalsh(ekf.error_covariance)
    assert values.min() > -1e-12 * values.max()
    assert np.diag(ekf.error_covariance).min() > 0.0


def test_a_single_pair_costs_what_the_joint_update_says():
    ekf = looked_around(6)
    z, R = seen(ekf, np.arange(6), 0.02)
    wanted = np.ones((6, 6), dtype=np.bool_)
    wanted[2] = False
    P = ekf.error_covariance.copy()
    costs = distances(ekf.pose, ekf.landmarks, P, z, R, wanted, 1e4, 1e4)
    for k in range(6):
        for j in range(6):
            one = np.array([j])
            cost = kernels.linearise(ekf.pose, ekf.landmarks, P, one, z[[k]], R[[k]])[3]
            if not wanted[k, j] or cost > 1e4:
                assert costs[k, j] == np.inf
            else:
                assert costs[k, j] == pytest.approx(cost, rel=1e-9)
    assert np.isfinite(costs).sum() > 5
