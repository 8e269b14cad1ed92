# SPDX-License-Identifier: Apache-2.0
"""Other robots: the scenes' own by name changes no byte; a car turns no tighter than it can."""

import copy
from pathlib import Path

import numpy as np
import pytest

from sim.simulation import Simulation, tour
from sim.world.robots import names, read_robot, robot_of
from slam import se2
from slam.errors import InvalidValueError, LogFormatError, UnknownNameError


def _driven(seconds: float, **more: object) -> tuple[Simulation, list]:
    simulation = Simulation("arena", seed=4, dynamism=0.3, laser="tim561:noise", **more)
    return simulation, list(tour(simulation, seconds))


def test_the_scenes_own_robot_by_its_name_gives_the_same_bytes() -> None:
    for ours, named in zip(_driven(3.0)[1], _driven(3.0, robot="pioneer3dx")[1], strict=True):
        np.testing.assert_array_equal(ours.scan.ranges, named.scan.ranges)
        np.testing.assert_array_equal(ours.odometry.T_odom_robot, named.odometry.T_odom_robot)


def test_a_car_turns_no_tighter_than_it_can() -> None:
    simulation, frames = _driven(6.0, robot="f1tenth", odometry="ideal")
    poses = np.array([frame.truth for frame in frames])
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    turns = np.abs(np.diff(np.unwrap(poses[:, 2])))
    assert steps.sum() > 1.0
    assert (turns <= 1.1 * steps / 0.742 + 2e-3).all()
    assert simulation.spec.T_robot_laser[0] == pytest.approx(0.27)
    assert simulation.world.scene.scan_height_m == pytest.approx(0.15)


def test_a_small_robot_keeps_its_own_pace_and_clearance() -> None:
    simulation, frames = _driven(3.0, robot="turtlebot3")
    poses = np.array([frame.truth for frame in frames])
    assert np.hypot(*(poses[-1] - poses[0])[:2]) < 0.22 * 3.0
    row = simulation.world.bodies.robot
    assert simulation.world.bodies.radius[row] == pytest.approx(0.1126 + 0.032, abs=1e-3)


def test_wheels_that_roll_sideways_go_where_they_are_asked_to() -> None:
    simulation = Simulation(
        "arena", seed=4, dynamism=0.0, robot="rosbot_xl", odometry="ideal", n_chairs=0, crowd="none"
    )
    start, asked = simulation.world.robot_pose().copy(), (0.2, 0.5, -0.3)
    simulation.world.set_command(*asked)
    frames = [simulation.observe() for _ in range(60)]
    ended, seconds = frames[-1], (frames[-1].stamp_ns - frames[30].stamp_ns) / 1e9
    step = se2.between(frames[30].truth, ended.truth)
    wanted = se2.exp((asked[0], asked[2], asked[1]), seconds)  # once the ramp is over
    np.testing.assert_allclose(step, wanted, atol=0.01)
    told = se2.between(frames[30].odometry.T_odom_robot, ended.odometry.T_odom_robot)
    np.testing.assert_allclose(told, step, atol=0.01)  # x ahead, y left, as SLAMs take it
    assert ended.odometry.twist[1] == pytest.approx(-0.3, abs=0.01)
    assert not np.allclose(start, simulation.world.robot_pose())


def test_obliquely_the_limit_is_the_same_and_so_is_the_direction() -> None:
    world = Simulation("arena", seed=4, dynamism=0.0, robot="rosbot_xl").world
    world.set_command(3.0, 0.0, -4.0)
    asked = world._drive.state[0]
    assert (asked["asked_v"], asked["asked_side"]) == pytest.approx((0.6 * 0.8, -0.8 * 0.8))


def test_a_robot_that_cannot_drive_sideways_says_so() -> None:
    with pytest.raises(InvalidValueError, match="cannot drive sideways"):
        Simulation("arena", seed=4, dynamism=0.0).world.set_command(0.1, 0.0, 0.2)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("drive", "kind"), "omni", "drive.kind must be one of"),
        (("drive", "track_m"), -1.0, "drive.track_m must be a number from"),
        (("drive", "turn_radius_m"), 0.4, "turn_radius_m is what a car has"),
        (("footprint", "radius_m"), 0.1, "see footprint.radius_m"),
        (("scanner", "pitch_deg"), 1.0, "robot.scanner: unknown key .pitch_deg."),
    ],
)
def test_a_wrong_field_is_named(path: tuple[str, str], value: object, said: str) -> None:
    tables = copy.deepcopy(read_robot("turtlebot3"))
    tables[path[0]][path[1]] = value
    with pytest.raises(InvalidValueError, match=said):
        robot_of(tables)


def test_robots_by_name_or_file(tmp_path: Path) -> None:
    assert {"turtlebot3", "pioneer3dx", "f1tenth"} <= set(names())
    with pytest.raises(UnknownNameError, match="no robot is called 'husky'"):
        read_robot("husky")
    (tmp_path / "mine.toml").write_text('name = "mine"\nmass_kg = 0\n')
    with pytest.raises(LogFormatError, match="mass_kg must be a number from"):
        read_robot(str(tmp_path / "mine.toml"))
