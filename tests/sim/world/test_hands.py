# SPDX-License-Identifier: Apache-2.0
"""Hands from outside: what they move moves as asked, and where they cannot they say why."""

import math

import pytest

from sim.world import hands
from sim.world.world import World
from slam.errors import InvalidValueError, UnknownNameError


@pytest.fixture(scope="module")
def world() -> World:
    return World("apartment", seed=0, dynamism=0.0)


def go(world: World, seconds: float) -> None:
    for _ in range(round(seconds * 300)):
        world.substep()


def test_a_pushed_chair_goes_where_it_is_pushed(world: World):
    before = world.mover_poses()
    name = max(hands.pushable(world), key=lambda n: _free(world, n, before))
    row = world.mover_names.index(name)
    heading = _away(world, row, before)
    assert hands.push(world, name, 0.8, heading) == pytest.approx(0.8)
    go(world, 0.2)
    speed = float(world.mover_speeds()[row])
    assert 0.3 < speed < 1.0
    go(world, 0.6)
    dx, dy = (world.mover_poses()[row] - before[row])[:2].tolist()
    assert math.hypot(dx, dy) > 0.05
    assert dx * math.cos(heading) + dy * math.sin(heading) > 0.9 * math.hypot(dx, dy)


def _free(world: World, name: str, poses) -> float:
    """m to the nearest other thing."""
    row = world.mover_names.index(name)
    return min(math.hypot(*(poses[row] - pose)[:2]) for k, pose in enumerate(poses) if k != row)


def _away(world: World, row: int, poses) -> float:
    """From the nearest other thing."""
    near = min(
        (k for k in range(len(poses)) if k != row),
        key=lambda k: math.hypot(*(poses[row] - poses[k])[:2]),
    )
    dx, dy = (poses[row] - poses[near])[:2].tolist()
    return math.atan2(dy, dx)


def test_a_door_is_held_open_then_closes_by_itself(world: World):
    name = world.doors.names[0]
    d, at = 0, int(world.doors.addresses[0, 0])
    rest = float(world.data.qpos[at])
    hands.hold_door(world, name, opened=True, seconds=3.0)
    go(world, 3.0)
    opened = float(world.data.qpos[at])
    high = float(world.doors.leaves.limits[d, 1])
    assert opened > min(rest + 0.3, 0.8 * high)
    hands.hold_door(world, name, opened=False, seconds=4.0)
    go(world, 3.5)
    assert float(world.data.qpos[at]) < 0.2
    go(world, 6.0)
    assert float(world.data.qpos[at]) == pytest.approx(rest, abs=0.2)


def test_the_robot_is_carried_to_free_floor_only(world: World):
    x, y, yaw = hands.free_goal(world)
    hands.carry(world, (x, y, yaw))
    assert world.robot_pose().tolist() == pytest.approx([x, y, yaw])
    assert not hands.in_the_way(world, x, y)  # itself is not
    in_its_place = {
        name: hands.in_the_way(world, *pose[:2].tolist())
        for name, pose in zip(world.mover_names, world.mover_poses(), strict=True)
    }
    assert all(words for name, words in in_its_place.items() if name != "robot")
    name = next(name for name, words in in_its_place.items() if words == f"{name} is there")
    place = world.mover_poses()[world.mover_names.index(name)]
    with pytest.raises(InvalidValueError, match=f"{name} is there"):
        hands.carry(world, place)
    cx, cy = world.scene.obstacles[0, :2].tolist()
    with pytest.raises(InvalidValueError, match=r"is there|the floor reaches"):
        hands.carry(world, (cx, cy, 0.0))
    with pytest.raises(InvalidValueError, match="the floor reaches from"):
        hands.carry(world, (1e6, 0.0, 0.0))
    with pytest.raises(InvalidValueError, match="to a finite pose only"):
        hands.carry(world, (math.nan, 0.0, 0.0))
    assert world.robot_pose().tolist() == pytest.approx([x, y, yaw])


def test_what_cannot_be_pushed_or_opened_is_named(world: World):
    with pytest.raises(UnknownNameError, match="nothing called 'robot' can be pushed here, only: "):
        hands.push(world, "robot", 1.0, 0.0)
    with pytest.raises(InvalidValueError, match="a push must have a speed"):
        hands.push(world, hands.pushable(world)[0], 9.0, 0.0)
    with pytest.raises(UnknownNameError, match="there is no door 'x' here, doors: "):
        hands.hold_door(world, "x", opened=True, seconds=1.0)
    with pytest.raises(InvalidValueError, match="up to 600 s"):
        hands.hold_door(world, world.doors.names[0], opened=True, seconds=1e4)
    assert hands.nearest(world, [], 0.0, 0.0) == ("", math.inf)
