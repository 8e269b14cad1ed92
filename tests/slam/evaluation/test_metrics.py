# SPDX-License-Identifier: Apache-2.0
"""Metrics on trajectories whose errors are known by construction."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam import Trajectory, se2
from slam.errors import InvalidValueError
from slam.evaluation import metrics

T_WORLD_MAP = np.array([3.0, -7.0, 2.5])


def drive(n=60, twist=(1.0, 0.0, 0.3), period_s=0.1):
    """Poses on a circle, in the frame of the first."""
    poses = np.array([se2.exp(twist, period_s * k) for k in range(n)])
    stamps = np.arange(n, dtype=np.int64) * round(period_s * 1e9) + 7
    return Trajectory(stamps_ns=stamps, poses=poses)


def moved(trajectory, T_a_b):
    poses = np.array([se2.compose(T_a_b, pose) for pose in trajectory.poses])
    return Trajectory(stamps_ns=trajectory.stamps_ns, poses=poses)


def shifted(trajectory, error):
    """Each pose off by the same error, except the known first one."""
    poses = trajectory.poses + error
    poses[0] = trajectory.poses[0]
    return Trajectory(stamps_ns=trajectory.stamps_ns, poses=poses)


def test_association_is_by_equal_stamps():
    truth, estimate = drive(10), drive(10)
    later = Trajectory(stamps_ns=truth.stamps_ns[2:] + np.array([0, 1] * 4), poses=truth.poses[2:])
    a, b = metrics.associate(estimate, later)
    np.testing.assert_array_equal(a.stamps_ns, truth.stamps_ns[2::2])
    np.testing.assert_array_equal(a.poses, b.poses)
    with pytest.raises(InvalidValueError, match="no common stamp"):
        metrics.associate(estimate, Trajectory(stamps_ns=[1, 2], poses=np.zeros((2, 3))))


def test_a_perfect_estimate_has_no_error_whatever_the_frame_of_the_truth():
    estimate, truth = drive(), moved(drive(), T_WORLD_MAP)
    for align in ("none", "se2"):
        assert metrics.ate(estimate, truth, align=align).value == pytest.approx(0.0, abs=1e-12)
        heading = metrics.heading_rmse(estimate, truth, align=align)
        assert heading.value == pytest.approx(0.0, abs=1e-12)


def test_known_offsets_are_the_errors_in_the_frame_of_the_first_pose():
    truth = moved(drive(), T_WORLD_MAP)
    estimate = shifted(drive(), [0.3, -0.4, 0.1])
    n = len(truth)
    share = math.sqrt((n - 1) / n)  # the first pose is right
    ate = metrics.ate(estimate, truth)
    assert ate.value == pytest.approx(0.5 * share)
    assert (ate.unit, ate.alignment, ate.n) == ("m", "none", n)
    assert metrics.heading_rmse(estimate, truth).value == pytest.approx(0.1 * share)
    errors = metrics.pose_errors(estimate, truth)
    np.testing.assert_allclose(errors.errors[1:], [[0.3, -0.4, 0.1]] * (n - 1), atol=1e-12)
    assert "m (60 samples, none alignment)" in str(ate)


def test_heading_errors_wrap():
    truth = drive(40, twist=(1.0, 0.0, 1.0))
    estimate = shifted(truth, [0.0, 0.0, math.tau - 0.2])
    assert np.abs(metrics.pose_errors(estimate, truth).errors[:, 2]).max() == pytest.approx(0.2)


def test_se2_alignment_removes_a_rigid_motion_and_only_that():
    truth = moved(drive(), T_WORLD_MAP)
    turned = moved(drive(), [1.0, 2.0, -3.0])
    assert metrics.ate(turned, truth, align="none").value > 1.0
    assert metrics.ate(turned, truth, align="se2").value == pytest.approx(0.0, abs=1e-12)
    assert metrics.heading_rmse(turned, truth, align="se2").value == pytest.approx(0.0, abs=1e-12)
    stretched = Trajectory(stamps_ns=truth.stamps_ns, poses=drive().poses * [1.1, 1.1, 1.0])
    assert metrics.ate(stretched, truth, align="se2").value > 0.05


@settings(max_examples=50, deadline=None, derandomize=True, database=None)
@given(st.integers(0, 10_000))
def test_the_fit_is_a_minimum_and_undoes_a_known_motion(seed):
    rng = np.random.default_rng(seed)
    b = rng.normal(size=(12, 2))
    T_a_b = rng.uniform(-3.0, 3.0, size=3)
    np.testing.assert_allclose(se2.fit(b, se2.transform(T_a_b, b)), T_a_b, atol=1e-9)
    a = se2.transform(T_a_b, b) + 0.3 * rng.normal(size=b.shape)
    fitted = se2.fit(b, a)

    def cost(T):
        return ((a - se2.transform(T, b)) ** 2).sum()

    for step in np.vstack([np.eye(3), -np.eye(3)]) * 1e-3:
        assert cost(fitted) < cost(fitted + step)


def test_truth_that_begins_later_is_tied_at_the_first_common_stamp():
    estimate = drive(20)
    truth = moved(
        Trajectory(stamps_ns=estimate.stamps_ns[5:], poses=estimate.poses[5:]), T_WORLD_MAP
    )
    assert metrics.ate(estimate, truth).value == pytest.approx(0.0, abs=1e-12)


def test_the_papers_statistics_and_their_identity():
    rng = np.random.default_rng(1)
    truth = drive()
    e = rng.normal(size=(60, 3)) * [0.1, 0.2, 0.05] + [0.3, -0.1, 0.02]
    e[0] = 0.0
    table = metrics.error_statistics(
        Trajectory(stamps_ns=truth.stamps_ns, poses=truth.poses + e), truth
    )
    np.testing.assert_allclose(table.mean, e.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(table.var_e, e.var(axis=0, ddof=1), atol=1e-12)
    np.testing.assert_allclose(table.var_p, (e**2).sum(axis=0) / 59, atol=1e-12)
    np.testing.assert_allclose(table.var_p, table.var_e + 60 / 59 * table.mean**2, atol=1e-12)
    with pytest.raises(InvalidValueError, match="at least 2"):
        metrics.error_statistics(drive(1), drive(1))


def test_rpe_of_a_scale_and_a_turning_rate_error():
    truth = moved(drive(200, twist=(1.0, 0.0, 0.0)), T_WORLD_MAP)
    fast = drive(200, twist=(1.05, 0.0, 0.0))
    translation, rotation = metrics.rpe(fast, truth, per="m")
    assert translation.value == pytest.approx(0.05)
    assert rotation.value == pytest.approx(0.0, abs=1e-12)
    assert (translation.unit, rotation.unit, translation.n) == ("m/m", "rad/m", 190)
    turning = drive(200, twist=(1.0, 0.0, 0.02))
    assert metrics.rpe(turning, truth, per="s")[1].value == pytest.approx(0.02)
    assert metrics.rpe(turning, truth, per="s")[0].unit == "m/s"


def test_rpe_does_not_depend_on_frames_or_sampling():
    truth, fast = drive(200), drive(200, twist=(1.05, 0.0, 0.3))
    dense = metrics.rpe(fast, truth, per="s")[0].value
    elsewhere = metrics.rpe(moved(fast, [5.0, 1.0, 2.0]), moved(truth, T_WORLD_MAP), per="s")[0]
    assert elsewhere.value == pytest.approx(dense)
    few = slice(0, None, 15)  # 1.5 s apart: more than the delta
    sparse = metrics.rpe(
        Trajectory(stamps_ns=fast.stamps_ns[few], poses=fast.poses[few]),
        Trajectory(stamps_ns=truth.stamps_ns[few], poses=truth.poses[few]),
        per="s",
    )[0]
    assert sparse.value == pytest.approx(dense, rel=0.05)


def test_rpe_refuses_what_it_cannot_measure():
    with pytest.raises(InvalidValueError, match="shorter than"):
        metrics.rpe(drive(5), drive(5), per="m")
    with pytest.raises(InvalidValueError, match="delta"):
        metrics.rpe(drive(), drive(), per="s", delta=0.0)
    with pytest.raises(InvalidValueError, match="align"):
        metrics.ate(drive(), drive(), align="scale")


def test_nees_of_honest_covariances_averages_three():
    rng = np.random.default_rng(5)
    truth = drive(4000, period_s=0.01)
    P = np.array([[0.04, 0.01, 0.002], [0.01, 0.02, 0.001], [0.002, 0.001, 0.001]])
    poses = truth.poses + rng.multivariate_normal(np.zeros(3), P, size=len(truth))
    poses[0] = truth.poses[0]
    covariances = np.repeat(P[None], len(truth), axis=0)
    covariances[0] = 0.0
    estimate = Trajectory(stamps_ns=truth.stamps_ns, poses=poses)
    honest = metrics.nees(estimate, covariances, moved(truth, T_WORLD_MAP))
    assert honest.mean == pytest.approx(3.0, abs=0.2)
    assert math.isnan(honest.values[0])
    assert honest.n_used == len(truth) - 1
    boastful = metrics.nees(estimate, covariances / 4.0, truth)
    assert boastful.mean == pytest.approx(4.0 * honest.mean)
    assert math.isnan(metrics.nees(estimate, np.zeros_like(covariances), truth).mean)
