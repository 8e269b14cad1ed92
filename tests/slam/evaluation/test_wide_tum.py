# SPDX-License-Identifier: Apache-2.0
"""Poses with covariances stand in the file as written, in the robot's frame."""

import math
from pathlib import Path

import numpy as np
import pytest

from slam.errors import InvalidValueError
from slam.evaluation.wide_tum import FLAT, PLANAR, ROUNDING, to_body, write_wide_tum
from slam.frames import NS_PER_S
from slam.trajectory import Trajectory

N = 30


def made(seed: int = 0) -> tuple[Trajectory, np.ndarray]:
    rng = np.random.default_rng(seed)
    stamps = 1_700_000_000 * NS_PER_S + np.cumsum(rng.integers(1, 10**9, N))
    poses = np.column_stack([rng.normal(0.0, 5.0, (N, 2)), rng.uniform(-3.1, 3.1, N)])
    roots = rng.normal(0.0, 0.01, (N, 3, 3))
    return Trajectory(stamps_ns=stamps, poses=poses), roots @ roots.transpose(0, 2, 1)


def written(path: Path) -> np.ndarray:
    """(n, 3, 3) the covariances of a file, of x, y and heading in the robot's frame."""
    rows = np.atleast_2d(np.loadtxt(path))
    whole = np.zeros((len(rows), 6, 6))
    whole[:, *np.tril_indices(6)] = rows[:, 8:]
    lower = whole[np.ix_(range(len(rows)), PLANAR, PLANAR)]
    return lower + np.tril(lower, -1).transpose(0, 2, 1)


def test_a_line_is_a_pose_and_the_lower_triangle_by_rows(tmp_path: Path):
    ahead, aside, turned, both = 0.04, 0.01, 0.0025, 0.001
    # The robot looks along y of the map: what is ahead of it is uncertain along y.
    covariance = np.array([[aside, 0.0, 0.0], [0.0, ahead, both], [0.0, both, turned]])
    pose = Trajectory(
        stamps_ns=np.array([1_500_000_000]), poses=np.array([[1.0, 2.0, math.pi / 2]])
    )
    write_wide_tum(tmp_path / "a.tum", pose, covariance[None], epoch_ns=NS_PER_S, algorithm="mine")
    header = [line for line in (tmp_path / "a.tum").read_text().splitlines() if line[0] == "#"]
    assert header[0] == "#%FORMAT SQUARE/0.3"
    assert {"#%ALGORITHM mine", "#%TANGENT_ORDER translation_rotation"} < set(header)
    assert {"#%TANGENT_CONVENTION right_perturbation", "#%GAUGE fixed"} < set(header)
    row = np.loadtxt(tmp_path / "a.tum")
    assert row.shape == (29,)
    half = math.sqrt(0.5)
    np.testing.assert_allclose(row[:8], [2.5, 1, 2, 0, 0, 0, half, half], atol=1e-12)
    whole, at = np.zeros((6, 6)), 8
    for i in range(6):
        whole[i, : i + 1] = row[at : at + i + 1]
        at += i + 1
    expected = np.diag([ahead, aside, FLAT, FLAT, FLAT, turned])
    expected[5, 0] = both
    np.testing.assert_allclose(whole, expected, atol=1e-15)


@pytest.mark.parametrize("theta", [-3.0, -0.4, 0.0, 1.2])
def test_an_error_is_as_unlikely_in_both_frames(theta: float):
    covariance = made()[1][0]
    whole, error = to_body(covariance, theta), np.array([0.02, -0.03, 0.01])
    c, s = math.cos(theta), math.sin(theta)
    seen = np.array([c * 0.02 - s * 0.03, -s * 0.02 - c * 0.03, 0.0, 0.0, 0.0, 0.01])
    nees = error @ np.linalg.solve(covariance, error)
    assert seen @ np.linalg.solve(whole, seen) == pytest.approx(nees, rel=1e-6)


def test_the_known_start_gets_a_variance_that_can_be_inverted(tmp_path: Path):
    trajectory, covariances = made()
    covariances[0] = 0.0
    write_wide_tum(tmp_path / "a.tum", trajectory, covariances)
    assert np.linalg.eigvalsh(written(tmp_path / "a.tum")).min() >= FLAT / 2.0


def turned(least: float, skew: float = 0.0) -> np.ndarray:
    """(1, 3, 3) with eigenvalues 1, 0.5 and the least; two entries differ by ``skew``."""
    axes = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    whole = axes @ np.diag([1.0, 0.5, least]) @ axes.T
    whole[0, 2] += skew
    return whole[None]


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e4])
def test_rounding_is_a_part_of_the_covariance_whatever_its_size(tmp_path: Path, scale: float):
    pose = Trajectory(stamps_ns=np.array([1]), poses=np.array([[1.0, 2.0, 0.5]]))
    part = 1.5 * ROUNDING  # of the eigenvalues of ``turned``: their sum is 1.5
    for fine in (turned(-0.9 * part), turned(0.0, 0.9 * part)):
        write_wide_tum(tmp_path / "a.tum", pose, scale * fine)
        back = written(tmp_path / "a.tum")
        expected = to_body(scale * fine[0], 0.5)[np.ix_(PLANAR, PLANAR)]
        np.testing.assert_allclose(back[0], expected, atol=2.0 * part * scale + 2.0 * FLAT)
        assert np.linalg.eigvalsh(back).min() >= FLAT / 2.0
    for bad, says in (
        (turned(-1.2 * part), "positive semidefinite, got an eigenvalue of -"),
        (turned(0.0, 1.2 * part), r"symmetric, got entries .* apart in scan 0"),
    ):
        with pytest.raises(InvalidValueError, match=says):
            write_wide_tum(tmp_path / "b.tum", pose, scale * bad)
    assert not (tmp_path / "b.tum").exists()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c[:-1], r"must be \(30, 3, 3\), got \(29, 3, 3\)"),
        (lambda c: np.where(np.arange(N)[:, None, None] == 4, np.nan, c), "finite"),
        (lambda c: c - 1e-3 * np.eye(3), "positive semidefinite, got an eigenvalue of -0.00"),
        (lambda c: 0.0 * c, "states none"),
    ],
)
def test_what_cannot_be_scored_is_refused_and_nothing_written(tmp_path: Path, change, says):
    trajectory, covariances = made()
    with pytest.raises(InvalidValueError, match=says):
        write_wide_tum(tmp_path / "a.tum", trajectory, change(covariances))
    with pytest.raises(InvalidValueError, match="algorithm must be one line"):
        write_wide_tum(tmp_path / "a.tum", trajectory, covariances, algorithm="a\nb")
    assert not list(tmp_path.iterdir())
