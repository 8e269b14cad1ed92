# SPDX-License-Identifier: Apache-2.0
"""Odometry: exact without error, and errors that are as large as it says they are."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from sim.sensors.odometry.encoders import OdometryConfig, WheelOdometry
from slam import se2
from slam.errors import InvalidValueError, UnknownNameError
from slam.frames import Odometry

pytestmark = pytest.mark.slow
TRACK = 0.33
Float = NDArray[np.float64]


def drive(twists: Float, rate: float = 75.0) -> tuple[Float, Float]:
    """((n + 1, 3) travel m, (n + 1, 3) true poses) of v m/s, omega rad/s and, if it is there, m/s
    to the left."""
    travel, poses = [np.zeros(3)], [np.zeros(3)]
    for v, omega, *aside in twists:
        half, side = 0.5 * omega * TRACK, aside[0] if aside else 0.0
        travel.append(travel[-1] + np.array([v - half, v + half, side]) / rate)
        poses.append(se2.compose(poses[-1], se2.exp((v, side, omega), 1.0 / rate)))
    return np.array(travel), np.array(poses)


def office_tour(seconds: int = 60, rate: float = 75.0) -> Float:
    """Corridors at 0.5 m/s and turns through doors, about 25 m in 60 s."""
    time = np.arange(int(seconds * rate)) / rate
    turning = time % 6.0 > 4.5
    left = (time // 6.0).astype(int) % 3 > 0
    return np.column_stack(
        (np.where(turning, 0.2, 0.5), np.where(turning, np.where(left, 1.0, -1.0), 0.0))
    )


def run(config: OdometryConfig | str, travel: Float, seed: int, every: int = 1) -> WheelOdometry:
    odometry = WheelOdometry(config, np.random.default_rng(seed), track=TRACK)
    for rims in travel[::every]:
        odometry.update(rims)
    return odometry


def scan(
    odometry: WheelOdometry, first: ArrayLike, last: ArrayLike, *, stamp_ns: int, sweep_s: float
) -> Odometry:
    """The reading of a scan between whose first and last beam the rims roll from one to other."""
    odometry.over_scan(np.array([first, last]), 0.0, 1.0, contact=False)
    return odometry.reading(stamp_ns=stamp_ns, sweep_s=sweep_s)


def increments(
    config: OdometryConfig | str, travel: Float, poses: Float, *, seed: int, every: int
) -> tuple[list[Float], list[Float]]:
    """(errors (3,), covariances (3, 3)) of the motions between frames ``every`` rows apart."""
    odometry = WheelOdometry(config, np.random.default_rng(seed), track=TRACK)
    errors, covariances = [], []
    before = None
    for k in range(len(travel) - 1):
        if k % every:
            odometry.update(travel[k])
            continue
        reading = scan(odometry, travel[k], travel[k + 1], stamp_ns=k, sweep_s=0.02)
        if before is not None:
            error = se2.between(before, reading.T_odom_robot) - se2.between(
                poses[k - every], poses[k]
            )
            error[2] = se2.wrap(error[2])
            errors.append(error)
            covariances.append(np.array(reading.increment_covariance))
        before = reading.T_odom_robot
    return errors, covariances


def test_without_errors_the_wheels_tell_the_true_path() -> None:
    travel, poses = drive(office_tour())
    odometry = run("ideal", travel, seed=0)
    np.testing.assert_allclose(odometry.pose[:2], poses[-1][:2], atol=1e-9)
    assert se2.wrap(odometry.pose[2] - poses[-1][2]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "axes"),
    # Nothing in the second preset goes sideways but at second order: judge it by x and theta.
    [("pioneer3dx", [0, 1, 2]), ("probabilistic_robotics", [0, 2])],
)
@pytest.mark.parametrize("every", [2, 40])
def test_the_errors_of_100_runs_are_as_large_as_their_covariance_says(
    name: str, axes: list[int], every: int
) -> None:
    """NEES of k numbers averages k. Bounds: 4 standard errors of the 100 run means."""
    travel, poses = drive(office_tour(seconds=6 if every == 2 else 18))
    block = np.ix_(axes, axes)
    means = []
    for seed in range(100):
        errors, covariances = increments(name, travel, poses, seed=seed, every=every)
        nees = [
            e[axes] @ np.linalg.solve(c[block], e[axes])
            for e, c in zip(errors, covariances, strict=True)
        ]
        means.append(float(np.mean(nees)))
    standard_error = float(np.std(means)) / math.sqrt(len(means))
    assert np.mean(means) == pytest.approx(len(axes), abs=4.0 * standard_error)
    assert standard_error < 0.15


@pytest.mark.parametrize("twist", [(0.5, 0.3), (0.1, 0.3, -0.5)])  # the latter mostly sideways
def test_covariance_matches_sampling_of_both_parts(twist: tuple[float, ...]) -> None:
    """One long increment on an arc, where the systematic part is the larger one."""
    travel, poses = drive(np.tile(twist, (300, 1)))
    ends, claimed = [], np.zeros((3, 3))
    for seed in range(1000):
        odometry = WheelOdometry("pioneer3dx", np.random.default_rng(seed), track=TRACK)
        for rims in travel[::10]:
            odometry.update(rims)
        ends.append(odometry.pose - np.array([*poses[-1][:2], 0.3 * 4.0]))
        last = travel[-1] + [1e-3, 1e-3, 0.0]
        reading = scan(odometry, travel[-1], last, stamp_ns=0, sweep_s=0.02)
        claimed = np.array(reading.increment_covariance)
    sampled = np.cov(np.array(ends).T)
    assert np.abs(sampled - claimed).max() < 0.12 * claimed.max()
    np.testing.assert_allclose(np.sqrt(np.diag(sampled)), np.sqrt(np.diag(claimed)), rtol=0.08)


def test_wheels_that_roll_sideways_tell_the_true_path_and_err_along_it() -> None:
    travel, poses = drive(np.tile((0.3, 0.8, -0.4), (200, 1)))
    np.testing.assert_allclose(run("ideal", travel, seed=0).pose, poses[-1], atol=1e-9)
    config = OdometryConfig(trans_std_per_m=0.02)
    aside = np.column_stack([np.zeros((81, 2)), np.linspace(0.0, 1.0, 81)])
    ends = np.array([run(config, aside, seed).pose for seed in range(400)])
    assert ends[:, 1].std() == pytest.approx(0.02, rel=0.12)
    assert ends[:, 0].std() < 1e-9


def test_deviation_after_one_metre_does_not_depend_on_the_rate() -> None:
    config = OdometryConfig(trans_std_per_m=0.02, rot_std_per_m=math.radians(2.0))
    for steps in (5, 80):
        travel = np.column_stack([np.linspace(0.0, 1.0, steps + 1)] * 2)
        ends = np.array([run(config, travel, seed).pose for seed in range(400)])
        assert ends[:, 0].std() == pytest.approx(0.02, rel=0.12)
        assert ends[:, 2].std() == pytest.approx(math.radians(2.0), rel=0.12)


def test_a_square_shows_the_systematic_errors_as_umbmark_does() -> None:
    """Wrong track shows alike in both directions of the square, wrong wheels oppositely."""
    side, quarter = np.tile((0.5, 0.0), (600, 1)), np.tile((0.0, math.pi / 4), (150, 1))
    ends = {}
    for direction in (1.0, -1.0):
        travel, _ = drive(np.concatenate([side, quarter * (1.0, direction)] * 4))
        for name in ("track_std", "diameter_ratio_std"):
            odometry = WheelOdometry(
                replace(OdometryConfig(), **{name: 0.01}), np.random.default_rng(3), track=TRACK
            )
            scale, track, ratio = odometry.errors
            for rims in travel:
                odometry.update(rims)
            ends[name, direction] = odometry.pose.copy()
            assert scale == 1.0
            assert (track != 1.0) == (name == "track_std")
            assert (ratio != 1.0) == (name == "diameter_ratio_std")
    turned = 2.0 * math.pi
    a, b = ends["track_std", 1.0][2] - turned, ends["track_std", -1.0][2] + turned
    assert a == pytest.approx(-b, rel=1e-6)  # too far round both ways
    a, b = (ends["diameter_ratio_std", d][2] - d * turned for d in (1.0, -1.0))
    assert a == pytest.approx(b, rel=0.05)  # bent to the same side both ways


def test_drift_on_an_office_tour_is_that_of_a_real_pioneer() -> None:
    travel, poses = drive(office_tour(), rate=75.0)
    drift = [
        math.hypot(*(run("pioneer3dx", travel, seed, every=4).pose - poses[-4])[:2])
        for seed in range(40)
    ]
    assert 0.4 < float(np.median(drift)) < 2.0


def test_pose_is_that_of_the_stamp_and_twist_the_mean_over_the_sweep() -> None:
    travel, _ = drive(np.tile((0.6, 0.9), (40, 1)), rate=300.0)
    odometry = WheelOdometry("ideal", track=TRACK)
    reading = scan(odometry, travel[0], travel[6], stamp_ns=5, sweep_s=6 / 300)
    assert reading.stamp_ns == 5
    np.testing.assert_array_equal(reading.T_odom_robot, np.zeros(3))
    np.testing.assert_allclose(reading.twist, (0.6, 0.0, 0.9), atol=1e-9)
    second = scan(odometry, travel[8], travel[14], stamp_ns=6, sweep_s=6 / 300)
    np.testing.assert_allclose(second.T_odom_robot, se2.exp((0.6, 0.0, 0.9), 8 / 300), atol=1e-12)


def test_ticks_count_the_rims() -> None:
    config = OdometryConfig(ticks_per_m=1000.0)
    odometry = run(config, np.array([[0.0, 0.0], [0.1234, 0.5006]]), seed=0)
    assert odometry.ticks.tolist() == [123, 501]
    assert odometry.pose[2] == pytest.approx((0.501 - 0.123) / TRACK)


def test_slip_turns_the_heading_by_one_to_three_degrees() -> None:
    config = OdometryConfig(slip_per_contact_m=1e9)
    for contact, turned in ((False, 0.0), (True, 1.0)):
        odometry = WheelOdometry(config, np.random.default_rng(1), track=TRACK)
        odometry.update((0.1, 0.1), contact=contact)
        degrees = abs(math.degrees(odometry.pose[2]))
        assert turned <= degrees <= 3.0 * turned


def test_a_standing_robot_has_an_invertible_covariance_and_does_not_drift() -> None:
    odometry = WheelOdometry("pioneer3dx", np.random.default_rng(1))
    for k in range(3):
        reading = scan(odometry, np.zeros(3), np.zeros(3), stamp_ns=k, sweep_s=0.02)
    np.testing.assert_array_equal(reading.T_odom_robot, np.zeros(3))
    assert np.linalg.det(reading.increment_covariance) > 0.0


def test_unknown_presets_and_impossible_values_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'pioneer3dx'"):
        WheelOdometry("pioneer")
    with pytest.raises(InvalidValueError, match=r"OdometryConfig\.track_std"):
        OdometryConfig(track_std=-1.0)
    with pytest.raises(InvalidValueError, match=r"WheelOdometry\.track"):
        WheelOdometry(track=0.0)
