# SPDX-License-Identifier: Apache-2.0
"""A scanner carried in the hand: bags without odometry run on a constant velocity, and say so."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tests.slam.logs.foreign_bags as bags
from slam import create, se2
from slam.constant_velocity import ConstantVelocity, standing
from slam.errors import LogFormatError
from slam.estimate import Estimate
from slam.logs import open_log
from slam.replay import Replay
from tests.world2d import Drive, World2D, arena, frames, laser

S = 1_000_000_000


def estimate(stamp_ns, pose, converged=True):
    return Estimate(
        stamp_ns=stamp_ns, T_map_robot=pose, covariance=np.eye(3) * 1e-4, converged=converged
    )


def carried(seconds=12.0):
    """A walk in the arena, 0.9 m/s with turns to both sides, at 20 Hz."""
    pieces = [(0.9, 0.8, 2.0), (0.9, -0.6, 1.5), (0.6, 1.2, 2.5), (0.9, 0.3, 2.0)] * 3
    drive = Drive((-1.0, -1.5, 0.0), tuple(pieces))
    stream = frames(World2D(arena()), drive, rate_hz=20.0, spec=laser(181), seed=3)
    return [frame for frame in stream if frame.stamp < seconds]


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A bag of ROS 1 with scans and nothing else, and its frames."""
    made, make = carried(), bags.Maker(ros1=True)
    angles = made[0].scan.spec.angles
    geometry = {
        "angle_min": float(angles[0]), "angle_max": float(angles[-1]),
        "angle_increment": math.pi / 180.0, "range_max": 80.0,
    }  # fmt: skip
    start = bags.START_NS
    messages = [make.scan(start + f.stamp_ns, f.scan.ranges, **geometry) for f in made]
    return bags.write_ros1(tmp_path_factory.mktemp("bag") / "hand.bag", messages), made


def test_a_hand_held_bag_of_ros_1_is_followed(bag, caplog):
    path, made = bag
    stream = open_log(path)
    (record,) = caplog.records
    assert f"no odometry: {len(made)} scans" in record.getMessage()
    assert stream.metadata.source == "rosbag1"
    assert not stream.metadata.odometry
    replay = Replay.of({"shunting": create("shunting")})
    assert sum(1 for _ in replay.run(stream)) == len(made)
    first = se2.compose(made[0].truth, [0.1, 0.0, 0.0])  # the laser is all that is known
    errors = []
    for given, frame in zip(replay.tracks["shunting"].estimates, made, strict=True):
        laser_now = se2.compose(frame.truth, [0.1, 0.0, 0.0])
        errors.append(np.hypot(*(given.T_map_robot - se2.between(first, laser_now))[:2]))
    assert max(errors) < 0.15
    with pytest.raises(LogFormatError, match=r"no message of nav_msgs.*--strict"):
        open_log(path, strict=True)


def test_the_motion_goes_on_as_it_was():
    prior = ConstantVelocity()
    frame = carried(0.2)[0]
    poses = [np.zeros(3), se2.exp([1.0, 0.0, 0.5], 0.1)]
    estimates = []
    for k, pose in enumerate(poses):
        stamp_ns = k * S // 10
        prior.frame(at(frame, stamp_ns), estimates)
        estimates.append(estimate(stamp_ns, pose))
    before = prior.frame(at(frame, S // 5), estimates).odometry
    moved = se2.between(np.zeros(3), before.T_odom_robot)
    np.testing.assert_allclose(moved, se2.exp([1.0, 0.0, 0.5], 0.1), atol=1e-9)
    np.testing.assert_allclose(before.twist, [1.0, 0.0, 0.5], atol=1e-9)
    lost = [*estimates, estimate(S // 5, se2.exp([1.0, 0.0, 0.5], 0.2), converged=False)]
    after = prior.frame(at(frame, 3 * S // 10), lost).odometry
    np.testing.assert_array_equal(after.T_odom_robot, before.T_odom_robot)
    assert after.increment_covariance[0, 0] > before.increment_covariance[0, 0]
    late = prior.frame(at(frame, 10 * S), lost).odometry
    np.testing.assert_array_equal(late.T_odom_robot, before.T_odom_robot)


def at(frame, stamp_ns):
    scan = replace(frame.scan, stamp_ns=stamp_ns)
    return replace(frame, stamp_ns=stamp_ns, scan=scan, odometry=standing(stamp_ns, None))
