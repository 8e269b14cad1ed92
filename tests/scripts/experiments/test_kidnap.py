# SPDX-License-Identifier: Apache-2.0
"""What the table of kidnaps counts, on streams made by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from scripts.experiments import kidnap
from slam import Estimate, Raster, Trajectory, se2
from slam.frames import Frame
from slam.frontend.odometry_steps import thinned
from tests.world2d import Drive, World2D, arena, frames, laser


@pytest.fixture(scope="module")
def stream() -> list[Frame]:
    drive = Drive((1.0, 0.5, 0.3), ((0.4, 0.8, 8.0),))
    return frames(World2D(arena()), drive, rate_hz=10.0, spec=laser(61), seed=4)


def test_thinned_frames_state_the_covariance_of_all_the_motion_between_them(stream):
    thin = thinned(stream, 4)
    assert [f.stamp_ns for f in thin] == [f.stamp_ns for f in stream[::4]]
    parts = [f.odometry.increment_covariance for f in stream]
    np.testing.assert_array_equal(thin[2].odometry.increment_covariance, np.sum(parts[5:9], axis=0))
    bare = [replace(f, odometry=replace(f.odometry, increment_covariance=None)) for f in stream]
    assert thinned(bare, 4)[2].odometry.increment_covariance is None
    assert [f.scan for f in thinned(stream, 1)] == [f.scan for f in stream]


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


class Told:
    """Says of each frame whether it trusts itself, and how far along x it is."""

    def __init__(self, *words: tuple[bool, float]) -> None:
        self.words = list(words)

    def reset(self) -> None: ...

    def update(self, frame: Frame) -> Estimate:
        trusted, off = self.words.pop(0)
        return Estimate(
            stamp_ns=frame.stamp_ns,
            T_map_robot=np.array([off, 0.0, 0.0]),
            covariance=np.eye(3),
            converged=trusted,
        )

    def map(self) -> Raster | None:
        return None

    def trajectory(self) -> Trajectory:
        raise NotImplementedError


@pytest.mark.parametrize(
    ("words", "detected", "recovered_s", "right", "wrong"),
    [
        ([(True, 5.0), (False, 5.0), (False, 5.0), (True, 0.1)], 2, 0.3, True, False),
        ([(False, 5.0), (True, 5.0), (False, 5.0), (True, 0.1)], 1, 0.1, True, True),
        ([(False, 5.0)] * 4, 1, None, False, False),
        ([(True, 5.0)] * 4, None, None, False, True),
    ],
)
def test_what_a_kidnap_counts(stream, words, detected, recovered_s, right, wrong):
    still = [replace(f, truth=np.zeros(3)) for f in stream[:4]]
    outcome = kidnap.follow(Told(*words), still, np.zeros(3), 3.0, 1)
    assert (outcome.detected, outcome.right, outcome.wrong) == (detected, right, wrong)
    assert outcome.recovered_s == (None if recovered_s is None else pytest.approx(recovered_s))
