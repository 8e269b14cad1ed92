# SPDX-License-Identifier: Apache-2.0
"""Trajectories, the TUM files that evo reads, and the path of reported poses."""

import math

import numpy as np
import pytest

from slam import Trajectory
from slam.errors import InvalidValueError, LogFormatError
from slam.path import PosePath
from slam.trajectory import read_tum, write_tum

UNIX_NS = 1_700_000_000_123_456_789


def wavy(n=50, start_ns=UNIX_NS):
    k = np.arange(n)
    poses = np.stack([0.1 * k - 2.0, np.sin(0.2 * k), np.remainder(0.4 * k + 3, 6.2) - 3.1], axis=1)
    return Trajectory(stamps_ns=start_ns + 26_666_667 * k, poses=poses)


@pytest.mark.parametrize("start_ns", [UNIX_NS, 0, -400_000_001])
def test_tum_round_trip(tmp_path, start_ns):
    made = wavy(start_ns=start_ns)
    write_tum(tmp_path / "a.tum", made)
    back = read_tum(tmp_path / "a.tum")
    np.testing.assert_array_equal(back.stamps_ns, made.stamps_ns)
    np.testing.assert_allclose(back.poses, made.poses, atol=1e-9)


def test_tum_is_eight_blank_separated_numbers_with_a_unit_quaternion(tmp_path):
    """What evo's reader and the TUM tools ask for, read here as they do it: with float()."""
    write_tum(tmp_path / "a.tum", wavy())
    table = np.loadtxt(tmp_path / "a.tum", ndmin=2)
    assert table.shape == (50, 8)
    np.testing.assert_allclose(np.linalg.norm(table[:, 4:], axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(2 * np.arctan2(table[:, 6], table[:, 7]), wavy().poses[:, 2])
    np.testing.assert_allclose(table[:, 0], wavy().stamps_ns / 1e9)
    np.testing.assert_array_equal(table[:, 3:6], 0.0)


def test_tum_files_of_others(tmp_path):
    path = tmp_path / "a.tum"
    path.write_text("# t x y z qx qy qz qw\n1.5e+00 1 2 3 0 0 2 2\n\n2.0000000004 1 2 3 0 0 0 1\n")
    back = read_tum(path)
    np.testing.assert_array_equal(back.stamps_ns, [1_500_000_000, 2_000_000_000])
    np.testing.assert_allclose(back.poses[0], [1.0, 2.0, math.pi / 2])
    path.write_text("")
    assert len(read_tum(path)) == 0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1 2 3", "expected 8 numbers, found 3"),
        ("1 2 3 0 0 0 0 one", "one"),
        ("1 2 nan 0 0 0 0 1", "finite"),
        ("nan 2 3 0 0 0 0 1", "finite"),
        ("1e30 2 3 0 0 0 0 1", "time below"),
        ("1 2 3 0 0 0 0 0", "quaternion is zero"),
        ("0.5 2 3 0 0 0 0 1", "time does not increase"),
    ],
)
def test_damaged_tum_files_are_refused(tmp_path, line, message):
    path = tmp_path / "a.tum"
    path.write_text(f"0.5 0 0 0 0 0 0 1\n{line}\n")
    with pytest.raises(LogFormatError, match=rf"a\.tum:2: .*{message}"):
        read_tum(path)


def test_trajectories_are_validated():
    for stamps, poses, message in (
        ([1, 1], np.zeros((2, 3)), "strictly increase"),
        ([2, 1], np.zeros((2, 3)), "strictly increase"),
        ([1, 2], np.zeros((3, 3)), "poses must have shape"),
        ([1], [[0.0, math.inf, 0.0]], "poses must be finite"),
        ([0.5, 1.5], np.zeros((2, 3)), "stamps_ns must be numeric"),
        ([10**30], np.zeros((1, 3)), "stamps_ns must be numeric"),
    ):
        with pytest.raises(InvalidValueError, match=message):
            Trajectory(stamps_ns=stamps, poses=poses)
    with pytest.raises(ValueError, match="read-only"):
        wavy().poses[0, 0] = 1.0
    square = Trajectory(stamps_ns=[1, 2, 3], poses=[[0, 0, 0], [3, 4, 0], [3, 4, 2]])
    assert square.length_m() == 5.0


def test_loops_correct_the_poses_so_far_and_say_by_how_much_the_latest_moved():
    path, there = PosePath(), np.array([2.0, 0.0, 0.0])
    path.add(10, np.array([1.0, 0.0, 0.0]))
    path.add(20, there)
    there[:] = np.nan  # its poses are its own
    assert path.poses().tolist() == [[1, 0, 0], [2, 0, 0]]
    corrected = path.poses() + np.array([0.0, 1.0, 0.0])
    T_new_old, latest = np.array([0.0, 1.0, 0.0]), np.array([2.0, 0.0, 0.0])
    assert path.correct(corrected, T_new_old, latest).tolist() == [2, 1, 0]
    assert path.moved_by.tolist() == path.T_map_odom.tolist() == [0, 1, 0]
    assert path.poses().tolist() == corrected.tolist()
