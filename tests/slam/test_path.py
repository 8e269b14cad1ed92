# SPDX-License-Identifier: Apache-2.0
"""The path: in order, kept as it was reported."""

from __future__ import annotations

import numpy as np
import pytest

from slam.errors import InvalidValueError
from slam.path import PosePath


def test_poses_stay_as_they_were_reported():
    path, pose = PosePath(), np.array([1.0, 2.0, 0.5])
    path.add(10, pose)
    pose += 1.0
    path.add(20, pose)
    whole = path.trajectory()
    np.testing.assert_array_equal(whole.stamps_ns, [10, 20])
    np.testing.assert_array_equal(whole.poses, [[1.0, 2.0, 0.5], [2.0, 3.0, 1.5]])
    corrected = path.trajectory(np.zeros((2, 3)))
    np.testing.assert_array_equal(corrected.stamps_ns, whole.stamps_ns)
    np.testing.assert_array_equal(corrected.poses, 0.0)


@pytest.mark.parametrize("stamp_ns", [20, 19])
def test_a_frame_must_come_after_the_last_one(stamp_ns):
    path = PosePath()
    path.check_order(-5)
    path.add(20, np.zeros(3))
    path.check_order(21)
    with pytest.raises(InvalidValueError, match=f"in order: {stamp_ns} ns after 20 ns"):
        path.check_order(stamp_ns)


def test_nothing_is_an_empty_trajectory():
    empty = PosePath()
    assert (len(empty), len(empty.trajectory()), empty.poses().shape) == (0, 0, (0, 3))
