# SPDX-License-Identifier: Apache-2.0
"""The input I of Eq. (8): Gaussians of analytic peak 1, combined by the largest."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slam import se2
from slam.frames import Features
from slam.frontend.observations import Observations, from_features
from slam.shunting.slam import ShuntingConfig
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise

Array = NDArray[np.float64]
CELL, N = 0.1, 20  # the field of N x N neurons from the origin on
CONFIG = ShuntingConfig(cell_m=CELL, decay_per_s=1.0, trace_s=0.0, threshold=1e-6)
CENTRES = (np.arange(N) + 0.5) * CELL


def seen(points: Array, covariance: Array) -> Observations:
    covariances = np.tile(covariance, (len(points), 1, 1))
    return from_features(Features(stamp_ns=0, points_robot=points, covariances=covariances), CONFIG)


def inspired(observations: Observations, pose: Array) -> Array:
    """(N, N) I, found from the activities after a step of 1 s in an empty network: x = I / (1 + A +
    I), so I = (1 + A) x / (1 - x)."""
    network = Network(CONFIG)
    rasterise(network, observations, pose)
    network.integrate(observations.view, pose, 1.0, write=True)
    x, _ = network.window(CENTRES[0], CENTRES[0], CENTRES[-1], CENTRES[-1])
    wide = x.astype(np.float64)
    return 2.0 * wide / (1.0 - wide)


def gaussian(point: Array, covariance: Array) -> Array:
    """exp(-d^2 / 2) at the neurons' centres, with the width that the lattice needs added."""
    whole = covariance + (CONFIG.frontend.sigma_cells * CELL) ** 2 * np.eye(2)
    dx, dy = np.meshgrid(CENTRES - point[0], CENTRES - point[1])
    away = np.stack([dx, dy], axis=-1)
    return np.exp(-0.5 * np.einsum("rci,ij,rcj->rc", away, np.linalg.inv(whole), away))


@pytest.mark.parametrize("phase", [0.0, 0.2, 0.5, 0.9])
def test_a_point_gives_a_gaussian_of_analytic_peak_1(phase: float) -> None:
    """Wherever it lies between neurons: between four of them none is given 1."""
    point = np.array([1.05 + phase * CELL, 0.95 + 0.5 * phase * CELL])
    covariance = np.array([[0.02, 0.006], [0.006, 0.01]])
    got, expected = (
        inspired(seen(point[None], covariance), np.zeros(3)),
        gaussian(point, covariance),
    )
    well = expected > 0.01
    np.testing.assert_allclose(got[well], expected[well], atol=2e-3)
    assert got.max() <= 1.0 + 1e-6
    narrow = inspired(seen(point[None], np.zeros((2, 2))), np.zeros(3))
    np.testing.assert_allclose(narrow.max(), gaussian(point, np.zeros((2, 2))).max(), atol=2e-3)
    if phase == 0.5:
        assert narrow.max() < 0.85


def test_inputs_are_combined_by_the_largest() -> None:
    """Not by their sum: a wall seen by many beams gives no more than one seen by few."""
    points = np.array([[0.8, 1.0], [1.0, 1.05], [1.02, 1.06], [1.02, 1.06]])
    covariance = 0.01 * np.eye(2)
    both = inspired(seen(points, covariance), np.zeros(3))
    alone = [inspired(seen(point[None], covariance), np.zeros(3)) for point in points]
    np.testing.assert_allclose(both, np.max(alone, axis=0), atol=1e-6)
    assert np.sum(alone, axis=0).max() > 1.5


def test_covariances_turn_with_the_robot() -> None:
    pose = np.array([0.4, 0.1, 0.7])
    point, covariance = np.array([0.9, 0.4]), np.diag([0.03, 0.001])
    c, s = math.cos(0.7), math.sin(0.7)
    R = np.array([[c, -s], [s, c]])
    got = inspired(seen(point[None], covariance), pose)
    expected = gaussian(se2.transform(pose, point), R @ covariance @ R.T)
    well = expected > 0.01
    np.testing.assert_allclose(got[well], expected[well], atol=2e-3)
