# SPDX-License-Identifier: Apache-2.0
"""Streams that no robot made, motion over scans that are left out, and the bias that is learnt."""

import dataclasses
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from slam import LaserSpec, create, se2
from slam.errors import InvalidValueError
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import NS_PER_S, Features, Frame, Odometry
from slam.frontend.heading_bias import HeadingBias
from slam.frontend.odometry_prior import Prediction, motion
from slam.frontend.odometry_steps import MotionSum, thinned

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
import world2d

SYSTEMS = ("odometry", "occupancy", "shunting", "shunting-features", "ekf")
TEN_YEARS_NS = 315_576_000 * NS_PER_S
HALF = 6


def frames_for(name: str) -> list[Frame]:
    """Few frames of points or scans, which this system takes."""
    if name in ("shunting-features", "ekf"):
        world = PointWorld(PointWorldConfig(n_steps=2 * HALF - 1), seed=0)
        return [frame.without_truth() for frame in world.stream()]
    room = world2d.World2D(world2d.rectangle(-3.0, -2.0, 3.0, 2.0))
    drive = world2d.wander(1.0)
    return [frame.without_truth() for frame in world2d.frames(room, drive, rate_hz=37.5)][
        : 2 * HALF
    ]


def changed(
    frame: Frame, *, along_m: float = 0.0, later_ns: int = 0, covariance: np.ndarray | None = None
) -> Frame:
    """The same frame at another place and time."""
    stamp_ns, old = frame.stamp_ns + later_ns, frame.odometry
    odometry = Odometry(
        stamp_ns=stamp_ns,
        T_odom_robot=old.T_odom_robot + np.array([along_m, 0.0, 0.0]),
        increment_covariance=old.increment_covariance if covariance is None else covariance,
        twist=old.twist,
    )
    scan, features = (
        None if sensed is None else dataclasses.replace(sensed, stamp_ns=stamp_ns)
        for sensed in (frame.scan, frame.features)
    )
    return Frame(stamp_ns=stamp_ns, odometry=odometry, scan=scan, features=features)


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("along_m", [1e4, 1e12, -1e300])
def test_a_step_that_no_robot_makes_is_refused_by_name(name, along_m):
    system, frames = create(name), frames_for(name)
    for frame in frames[:HALF]:
        system.update(frame)
    with pytest.raises(InvalidValueError, match=r"Odometry\.T_odom_robot must move by at most"):
        system.update(changed(frames[HALF], along_m=along_m))


@pytest.mark.parametrize("name", SYSTEMS)
def test_ten_years_without_a_frame_are_survived(name):
    system, frames = create(name), frames_for(name)
    for frame in frames[:HALF]:
        system.update(frame)
    for frame in frames[HALF:]:
        last = system.update(changed(frame, later_ns=TEN_YEARS_NS))
    true = se2.between(frames[0].odometry.T_odom_robot, frames[-1].odometry.T_odom_robot)
    assert np.hypot(*(last.T_map_robot - true)[:2]) < 0.5
    assert len(system.trajectory().poses) == 2 * HALF


@pytest.mark.parametrize("variance", [1e7, 1e12, 1e300])
def test_odometry_that_knows_nothing_does_not_break_the_ekf(variance):
    system, frames = create("ekf"), frames_for("ekf")
    for frame in frames[:HALF]:
        before = system.update(frame)
    estimate = system.update(changed(frames[HALF], covariance=variance * np.eye(3)))
    assert estimate.diagnostics["matched"] > 5  # and so it is found again
    moved = estimate.T_map_robot - before.T_map_robot
    assert np.hypot(moved[0] - PointWorldConfig().step_m, moved[1]) < 0.02


def test_steps_are_those_of_se2_and_their_limit_is_told():
    before = Odometry(stamp_ns=0, T_odom_robot=[1.0, 2.0, 0.5])
    now = Odometry(stamp_ns=1, T_odom_robot=[2.0, 2.5, 1.0])
    np.testing.assert_array_equal(
        motion(before, now), se2.between(before.T_odom_robot, now.T_odom_robot)
    )
    far = Odometry(stamp_ns=7, T_odom_robot=[1e308, -1e308, 1.0])
    with pytest.raises(InvalidValueError, match=r"at most 1000 m .* got \S+ m from 0 ns to 7 ns"):
        motion(before, far)


@pytest.mark.parametrize("twist", [[1e4, 0.0, 0.0], [0.0, 0.0, -1e300]])
def test_a_twist_that_would_tear_a_scan_apart_is_refused(twist):
    with pytest.raises(InvalidValueError, match=r"Odometry\.twist must lie within 1000 m/s"):
        Odometry(stamp_ns=0, T_odom_robot=np.zeros(3), twist=twist)


@pytest.mark.parametrize("name", ["odometry", "shunting", "occupancy", "ekf", "kiss-icp", "karto"])
def test_every_slam_refuses_frames_out_of_order_at_once(name):
    """And goes on with the next one that is in order."""
    spec = LaserSpec(n_beams=181, angle_min=-1.57, angle_increment=math.radians(1.0))

    def frame(stamp_ns: int) -> Frame:
        return world2d.frame_at(stamp_ns, ranges=3.0 + np.sin(np.arange(181) * 0.1), spec=spec)

    slam = create(name)
    slam.update(frame(10**9))
    for stamp_ns in (10**9, 10**9 - 1, -(2**63)):
        with pytest.raises(InvalidValueError, match="frames must come in order"):
            slam.update(frame(stamp_ns))
    slam.update(frame(2 * 10**9))
    assert slam.trajectory().stamps_ns.tolist() == [10**9, 2 * 10**9]


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


SAID = math.radians(0.3)  # per step, by odometry
WELL = np.diag([1e4, 1e4, 1e6])


def drive(
    bias: HeadingBias, per_m: float, per_rad: float, information: NDArray[np.float64], noise: float
) -> None:
    """300 steps of a robot whose heading the map corrects after each."""
    rng = np.random.default_rng(1)
    error = 0.0  # of the estimated heading
    for k in range(300):
        true = np.array([0.15, 0.0, 0.2 * math.sin(0.05 * k)])
        added = true[2] * per_rad + 0.15 * per_m + float(rng.normal(0.0, noise))
        odometry = true + np.array([0.0, 0.0, added])
        turn = odometry[2] * (1.0 - bias.per_rad) - odometry[0] * bias.per_m
        increment = np.array([odometry[0], odometry[1], turn])
        error += increment[2] - true[2]
        told, given = information[2, 2], SAID**2
        off = -error * told * given / (1.0 + told * given)
        bias.learn(increment, 0.2, (given, given), (1.0, off, information))
        error += off


def test_it_finds_what_the_wheels_add() -> None:
    bias = HeadingBias()
    drive(bias, 0.015, -0.03, WELL, SAID)
    assert bias.per_m == pytest.approx(0.015, abs=0.006)  # 2 sigma
    assert bias.per_rad == pytest.approx(-0.03, abs=0.02)


def test_it_learns_nothing_where_the_map_tells_nothing() -> None:
    bias = HeadingBias()
    drive(bias, 0.015, -0.03, np.diag([1e4, 1e4, 1.0]), SAID)
    assert (bias.per_m, bias.per_rad) == (0.0, 0.0)
    # A heading that a shift aside explains as well is not told either.
    coupled = np.array([[1e4, 0.0, 0.0], [0.0, 1e4, 1e5], [0.0, 1e5, 1e6 + 1.0]])
    drive(bias, 0.015, -0.03, coupled, SAID)
    assert (bias.per_m, bias.per_rad) == (0.0, 0.0)


def test_a_wheel_that_slips_teaches_nothing() -> None:
    bias = HeadingBias()
    drive(bias, 0.0, 0.0, WELL, 0.0)
    before = bias.per_m
    bias.learn(np.array([0.15, 0.0, 0.0]), 0.2, (SAID**2, SAID**2), (1.0, 10.0 * SAID, WELL))
    assert bias.per_m == before


def test_a_changed_prediction_keeps_nothing_that_was_computed_of_the_one_before() -> None:
    first = Prediction(
        T_map_robot=np.zeros(3), increment=np.zeros(3), covariance=np.eye(3),
        twist=np.zeros(3), elapsed=0.1,
    )  # fmt: skip
    assert first.prior == pytest.approx(np.eye(3))
    assert first.changed(carried=2.0 * np.eye(3)).prior == pytest.approx(3.0 * np.eye(3))
    assert first.prior == pytest.approx(np.eye(3))


def test_thinned_frames_state_the_covariance_of_all_the_motion_between_them():
    stream = frames_for("odometry")
    thin, parts = thinned(stream, 4), [f.odometry.increment_covariance for f in stream]
    assert [f.stamp_ns for f in thin] == [f.stamp_ns for f in stream[::4]]
    np.testing.assert_array_equal(thin[2].odometry.increment_covariance, np.sum(parts[5:9], axis=0))
    bare = [
        dataclasses.replace(f, odometry=dataclasses.replace(f.odometry, increment_covariance=None))
        for f in stream
    ]
    assert thinned(bare, 4)[2].odometry.increment_covariance is None
    assert [f.scan for f in thinned(stream, 1)] == [f.scan for f in stream]
