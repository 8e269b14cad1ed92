# SPDX-License-Identifier: Apache-2.0
"""Relations: the mean error of motions between times, by time and by the lines of the log."""

import math

import numpy as np
import pytest

from scripts.experiments import relations
from slam import se2

pytestmark = pytest.mark.slow
POSES = np.array([se2.exp([1.0, 0.0, 0.1], t) for t in range(10)])
TIMES = np.arange(10.0)


def test_right_poses_have_no_error_and_a_slip_counts_once():
    at = relations.by_time(TIMES, POSES)
    ends = [(100.5, 102.75), (102.0, 108.0), (104.5, 106.0), (120.0, 121.0)]
    known = [(a, b, se2.exp([1.0, 0.0, 0.1], b - a)) for a, b in ends]
    assert relations.error_m(known, 100.0, at) == pytest.approx(0.0, abs=1e-9)
    slipped = POSES.copy()
    slipped[4:] = [se2.compose([0.3, 0.4, 0.0], pose) for pose in POSES[4:]]
    off = relations.error_m(known, 100.0, relations.by_time(TIMES, slipped))
    assert off == pytest.approx(0.5 / 3.0)  # only the second sees it, of three in the log
    assert math.isnan(relations.error_m(known, 0.0, at))


def test_gaps_have_no_pose_and_the_order_of_time_is_any():
    at = relations.by_time(np.array([5.0, 1.0, 0.0]), POSES[[5, 1, 0]])
    assert at(3.0) is None
    assert at(0.5) == pytest.approx(se2.exp([1.0, 0.0, 0.1], 0.5))


def test_between_scans_of_a_sparse_log_odometry_counts():
    corrected = [[0.0, 0.0, 0.0], [2.0, 0.0, 1.0]]
    since = se2.compose(corrected[1], [0.5, 0.0, 0.0])
    word = "{} {:.6f} {:.6f} {:.6f} 0 0 0 {} h 0"
    scan = "FLASER 2 1.0 1.0"
    log = [word.format(scan, *corrected[0], 1), "NEFF 1", word.format(scan, *corrected[1], 9)]
    log.append(word.format("ODOM", *since, 10))
    estimate = np.array([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0]])
    at = relations.by_odometry(log, np.array(corrected), estimate)
    assert at(10.2) == pytest.approx([7.5, 0.0, 0.0], abs=1e-5)
    assert at(1.0) == pytest.approx([0.0, 0.0, 0.0])
    assert at(5.0) is None
