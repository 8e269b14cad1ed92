# SPDX-License-Identifier: Apache-2.0
"""SE(2): the laws of the group, its exponential, its first-order statistics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam import se2

coordinate = st.floats(-100.0, 100.0)
angle = st.floats(-math.pi, math.pi)
poses = st.tuples(coordinate, coordinate, angle).map(np.array)
small = settings(max_examples=60, deadline=None, derandomize=True, database=None)


def same(a, b, atol=1e-9):
    difference = np.asarray(a) - np.asarray(b)
    difference[..., 2] = se2.wrap_array(difference[..., 2])
    np.testing.assert_allclose(difference, 0.0, atol=atol)


@small
@given(poses, poses, poses)
def test_group_laws(a, b, c):
    same(se2.compose(se2.compose(a, b), c), se2.compose(a, se2.compose(b, c)))
    same(se2.compose(a, se2.IDENTITY), a)
    same(se2.compose(se2.IDENTITY, a), a)
    same(se2.compose(a, se2.inverse(a)), se2.IDENTITY)
    same(se2.compose(se2.inverse(a), a), se2.IDENTITY)
    same(se2.compose(a, se2.between(a, b)), b)


@small
@given(poses, poses)
def test_composition_is_transforming_twice(a, b):
    points = np.array([[0.0, 0.0], [1.0, -2.0], [30.0, 4.0]])
    twice = se2.transform(a, se2.transform(b, points))
    np.testing.assert_allclose(se2.transform(se2.compose(a, b), points), twice, atol=1e-9)


@small
@given(poses)
def test_transform_is_the_rotation_and_the_shift(a):
    points = np.array([[1.5, -0.5]])
    expected = points @ se2.rotation(a[2]).T + a[:2]
    np.testing.assert_allclose(se2.transform(a, points), expected, atol=1e-12)
    np.testing.assert_allclose(se2.transform(a, points[0]), expected[0], atol=1e-12)


@pytest.mark.parametrize("theta", [0.0, 1e-12, -1e-7, 9.9e-7, 1.01e-6, 1e-4, 0.3, -3.0, 3.14159])
def test_log_undoes_exp(theta):
    twist = np.array([2.0, -1.0, theta])
    np.testing.assert_allclose(se2.log(se2.exp(twist)), twist, atol=1e-12)


@pytest.mark.parametrize("theta", [1e-9, 9.99e-7, 1.001e-6, 1e-5, 1e-3])
def test_exp_of_small_turns_keeps_all_digits(theta):
    x, y, _ = se2.exp([0.0, -1.0, theta])
    assert x == pytest.approx(theta / 2.0 - theta**3 / 24.0, rel=1e-13)
    assert y == pytest.approx(-(1.0 - theta**2 / 6.0 + theta**4 / 120.0), rel=1e-14)


def test_exp_is_many_small_steps():
    twist, n = np.array([0.8, -0.3, 1.7]), 20_000
    pose = se2.IDENTITY
    for _ in range(n):
        pose = se2.compose(pose, twist / n)
    same(pose, se2.exp(twist), atol=1e-4)
    same(se2.exp(twist, 2.0), se2.compose(se2.exp(twist), se2.exp(twist)))


@small
@given(poses, poses)
def test_interpolation_begins_and_ends_and_is_steady(a, b):
    same(se2.interpolate(a, b, 0.0), a)
    same(se2.interpolate(a, b, 1.0), b, atol=1e-6)
    halfway = se2.interpolate(a, b, 0.5)
    same(se2.interpolate(a, halfway, 0.5), se2.interpolate(a, b, 0.25), atol=1e-6)


@small
@given(st.floats(-1e4, 1e4))
def test_wrapping(theta):
    wrapped = se2.wrap(theta)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(theta), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(theta), abs=1e-9)
    array = se2.wrap_array([[theta], [-theta]])
    assert array.shape == (2, 1)
    assert math.cos(array[0, 0] - wrapped) == pytest.approx(1.0, abs=1e-9)
    assert np.abs(array).max() <= math.pi + 1e-9


def test_propagated_covariance_matches_sampling():
    rng = np.random.default_rng(7)
    T_a_b, T_b_c = np.array([2.0, -1.0, 2.2]), np.array([1.5, 0.4, -0.7])
    P = np.array([[4.0, 1.0, 0.2], [1.0, 3.0, -0.3], [0.2, -0.3, 1.0]]) * 1e-4
    Q = np.array([[1.0, 0.3, 0.1], [0.3, 2.0, 0.2], [0.1, 0.2, 0.5]]) * 1e-4
    n = 20_000
    a = T_a_b + rng.multivariate_normal(np.zeros(3), P, size=n)
    b = T_b_c + rng.multivariate_normal(np.zeros(3), Q, size=n)
    samples = np.array([se2.compose(x, y) for x, y in zip(a, b, strict=True)])
    sampled = np.cov(samples.T)
    predicted = se2.propagate(P, T_a_b, T_b_c, Q)
    np.testing.assert_allclose(predicted, sampled, atol=0.04 * predicted.max())
    np.testing.assert_array_equal(predicted, predicted.T)
    assert np.abs(predicted - (P + Q)).max() > 0.2 * predicted.max()  # the test would notice
