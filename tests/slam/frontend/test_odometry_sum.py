# SPDX-License-Identifier: Apache-2.0
"""The covariance of the motion between the frames that a listener gets."""

from __future__ import annotations

import numpy as np
import pytest

from slam.frames import Features, Frame, Odometry
from slam.frontend.odometry_steps import MotionSum

STATED = np.diag([1e-4, 2e-4, 3e-4])


def frame(k: int, covariance: np.ndarray | None) -> Frame:
    odometry = Odometry(stamp_ns=k, T_odom_robot=np.zeros(3), increment_covariance=covariance)
    seen = Features(stamp_ns=k, points_robot=np.ones((1, 2)), covariances=np.eye(2)[None])
    return Frame(stamp_ns=k, odometry=odometry, features=seen)


def passed(parts: list[np.ndarray | None], every: int) -> list[np.ndarray | None]:
    motion, out = MotionSum(), []
    for k, part in enumerate(parts):
        motion.add(frame(k, part).odometry)
        if k % every == 0:
            out.append(motion.passed_on(frame(k, part)).odometry.increment_covariance)
    return out


@pytest.mark.parametrize("first", [None, np.zeros((3, 3))])
def test_all_motion_since_the_last_frame_counts(first):
    got = passed([first, *[STATED] * 6], every=3)
    assert (got[0] is None) == (first is None)
    np.testing.assert_allclose(got[1:], [3.0 * STATED] * 2)


@pytest.mark.parametrize("at", [2, 3, 4])
def test_a_step_that_states_nothing_is_not_read_as_exact(at):
    parts = [np.zeros((3, 3)), *[STATED] * 9]
    parts[at] = None
    got = passed(parts, every=3)
    silent = -(-at // 3)
    assert [covariance is None for covariance in got] == [k == silent for k in range(4)]


def test_a_stream_without_covariances_stays_one():
    assert passed([None] * 7, every=2) == [None] * 4
