# SPDX-License-Identifier: Apache-2.0
"""A carried robot and a pushed SLAM, on streams made by hand."""

import math

import numpy as np
import pytest

from scripts.integrity import kidnap
from slam import se2
from slam.frames import Frame
from tests.world2d import Drive, World2D, arena, frames, laser


@pytest.fixture(scope="module")
def stream() -> list[Frame]:
    drive = Drive((1.0, 0.5, 0.3), ((0.4, 0.8, 8.0),))
    return frames(World2D(arena()), drive, rate_hz=10.0, spec=laser(61), seed=4)


def test_a_kidnap_is_far_near_the_map_and_unknown_to_the_odometry(stream):
    end = stream[-1].truth
    starts = list(kidnap.targets(stream, stream, 5, 3))
    assert len(starts) == 3
    for start in starts:
        jump = stream[start].truth - end
        assert math.hypot(*jump[:2]) >= kidnap.FAR_M or abs(se2.wrap(jump[2])) >= kidnap.FAR_RAD
    moved = list(kidnap.kidnapped(stream, stream, starts[0], 5))
    assert len(moved) == 5
    before = stream[-1]
    for k, frame in enumerate(moved):
        told = se2.between(before.odometry.T_odom_robot, frame.odometry.T_odom_robot)
        ago, here = stream[starts[0] + k - 1], stream[starts[0] + k]
        said = se2.between(ago.odometry.T_odom_robot, here.odometry.T_odom_robot)
        np.testing.assert_allclose(told, said, atol=1e-12)
        assert frame.stamp_ns - before.stamp_ns == 100_000_000
        np.testing.assert_array_equal(frame.truth, here.truth)
        before = frame


def test_a_push_is_as_far_as_it_says():
    far, turned = (kidnap.push(kind, np.random.default_rng(0)) for kind in kidnap.KINDS)
    assert np.hypot(*far[:2]) == pytest.approx(kidnap.PUSH_M)
    assert abs(np.degrees(turned[2])) == pytest.approx(kidnap.PUSH_DEG)
