# SPDX-License-Identifier: Apache-2.0
"""The oracle by the true map: a known pose is found again, and a crowd does not make it lost."""

import math

import numpy as np
import pytest

import slam
from slam import se2
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.frames import Frame, LaserSpec, Odometry, Scan
from slam.oracle_map import MapOracle
from tests.world2d import frame_at

CELL_M = 0.02
SPEC = LaserSpec(n_beams=181, angle_min=-math.pi / 2, angle_increment=math.radians(1.0))
START = np.array([2.0, 0.3, 0.7])  # in the world


def room() -> Raster:
    """8 m x 6 m with a pillar, walls of 10 cm; its corner lies at (-1, -1) m in the world."""
    values = np.zeros((300, 400), dtype=np.float32)
    for wall in (np.s_[:5], np.s_[-5:], np.s_[:, :5], np.s_[:, -5:], np.s_[200:220, 250:270]):
        values[wall] = 1.0
    return Raster(values=values, resolution_m=CELL_M, T_map_origin=np.array([-1.0, -1.0, 0.0]))


def scan_at(T_world_robot: np.ndarray, world: Raster) -> np.ndarray:
    """(181,) m, marched in steps of 5 mm."""
    reach = np.arange(0.0, 10.0, 0.005)
    angles = SPEC.angles + T_world_robot[2]
    x = T_world_robot[0] + 1.0 + reach * np.cos(angles)[:, None]
    y = T_world_robot[1] + 1.0 + reach * np.sin(angles)[:, None]
    column = np.clip((x / CELL_M).astype(int), 0, 399)
    row = np.clip((y / CELL_M).astype(int), 0, 299)
    return reach[(world.values[row, column] > 0.5).argmax(axis=1)]


def drive(hidden: float) -> float:
    """Greatest error, m, over 4 m of an arc whose odometry turns 3 degrees a metre too much.

    hidden  share of the beams that meet somebody who walks in front of the walls
    """
    world, oracle, rng = room(), MapOracle(), np.random.default_rng(3)
    oracle.know(world, START)
    truth, wheels, worst = np.zeros(3), np.zeros(3), 0.0
    for k in range(40):
        ranges = scan_at(se2.compose(START, truth), world)
        ranges += rng.normal(0.0, 0.01, len(ranges))
        first = rng.integers(0, SPEC.n_beams)
        crowd = (first + np.arange(int(hidden * SPEC.n_beams))) % SPEC.n_beams
        ranges[crowd] = np.minimum(ranges[crowd], rng.uniform(0.4, 0.8))
        scan = Scan(stamp_ns=k * 10**8, ranges=ranges.astype(np.float32), spec=SPEC)
        odometry = Odometry(stamp_ns=k * 10**8, T_odom_robot=wheels)
        said = oracle.update(Frame(stamp_ns=k * 10**8, odometry=odometry, scan=scan))
        worst = max(worst, float(np.abs(se2.between(truth, said.T_map_robot))[:2].max()))
        truth = se2.compose(truth, np.array([0.1, 0.0, 0.04]))
        wheels = se2.compose(wheels, np.array([0.1, 0.0, 0.04 + math.radians(0.3)]))
    assert said.converged
    assert len(oracle.trajectory()) == 40
    return worst


def test_a_known_pose_is_found_again():
    assert drive(hidden=0.0) < 0.02


def test_a_crowd_in_front_of_half_of_the_walls_does_not_make_it_lost():
    assert drive(hidden=0.5) < 0.02


@pytest.mark.parametrize("moved", [(0.1, 0.0, 1.0), (2.5, 1.8, -2.0)], ids=["turned", "carried"])
def test_a_pose_at_which_beams_pass_through_walls_is_looked_for_again(moved):
    """The wheels notice nothing, and somebody hides a third of the walls."""
    world, oracle = room(), MapOracle()
    oracle.know(world, START)
    for k, truth in enumerate((np.zeros(3), np.zeros(3), np.array(moved))):
        ranges = scan_at(se2.compose(START, truth), world)
        ranges[20:80] = np.minimum(ranges[20:80], 0.6)
        scan = Scan(stamp_ns=k * 10**8, ranges=ranges.astype(np.float32), spec=SPEC)
        wheels = Odometry(stamp_ns=k * 10**8, T_odom_robot=np.zeros(3))
        said = oracle.update(Frame(stamp_ns=k * 10**8, odometry=wheels, scan=scan))
    assert said.converged
    assert np.abs(se2.between(truth, said.T_map_robot)).max() < 0.03


def test_it_is_a_control_that_must_be_shown_the_map():
    oracle = slam.create("oracle(map)")
    ones = np.ones(SPEC.n_beams)
    frame = frame_at(0, ranges=ones, spec=SPEC)
    with pytest.raises(InvalidValueError, match=r"oracle\(map\) needs the true map"):
        oracle.update(frame)
    bare = Raster(values=np.zeros((9, 9), np.float32), resolution_m=0.02, T_map_origin=START)
    oracle.know(bare, START)
    oracle.update(frame)
    said = oracle.update(frame_at(10**8, (0.1, 0.0, 0.0), ones, SPEC))
    assert not said.converged  # no walls: odometry's
    assert said.T_map_robot.tolist() == [0.1, 0.0, 0.0]
    assert "map" not in slam.system.names()
