# SPDX-License-Identifier: Apache-2.0
"""What makes a robot doubt where it is, and what does not: shoves, symmetric rooms, few things."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slam import se2
from slam.frames import Frame, Odometry, Scan
from slam.shunting import ShuntingConfig, ShuntingSlam
from tests.world2d import Drive, World2D, arena, frames, going_on, rectangle

Array = NDArray[np.float64]
FAST = ShuntingConfig(cell_m=0.05)
START = (0.0, 0.0, 0.0)
TURN = Drive(START, ((0.0, 0.8, 12.0),))  # long enough for a map to be trusted


def still(world: World2D, pose: tuple[float, float, float], seconds: float) -> list[Frame]:
    return frames(world, Drive(pose, ((0.0, 0.0, seconds),)), rate_hz=5.0, seed=3)


def posts(dx: float = 0.0, dy: float = 0.0) -> World2D:
    """Six posts with nothing behind them, moved by so much."""
    corners = [(2.0, 0.0), (0.5, 1.8), (1.0, -1.5), (-2.0, 0.3), (-1.0, 1.6), (-0.6, -2.0)]
    boxes = [rectangle(x + dx, y + dy, x + dx + 0.2, y + dy + 0.2) for x, y in corners]
    return World2D(np.vstack(boxes))


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
    before = frames(posts(), TURN, rate_hz=5.0, seed=3)
    system = ShuntingSlam(FAST)
    states_of(system, before)
    truth = before[-1].truth
    assert truth is not None
    pose = tuple(float(v) for v in truth)
    after = going_on(still(posts(0.5, -0.4), pose, 6.0), before[-1])  # type: ignore[arg-type]
    assert set(states_of(system, after)) == {"tracking"}
    np.testing.assert_allclose(system.trajectory().poses[-1], pose, atol=0.1)


def test_a_robot_carried_to_where_all_in_view_hides_the_map_knows_it() -> None:
    """Nothing there contradicts the map: the near wall stands before everything it shows."""
    world = World2D(np.vstack([arena(), rectangle(-2.0, 1.0, -1.2, 2.2)]))
    before = frames(world, Drive(START, ((0.0, 0.8, 24.0),)), rate_hz=5.0, seed=3)
    system = ShuntingSlam(FAST)
    states_of(system, before)
    after = going_on(still(world, (-2.6, 1.5, 2.2), 2.0), before[-1])
    assert states_of(system, after)[:3] == ["frozen"] * 3


def test_after_a_blind_stretch_all_its_odometry_is_in_doubt_not_only_the_last_step() -> None:
    world, system = World2D(arena()), ShuntingSlam(FAST)
    before = frames(world, TURN, rate_hz=5.0, seed=3)
    states_of(system, before)
    x, y, heading = (float(v) for v in system.trajectory().poses[-1])
    dark = blind_turn(before[-1], steps=400, said_rad=0.02, sd_rad=0.005)
    assert set(states_of(system, dark)) == {"blind"}
    there = (x, y, heading + 400 * 0.02 + 0.25)  # 2.5 standard deviations of all steps, 50 of one
    for frame in going_on(still(world, there, 1.0), dark[-1], 0.03):
        estimate = system.update(frame.without_truth())
        assert estimate.diagnostics["state"] == "tracking"
        error = estimate.T_map_robot - np.array(there)
        assert math.hypot(float(error[0]), float(error[1])) < 0.02
        assert abs(se2.wrap(float(error[2]))) < math.radians(1.2)


def blind_turn(last: Frame, *, steps: int, said_rad: float, sd_rad: float) -> list[Frame]:
    """Frames without a return, whose odometry turns on the spot, by so much a step."""
    assert last.scan is not None
    out = []
    for step in range(1, steps + 1):
        stamp = last.stamp_ns + step * 200_000_000
        turn = np.array([0.0, 0.0, step * said_rad])
        odometry = Odometry(
            stamp_ns=stamp,
            T_odom_robot=se2.compose(last.odometry.T_odom_robot, turn),
            increment_covariance=np.diag([1e-6, 1e-6, sd_rad**2]),
        )
        ranges = np.full_like(last.scan.ranges, np.nan)
        scan = Scan(stamp_ns=stamp, ranges=ranges, spec=last.scan.spec)
        out.append(Frame(stamp_ns=stamp, odometry=odometry, scan=scan))
    return out


def carried(budget_ms: float) -> tuple[list[str], list[float], Array]:
    """States of a robot that is carried elsewhere, the work of each scan, the last error."""
    config = FAST.changed({"matching.budget.budget_ms": budget_ms})
    world = World2D(np.vstack([arena(), rectangle(-2.0, 1.0, -1.2, 2.2)]))
    before = frames(world, TURN, rate_hz=5.0, seed=3)
    system = ShuntingSlam(config)
    states_of(system, before)
    drive = Drive((2.0, -2.0, 2.0), ((0.2, 0.3, 8.0),))
    states, spent = [], []
    after = going_on(frames(world, drive, rate_hz=5.0, seed=7), before[-1])
    for frame in after:
        states.append(system.update(frame.without_truth()).diagnostics["state"])
        spent.append(0.0)
        looking = system._recovery.search or system._recovery.suspected
        if looking is not None and states[-1] in ("frozen", "lost"):
            spent[-1] = looking.spent_ns
    truth = after[-1].truth
    assert truth is not None
    return states, spent, system.trajectory().poses[-1] - np.asarray(truth)


@pytest.mark.parametrize("budget_ms", [10.0, 20.0, 1e6])
def test_no_scan_of_a_lost_robot_does_more_than_its_budget_and_it_is_found(
    budget_ms: float,
) -> None:
    states, spent, off = carried(budget_ms)
    assert "lost" in states
    assert states[-1] == "tracking"
    assert float(np.hypot(off[0], off[1])) < 0.03
    counted = FAST.matching.budget.lost_share * budget_ms * 1e6
    match_ns = 361 * FAST.matching.budget.climb_ns + 90 * FAST.matching.budget.approach_ns
    assert 0.0 < max(spent) <= counted + match_ns  # the item at which it is spent
