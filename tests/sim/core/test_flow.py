# SPDX-License-Identifier: Apache-2.0
"""Clearance and ways on floors whose answer is known."""

import math

import numpy as np
import pytest

from sim.actors.config import STEER
from sim.actors.people.avoidance import impact_time
from sim.core.flow import FAR, FlowMap, box_clearance, clearance_at, time_at, way_at

BOUNDS = (0.0, 0.0, 10.0, 6.0)
WALL_WITH_DOOR = np.array([[5.0, 1.5, 0.06, 1.5, 0.0], [5.0, 5.0, 0.06, 1.0, 0.0]])  # gap 3..4


def test_clearance_of_a_turned_box():
    box = np.array([[2.0, 1.0, 1.0, 0.5, math.pi / 2.0]])  # now 1 wide, 2 high
    assert box_clearance(3.5, 1.0, box) == pytest.approx(1.0)
    assert box_clearance(2.5 + 0.3, 2.0 + 0.4, box) == pytest.approx(0.5)
    assert box_clearance(2.0, 1.0, box) == pytest.approx(-0.5)


def test_clearance_is_exact_between_nodes():
    field = FlowMap(BOUNDS, WALL_WITH_DOOR, np.array([[1.0, 1.0]])).field
    rng = np.random.default_rng(0)
    for x, y in rng.uniform([0.3, 0.3], [9.7, 5.7], (200, 2)):
        exact = min(box_clearance(x, y, WALL_WITH_DOOR), x, 10.0 - x, y, 6.0 - y, 1.0)
        assert clearance_at(field, x, y) == pytest.approx(exact, abs=0.05)
    assert clearance_at(field, -1.0, 2.0) == -1.0


def test_on_open_floor_time_is_distance_and_the_way_is_straight():
    field = FlowMap((0, 0, 12, 12), np.zeros((0, 5)), np.array([[6.0, 6.0]])).field
    rng = np.random.default_rng(1)
    for x, y in rng.uniform(2.0, 10.0, (100, 2)):
        distance = math.hypot(x - 6.0, y - 6.0)
        if distance < 0.5:
            continue
        assert time_at(field, 0, x, y) == pytest.approx(distance, rel=0.06, abs=0.15)
        wx, wy = way_at(field, 0, x, y)
        assert (wx * (6.0 - x) + wy * (6.0 - y)) / distance > math.cos(math.radians(12))


def test_the_way_leads_through_the_door():
    goal = np.array([[9.0, 1.0]])
    field = FlowMap(BOUNDS, WALL_WITH_DOOR, goal).field
    x, y, crossed = 1.0, 1.0, None
    for _ in range(2000):
        wx, wy = way_at(field, 0, x, y)
        before = x
        x, y = x + 0.01 * wx, y + 0.01 * wy
        assert clearance_at(field, x, y) > 0.2
        if before < 5.0 <= x:
            crossed = y
    assert crossed == pytest.approx(3.5, abs=0.2)
    assert math.hypot(x - 9.0, y - 1.0) < 0.2


def test_no_way_is_said_so():
    closed = np.array([[5.0, 3.0, 0.06, 3.0, 0.0]])
    field = FlowMap(BOUNDS, closed, np.array([[9.0, 1.0]])).field
    assert time_at(field, 0, 1.0, 1.0) >= FAR
    assert time_at(field, 0, 8.0, 1.0) < 2.0


def test_a_walker_in_a_wall_is_led_out():
    field = FlowMap(BOUNDS, WALL_WITH_DOOR, np.array([[9.0, 1.0]])).field
    for x in (5.08, 5.15):
        assert way_at(field, 0, x, 1.0)[0] > 0.5


def test_ways_go_around_a_leaf_that_stands_open():
    leaf = np.array([[3.0, 1.5, 0.03, 1.0, 0.0]])
    plain, around = (
        FlowMap(BOUNDS, np.zeros((0, 5)), np.array([[5.0, 1.0]]), leaves=leaves).field
        for leaves in (None, leaf)
    )
    assert time_at(around, 0, 1.0, 1.0) > time_at(plain, 0, 1.0, 1.0) + 0.3
    assert time_at(around, 0, 3.0, 1.5) < FAR


def test_impact_time_of_discs():
    assert impact_time(3.0, 0.0, 2.0, 0.0, 1.0) == pytest.approx(1.0)
    assert impact_time(3.0, 0.0, -2.0, 0.0, 1.0) == STEER.horizon_s
    assert impact_time(3.0, 1.01, 2.0, 0.0, 1.0) == STEER.horizon_s
    assert impact_time(0.5, 0.0, 1.0, 0.0, 1.0) == 0.0
    assert impact_time(0.5, 0.0, -1.0, 0.0, 1.0) == STEER.horizon_s
