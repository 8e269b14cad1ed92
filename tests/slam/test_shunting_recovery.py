# SPDX-License-Identifier: Apache-2.0
"""What makes a robot doubt where it is, and what does not: shoves, symmetric rooms, few things."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.frames import Frame, Odometry, Scan
from slam.shunting import ShuntingConfig, ShuntingSlam
from tests.world2d import Drive, World2D, arena, frames, rectangle

Array = NDArray[np.float64]
FAST = ShuntingConfig(cell_m=0.05)
START = (0.0, 0.0, 0.0)
TURN = Drive(START, ((0.0, 0.8, 12.0),))  # long enough for a map to be trusted


def going_on(stream: list[Frame], last: Frame, seconds: float = 0.2) -> list[Frame]:
    """The stream with stamps and odometry that go on from ``last`` as if nothing was."""
    out = []
    for frame in stream:
        stamp = last.stamp_ns + round(seconds * 1e9) + frame.stamp_ns
        assert frame.scan is not None
        odometry = Odometry(
            stamp_ns=stamp,
            T_odom_robot=se2.compose(last.odometry.T_odom_robot, frame.odometry.T_odom_robot),
            increment_covariance=frame.odometry.increment_covariance,
            twist=frame.odometry.twist,
        )
        scan = Scan(stamp_ns=stamp, ranges=frame.scan.ranges, spec=frame.scan.spec)
        out.append(Frame(stamp_ns=stamp, odometry=odometry, scan=scan, truth=frame.truth))
    return out


def still(world: World2D, pose: tuple[float, float, float], seconds: float) -> list[Frame]:
    return frames(world, Drive(pose, ((0.0, 0.0, seconds),)), rate_hz=5.0, seed=3)


def states_of(system: ShuntingSlam, stream: list[Frame]) -> list[str]:
    return [system.update(frame.without_truth()).diagnostics["state"] for frame in stream]


def test_a_standing_robot_that_is_shoved_is_followed_at_once() -> None:
    """Wheels that were pushed aside count nothing: no prior of theirs may hold the match."""
    world = World2D(arena())
    before = frames(world, TURN, rate_hz=5.0, seed=3)
    system = ShuntingSlam(FAST)
    states_of(system, before)
    x, y, heading = (float(v) for v in system.trajectory().poses[-1])
    aside = (x + 0.06, y - 0.03, heading + math.radians(6.0))
    for frame in going_on(still(world, aside, 2.0), before[-1]):
        estimate = system.update(frame.without_truth())
        assert estimate.diagnostics["state"] == "tracking"
        error = estimate.T_map_robot - np.array(aside)
        assert math.hypot(float(error[0]), float(error[1])) < 0.015
        assert abs(se2.wrap(float(error[2]))) < math.radians(0.4)


def test_in_a_symmetric_room_dead_reckoning_says_which_of_two_places() -> None:
    hall = World2D(rectangle(-5.0, -3.0, 5.0, 3.0))
    before = frames(hall, TURN, rate_hz=5.0, seed=3)
    system = ShuntingSlam(FAST)
    states_of(system, before)
    pose = tuple(float(v) for v in system.trajectory().poses[-1])
    elsewhere = World2D(rectangle(-7.0, -9.0, 8.0, 6.0))  # mirrors, say
    hidden = going_on(still(elsewhere, pose, 1.4), before[-1])  # type: ignore[arg-type]
    assert "lost" in states_of(system, hidden)
    after = going_on(still(hall, pose, 4.0), hidden[-1])  # type: ignore[arg-type]
    states = states_of(system, after)
    assert states[-1] == "tracking"
    np.testing.assert_allclose(system.trajectory().poses[-1], pose, atol=0.03)


def test_a_few_things_that_all_moved_do_not_make_a_robot_lost() -> None:
    """They may have moved as well as the robot: that is no evidence against the odometry."""
    posts = [(2.0, 0.0), (0.5, 1.8), (1.0, -1.5), (-2.0, 0.3), (-1.0, 1.6), (-0.6, -2.0)]

    def world(dx: float, dy: float) -> World2D:
        boxes = [rectangle(x + dx, y + dy, x + dx + 0.2, y + dy + 0.2) for x, y in posts]
        return World2D(np.vstack(boxes))

    before = frames(world(0.0, 0.0), TURN, rate_hz=5.0, seed=3)
    system = ShuntingSlam(FAST)
    states_of(system, before)
    truth = before[-1].truth
    assert truth is not None
    pose = tuple(float(v) for v in truth)
    after = going_on(still(world(0.5, -0.4), pose, 6.0), before[-1])  # type: ignore[arg-type]
    assert set(states_of(system, after)) == {"tracking"}
    np.testing.assert_allclose(system.trajectory().poses[-1], pose, atol=0.1)
