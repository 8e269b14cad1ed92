# SPDX-License-Identifier: Apache-2.0
"""The helpers of a guest's author: a scan as points, moved and unmoved."""

from dataclasses import replace

import numpy as np
import pytest

from slam import Features, Frame, LaserSpec, Odometry, Scan, deskewed, points_robot
from slam.errors import InvalidValueError
from slam.frontend.observations import from_scan
from slam.guests.guest import _GRAIN

SPEC = LaserSpec(
    n_beams=4, angle_min=0.0, angle_increment=np.pi / 2, range_max=10.0,
    beam_time_offsets=np.array([0.0, 0.1, 0.2, 0.3]), T_robot_laser=np.array([1.0, 0.0, np.pi / 2]),
)  # fmt: skip


def frame(twist: tuple[float, ...] | None = None, spec: LaserSpec = SPEC) -> Frame:
    scan = Scan(stamp_ns=5, ranges=np.array([2.0, np.inf, 3.0, np.nan], np.float32), spec=spec)
    moving = None if twist is None else np.array(twist)
    return Frame(
        stamp_ns=5, scan=scan, odometry=Odometry(stamp_ns=5, T_odom_robot=np.zeros(3), twist=moving)
    )


def test_points_are_the_valid_beams_on_the_robot():
    np.testing.assert_allclose(points_robot(frame((1.0, 0, 0))), [[1, 2], [1, -3]], atol=1e-12)


def test_the_motion_of_the_sweep_is_taken_out():
    moving = frame((1.0, 0.0, 0.0))
    np.testing.assert_allclose(deskewed(moving), [[1, 2], [1.2, -3]], atol=1e-12)
    turning = deskewed(moving, np.array([0.0, 0.0, 0.5]))
    c, s = np.cos(0.1), np.sin(0.1)
    np.testing.assert_allclose(turning, [[1, 2], [c + 3 * s, s - 3 * c]], atol=1e-12)


def test_without_a_twist_nothing_is_moved():
    np.testing.assert_array_equal(deskewed(frame()), points_robot(frame()))


def test_guests_of_ours_get_the_same_points():
    moving = frame((0.7, 0.0, -0.4), replace(SPEC, angle_increment=np.pi / 4))
    ours = from_scan(moving.scan, moving.odometry.twist, _GRAIN).points_robot
    np.testing.assert_array_equal(deskewed(moving), ours)


def test_what_has_no_points_is_refused():
    found = Features(stamp_ns=5, points_robot=np.zeros((0, 2)), covariances=np.zeros((0, 2, 2)))
    seen = Frame(stamp_ns=5, odometry=frame().odometry, features=found)
    with pytest.raises(InvalidValueError, match="has no scan"):
        points_robot(seen)
    with pytest.raises(InvalidValueError, match="twist must be three finite numbers"):
        deskewed(frame(), np.zeros(2))
