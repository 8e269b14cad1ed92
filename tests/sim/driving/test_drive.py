# SPDX-License-Identifier: Apache-2.0
"""The driver reaches goals behind walls, keeps its distance, and gives up what it cannot reach."""

import math

import numpy as np
import pytest

from sim.driving.drive import Driver, TourConfig, tour
from sim.driving.navgrid import NavGrid
from slam.errors import InvalidValueError

ROOM = (0.0, 0.0, 6.0, 4.0)
WALL = np.array([[3.0, 1.5, 0.1, 1.5, 0.0]])  # leaves a 1 m gap at the top
NOBODY = np.zeros((0, 5))


def drive(driver: Driver, start, seconds: float, discs=lambda t: NOBODY):
    """A unicycle that does at once what it is told; returns the path (n, 3)."""
    pose, velocity, path = np.array(start, dtype=float), (0.0, 0.0), []
    for k in range(int(seconds / 0.05)):
        velocity = driver.command(pose, velocity, discs(0.05 * k), 0.05)
        pose = pose + 0.05 * np.array(
            [velocity[0] * math.cos(pose[2]), velocity[0] * math.sin(pose[2]), velocity[1]]
        )
        path.append(pose)
    return np.array(path)


def test_cost_is_the_way_round_the_wall_and_infinite_without_one():
    grid = NavGrid(ROOM, WALL, 0.3)
    to_goal = grid.cost_to(np.array([5.0, 0.8]))
    assert grid.lookup(to_goal, 1.0, 0.8) > 2.0 * math.hypot(2.0, 2.5)
    closed = NavGrid(ROOM, np.array([[3.0, 2.0, 0.1, 2.0, 0.0]]), 0.3)
    assert closed.lookup(closed.cost_to(np.array([5.0, 0.8])), 1.0, 0.8) >= 1e6


def test_clearance_is_the_distance_to_the_nearest_box_and_never_too_large():
    grid = NavGrid(ROOM, WALL, 0.3, cell=0.05)
    assert 0.8 <= grid.lookup(grid.clearance, 2.0, 1.5) <= 0.9
    assert 0.42 <= grid.lookup(grid.clearance, 0.525, 2.0) <= 0.525


def test_a_wall_thinner_than_a_cell_has_no_holes():
    thin = np.array([[3.03, 2.0, 0.01, 3.0, 0.02]])
    grid = NavGrid(ROOM, thin, 0.05)
    assert grid.lookup(grid.cost_to(np.array([5.0, 1.0])), 1.0, 1.0) >= 1e6


def test_it_drives_round_the_wall_without_touching_it():
    grid = NavGrid(ROOM, WALL, 0.3)
    driver = Driver(grid, np.array([[5.0, 0.8]]), TourConfig())
    path = drive(driver, (1.0, 0.8, 0.0), 30.0)
    assert driver.visited >= 1
    clear = [grid.lookup(grid.clearance, x, y) for x, y, _ in path]
    assert min(clear) > 0.2


def test_it_lets_a_walker_cross():
    grid = NavGrid(ROOM, np.zeros((0, 5)), 0.3)
    driver = Driver(grid, np.array([[5.0, 2.0]]), TourConfig())

    def walker(t: float):
        return np.array([[2.6, 3.6 - 0.9 * t, 0.25, 0.0, -0.9]])

    path = drive(driver, (1.0, 2.0, 0.0), 12.0, walker)
    places = [walker(0.05 * k)[0, :2] for k in range(len(path))]
    gaps = [math.dist(place, pose[:2]) for place, pose in zip(places, path, strict=True)]
    assert min(gaps) > 0.25 + 0.25
    assert driver.visited >= 1


def test_a_goal_out_of_reach_is_given_up_for_the_next():
    closed = np.array([[3.0, 2.0, 0.1, 2.0, 0.0]])
    driver = Driver(
        NavGrid(ROOM, closed, 0.3), np.array([[5.0, 2.0], [1.0, 3.2]]), TourConfig(patience_s=2.0)
    )
    drive(driver, (1.0, 0.8, 0.0), 15.0)
    assert driver.visited >= 1


def test_a_tour_visits_every_goal_in_an_order_of_its_own_seed():
    goals = {"a": (0.0, 0.0), "b": (1.0, 0.0), "c": (2.0, 0.0), "d": (3.0, 0.0)}
    same, again, other = (tour(goals, np.random.default_rng(s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(same, again)
    assert not np.array_equal(same, other)
    assert sorted(same[:, 0]) == [0.0, 1.0, 2.0, 3.0]


def test_wrong_limits_and_an_empty_tour_are_refused():
    with pytest.raises(InvalidValueError, match=r"TourConfig\.v_max_mps"):
        TourConfig(v_max_mps=0.0)
    with pytest.raises(InvalidValueError, match="at least one goal"):
        Driver(NavGrid(ROOM, WALL, 0.3), np.zeros((0, 2)), TourConfig())
