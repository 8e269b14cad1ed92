# SPDX-License-Identifier: Apache-2.0
"""The world of points: what its stream says is what its truth and noise are."""

import math

import numpy as np
import pytest

from slam import se2
from slam.evaluation.points import PointWorld, PointWorldConfig


def test_noise_is_the_one_configured():
    world = PointWorld(PointWorldConfig(n_steps=600), seed=3)
    motions, bearings, ranges, before = [], [], [], None
    for k, frame in enumerate(world.stream()):
        if before is not None:
            true = se2.between(world.path[k - 1], world.path[k])
            told = se2.between(before.T_odom_robot, frame.odometry.T_odom_robot)
            motions.append(np.append(math.hypot(*(told - true)[:2]), (told - true)[2]))
        before = frame.odometry
        seen = frame.features
        expected = se2.transform(se2.inverse(world.path[k]), world.points[k][seen.ids])
        ranges.append(np.hypot(*seen.points_robot.T) - np.hypot(*expected.T))
        turned = np.arctan2(*seen.points_robot.T[::-1]) - np.arctan2(*expected.T[::-1])
        bearings.append(turned)
    squares = np.mean(np.square(motions), axis=0)
    np.testing.assert_allclose(np.sqrt(squares), [0.1, 0.03], rtol=0.1)
    np.testing.assert_allclose(np.concatenate(ranges).std(), 0.001, rtol=0.05)
    np.testing.assert_allclose(np.concatenate(bearings).std(), 0.001, rtol=0.05)


def test_only_the_moving_share_moves_and_stays_inside():
    world = PointWorld(PointWorldConfig(moving=0.3, n_steps=100), seed=1)
    steps = np.diff(world.points, axis=0)
    moved = np.any(steps != 0.0, axis=(0, 2))
    np.testing.assert_array_equal(moved, world.moving)
    assert world.moving.mean() == pytest.approx(0.3)
    assert np.abs(world.points).max() <= 22.0
    assert np.hypot(steps[..., 0], steps[..., 1]).max() <= 0.6 + 1e-12


def test_the_loop_closes_and_steps_are_equal():
    config = PointWorldConfig()
    path = PointWorld(config, seed=0).path
    around = path[1:, :2] - path[:-1, :2]
    lengths = np.hypot(around[:, 0], around[:, 1])
    assert lengths.max() <= 0.5 + 1e-9
    assert lengths.min() > 0.499
    length = 4 * 13.2 + 2 * math.pi * 6.6
    assert np.hypot(*(path[round(length / 0.5), :2] - path[0, :2])) < 0.3
