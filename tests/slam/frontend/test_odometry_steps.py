# SPDX-License-Identifier: Apache-2.0
"""Streams that no robot made: steps of a million kilometres, years between frames."""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from slam import Frame, LaserSpec, Odometry, Scan, create, se2
from slam.errors import InvalidValueError
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import NS_PER_S
from slam.frontend import odometry_steps

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
        odometry_steps.increment(before, now), se2.between(before.T_odom_robot, now.T_odom_robot)
    )
    far = Odometry(stamp_ns=7, T_odom_robot=[1e308, -1e308, 1.0])
    with pytest.raises(InvalidValueError, match=r"at most 1000 m .* got \S+ m from 0 ns to 7 ns"):
        odometry_steps.increment(before, far)


@pytest.mark.parametrize("twist", [[1e4, 0.0, 0.0], [0.0, 0.0, -1e300]])
def test_a_twist_that_would_tear_a_scan_apart_is_refused(twist):
    with pytest.raises(InvalidValueError, match=r"Odometry\.twist must lie within 1000 m/s"):
        Odometry(stamp_ns=0, T_odom_robot=np.zeros(3), twist=twist)


@pytest.mark.parametrize("name", ["odometry", "shunting", "occupancy", "ekf", "kiss-icp", "karto"])
def test_every_slam_refuses_frames_out_of_order_at_once(name):
    """And goes on with the next one that is in order."""
    spec = LaserSpec(n_beams=181, angle_min=-1.57, angle_increment=math.radians(1.0))

    def frame(stamp_ns: int) -> Frame:
        ranges = 3.0 + np.sin(np.arange(181) * 0.1)
        return Frame(
            stamp_ns=stamp_ns,
            odometry=Odometry(stamp_ns=stamp_ns, T_odom_robot=np.zeros(3)),
            scan=Scan(stamp_ns=stamp_ns, ranges=ranges, spec=spec),
        )

    slam = create(name)
    slam.update(frame(10**9))
    for stamp_ns in (10**9, 10**9 - 1, -(2**63)):
        with pytest.raises(InvalidValueError, match="frames must come in order"):
            slam.update(frame(stamp_ns))
    slam.update(frame(2 * 10**9))
    assert slam.trajectory().stamps_ns.tolist() == [10**9, 2 * 10**9]
