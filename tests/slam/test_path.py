# SPDX-License-Identifier: Apache-2.0
"""The path of a SLAM: as motion led, as it was reported, and as loops correct it."""

from __future__ import annotations

import numpy as np

from slam.path import PosePath


def test_a_lost_robot_is_reported_elsewhere_and_its_motion_is_what_loops_correct():
    path, there = PosePath(), np.array([5.0, 5.0, 1.0])
    path.add(10, np.array([1.0, 0.0, 0.0]))
    path.add(20, np.array([2.0, 0.0, 0.0]), reported=there)
    there[:] = np.nan  # its poses are its own
    assert path.poses().tolist() == [[1, 0, 0], [2, 0, 0]]
    assert path.reported().tolist() == [[1, 0, 0], [5, 5, 1]]
    corrected = path.poses() + np.array([0.0, 1.0, 0.0])
    path.replace(corrected)
    assert path.reported().tolist() == path.poses().tolist() == corrected.tolist()
