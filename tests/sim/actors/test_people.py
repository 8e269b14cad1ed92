# SPDX-License-Identifier: Apache-2.0
"""People and doors of the office: where they go, what they respect, what gives way to them."""

import math

import numpy as np
import pytest

from sim.actors.people import columns, gait
from sim.core.dynamism import Dynamism
from sim.core.flow import clearance_at
from sim.world.world import SUBSTEPS_PER_S, World

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def walk() -> dict[str, np.ndarray | World]:
    """75 s of a busy office, one sample in 0.1 s."""
    world = World("office", seed=2, dynamism=Dynamism.world_1(0.8))
    people = world.people
    poses, clearances, tasks = [], [], []
    for k in range(75 * SUBSTEPS_PER_S):
        world.substep()
        if k % 30 == 0:
            now = world.mover_poses()[_rows(world, "person")]
            poses.append(now)
            clearances.append([clearance_at(people.table.field, x, y) for x, y, _ in now])
            tasks.append(people.crowd.task.copy())
    return {
        "world": world,
        "poses": np.array(poses),
        "clearances": np.array(clearances),
        "tasks": np.array(tasks),
    }


def _rows(world: World, kind: str) -> list[int]:
    return [i for i, m in enumerate(world.scene.movers) if m.kind == kind]


def test_people_walk_from_room_to_room(walk):
    world, poses = walk["world"], walk["poses"]
    rooms = list(world.scene.rooms.values())
    visited = []
    for person in range(poses.shape[1]):
        inside = {
            r
            for r, (x0, y0, x1, y1) in enumerate(rooms)
            for x, y, _ in poses[:, person]
            if x0 < x < x1 and y0 < y < y1
        }
        visited.append(len(inside))
    assert np.mean(visited) > 3
    arrivals = np.sum(np.diff(walk["tasks"]["walking"], axis=0) < 0)
    assert arrivals > poses.shape[1]


def test_people_keep_clear_of_walls_and_of_one_another_at_human_speed(walk):
    assert walk["clearances"].min() > 0.15
    assert np.quantile(walk["clearances"], 0.01) > 0.22
    xy = walk["poses"][:, :, :2]
    others = ~np.eye(xy.shape[1], dtype=bool)
    gaps = np.linalg.norm(xy[:, :, None] - xy[:, None, :], axis=3)[:, others]
    assert gaps.min() > 0.45
    assert np.mean(gaps < 0.5) < 0.01
    speed = np.linalg.norm(np.diff(xy, axis=0), axis=2) / 0.1
    assert speed.max() < 2.2
    assert 0.7 < np.median(speed[speed > 0.3]) < 1.5
    walked, blocked = walk["world"].people.walked_s()
    assert walked.sum() > 150.0
    assert blocked.sum() / walked.sum() < 0.10
    assert not any(w.number for w in walk["world"].data.warning)


def test_who_has_a_foot_in_the_air_moves():
    world = World("office", seed=2, dynamism=Dynamism.world_1(1.0))
    for _ in range(8 * SUBSTEPS_PER_S):
        world.substep()
    swinging = world.people.swinging()
    assert swinging.any()
    assert world.movers_moving()[_rows(world, "person")][swinging].all()


def _door_angle(world: World, door: str) -> float:
    return float(world.data.qpos[int(world.model.joint(f"{door}/hinge").qposadr[0])])


def test_closed_doors_open_for_a_person_from_both_sides_and_close_behind():
    """A door swings to one side only: who comes from there pulls, who comes to it pushes."""
    world = World(
        "office", seed=3, dynamism=Dynamism(stay_mean=3.0), n_people=1, n_chairs=0, doors="closed"
    )
    rows, person = _rows(world, "door"), _rows(world, "person")[0]
    doors = [world.scene.movers[row].name for row in rows]
    along, sign = world._doors.along, world._doors.hinges[:, 3]
    swings_to = sign[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
    pushed, pulled, rooms, before = 0, 0, set(), np.zeros(len(doors))
    for k in range(75 * SUBSTEPS_PER_S):
        world.substep()
        if k % 30 > 0:
            continue
        place = world.mover_poses()[person, :2]
        offset = place - world._doors.middles
        side = np.sign((offset * swings_to).sum(axis=1)) * (np.linalg.norm(offset, axis=1) < 0.6)
        passed = (side != before) & (side != 0.0) & (before != 0.0)
        pushed += int((passed & (side > 0)).sum())
        pulled += int((passed & (side < 0)).sum())
        before = side
        for name, (x0, y0, x1, y1) in world.scene.rooms.items():
            if x0 < place[0] < x1 and y0 < place[1] < y1:
                rooms.add(name)
    assert len(rooms) >= 3
    assert pushed >= 1
    assert pulled >= 1
    angles = np.array([_door_angle(world, door) for door in doors])
    assert np.sum(angles < 0.02) >= len(doors) - 1


def test_people_push_chairs_out_of_the_doorways_they_want_through():
    """A chair in every doorway, no shoves: who wants through pushes it aside and passes."""
    world = World("office", seed=1, dynamism=Dynamism(stay_mean=2.0), n_people=4, n_chairs=7)
    chairs = [row for kind in ("chair_swivel", "chair_visitor") for row in _rows(world, kind)]
    for row, place in zip(chairs, world._doors.middles, strict=True):
        at = int(world.model.joint(f"{world.scene.movers[row].name}/x").qposadr[0])
        world.data.qpos[at : at + 2] = place
    before = world.mover_poses()[chairs, :2]
    for _ in range(25 * SUBSTEPS_PER_S):
        world.substep()
    moved = np.linalg.norm(world.mover_poses()[chairs, :2] - before, axis=1)
    assert np.sum(moved > 0.5) >= 3
    walked, blocked = world.people.walked_s()
    assert blocked.sum() < 0.3 * walked.sum()


def test_a_door_lets_the_robot_through():
    world = World("office", seed=3, dynamism=0, n_people=0, n_chairs=0)
    row = _rows(world, "door")[0]
    door = world._doors.names.index(world.scene.movers[row].name)
    at = int(world.model.joint(f"{world.scene.movers[row].name}/hinge").qposadr[0])
    world.model.qpos_spring[at] = world.data.qpos[at] = 0.0
    world._doors._closers["rest"][door] = 0.0
    middle, along = world._doors.middles[door], world._doors.along[door]
    sign = world._doors.hinges[door, 3]
    push_from = -sign * np.array([-along[1], along[0]])  # the side the leaf swings away from
    x, y = middle + 1.2 * push_from
    robot = int(world.model.joint("robot/x").qposadr[0])
    heading = math.atan2(-push_from[1], -push_from[0])
    world.data.qpos[robot : robot + 3] = x, y, heading
    world.set_command(0.5, 0.0)
    for _ in range(5 * SUBSTEPS_PER_S):
        world.substep()
    passed = world.robot_pose()[:2] - middle
    assert np.dot(passed, push_from) < -0.8


def test_nobody_runs_into_a_robot_that_stands_in_a_doorway():
    """Whoever wants through waits, goes elsewhere or stops before it."""
    door = World("office", seed=1, dynamism=0)._doors.middles[2]
    world = World("office", seed=1, dynamism=Dynamism.world_1(0.9), start=(*door, 0.3))
    nearest = math.inf
    for _ in range(30 * SUBSTEPS_PER_S):
        world.substep()
        people = world.mover_poses()[_rows(world, "person"), :2]
        nearest = min(nearest, float(np.linalg.norm(people - door, axis=1).min()))
    assert nearest < 1.0  # somebody did come
    assert all(c.kind != "person" or c.force < 150.0 for c in world.take_contacts())


def test_somebody_sits_down_gets_up_and_leaves():
    """From walking to the chair to being apart from it again; a saved sitter goes on the same."""
    world = World("office", seed=1, dynamism=Dynamism.world_1(0.6))
    crowd, seen, saved = world.people.crowd, set(), None
    sitter, later = -1, 0
    for k in range(60 * SUBSTEPS_PER_S):
        world.substep()
        if sitter < 0 and (crowd.state["sit"] == 1.0).any():
            sitter = int(np.argmax(crowd.state["sit"]))
            chair = crowd.discs[crowd.task["seat"][sitter]].copy()
            hull = int(world.model.geom(f"{world.people.names[sitter]}/hull").id)
            assert math.dist([*crowd.discs[sitter]][:2], [*chair][:2]) < 0.15
            assert chair["kind"] == columns.CHAIR
            assert world.model.geom_contype[hull] == 0
            thigh = world.model.body(f"{world.people.names[sitter]}/thigh_l").id
            assert world.data.xpos[thigh, 2] == pytest.approx(gait.SEAT_HEIGHT, abs=0.02)
            saved, later = world.save_state(), k + 600
        if k == later and saved is not None:
            expected, fresh = (
                world.data.qpos.copy(),
                World("office", seed=1, dynamism=Dynamism.world_1(0.6)),
            )
            fresh.load_state(saved)
            for _ in range(600):
                fresh.substep()
            np.testing.assert_array_equal(fresh.data.qpos, expected)
        if sitter >= 0:
            seen.add(int(crowd.task["walking"][sitter]))
            if crowd.task["seat"][sitter] < 0:
                break
    assert {columns.SEATED, columns.WALKS} <= seen
    world.people.dress()
    assert world.model.geom_contype[hull] == 4
    assert crowd.state["sit"][sitter] == 0.0
    assert not any(w.number for w in world.data.warning)
