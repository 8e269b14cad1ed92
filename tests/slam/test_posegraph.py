# SPDX-License-Identifier: Apache-2.0
"""Pose graphs with a known answer."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slam import se2
from slam.posegraph import Edge, carried, optimise

Array = NDArray[np.float64]
INFORMATION = np.diag([1e4, 1e4, 1e6])


def ring(n: int = 60) -> Array:
    """Twice round a circle of 5 m."""
    angles = 2.0 * math.tau * np.arange(n) / n
    headings = se2.wrap_array(angles + 0.5 * math.pi)
    return np.stack([5.0 * np.cos(angles) - 5.0, 5.0 * np.sin(angles), headings], axis=1)


def chain(truth: Array, bias: Array) -> tuple[Array, list[Edge]]:
    """Dead reckoning with a constant error of each step."""
    poses, edges = [truth[0]], []
    for k in range(1, len(truth)):
        step = se2.between(truth[k - 1], truth[k]) + bias
        poses.append(se2.compose(poses[-1], step))
        edges.append(Edge(a=k - 1, b=k, T_a_b=step, information=0.01 * INFORMATION))
    return np.array(poses), edges


def loops(truth: Array, every: int) -> list[Edge]:
    half = len(truth) // 2
    return [
        Edge(a=k, b=k + half, T_a_b=se2.between(truth[k], truth[k + half]), robust=True,
             information=INFORMATION)
        for k in range(0, half, every)
    ]  # fmt: skip


def worst(poses: Array, truth: Array) -> float:
    return float(np.hypot(*(poses - truth)[:, :2].T).max())


def test_exact_measurements_give_the_exact_poses() -> None:
    truth = ring()
    start, edges = chain(truth, np.zeros(3))
    poses, weights = optimise(start + 0.01, edges)
    np.testing.assert_allclose(
        [se2.between(poses[0], p) for p in poses], [se2.between(truth[0], p) for p in truth],
        atol=1e-5,  # poses have six digits, and yaw carries its last one over 10 m
    )  # fmt: skip
    assert weights.min() == 1.0


def test_loops_take_the_drift_out() -> None:
    truth = ring()
    start, edges = chain(truth, np.array([0.02, 0.0, 0.004]))
    poses, weights = optimise(start, edges + loops(truth, 5))
    assert worst(start, truth) > 1.0
    assert worst(poses, truth) < 0.4 * worst(start, truth)
    assert weights.min() > 0.3


@pytest.mark.parametrize("seed", range(4))
def test_wrong_loops_are_let_go_of(seed: int) -> None:
    truth = ring()
    rng = np.random.default_rng(seed)
    start, edges = chain(truth, np.array([0.005, 0.0, 0.001]))
    right = loops(truth, 3)
    wrong = [
        Edge(a=int(a), b=int(b), T_a_b=rng.uniform(-3.0, 3.0, 3), information=INFORMATION,
             robust=True)
        for a, b in rng.integers(0, len(truth), (3, 2))
        if a != b
    ]  # fmt: skip
    with_them, weights = optimise(start, edges + right + wrong)
    without, _ = optimise(start, edges + right)
    assert worst(with_them, without) < 0.05
    assert weights[-len(wrong) :].max() < 0.05


def test_poses_between_key_poses_move_along() -> None:
    before = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    after = np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 0.0]])
    moved = carried(
        before, after, np.array([0.0, 0.5, 1.0]), np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    )
    np.testing.assert_allclose(moved[:, 1], [0.0, 0.5, 1.0], atol=1e-12)
