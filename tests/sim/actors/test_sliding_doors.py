# SPDX-License-Identifier: Apache-2.0
"""Sliding doors and the lift: who is let through, and that nobody is hurt."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from scenes import filled
from scenes.scene import Scene
from sim.actors.config import ACTORS
from sim.core.dynamism import Dynamism
from sim.driving.pilot import Pilot
from sim.recording.topics import ObjectsMessage
from sim.simulation import Simulation
from sim.twins.absence import Change, apply
from sim.view.mapview import MapView
from sim.world.world import World
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
OPEN_M, SHUT_M = 1.2, 0.05  # m: stands open, is shut
PLAN = """
<mujoco><worldbody>
  <geom name="floor:hall" class="floor" size="6 2.5 0.1" material="floor_concrete"/>
  <geom name="wall:north" class="wall" pos="0 2.58 0.55" size="6.2 0.08 0.55"/>
  <geom name="wall:south" class="wall" pos="0 -2.58 0.55" size="6.2 0.08 0.55"/>
  <geom name="wall:west" class="wall" pos="-6.08 0 0.55" size="0.08 2.5 0.55"/>
  <geom name="wall:east" class="wall" pos="6.08 0 0.55" size="0.08 2.5 0.55"/>
  <geom name="wall:a" class="wall" pos="0 -1.605 0.55" size="0.08 0.895 0.55"/>
  <geom name="wall:b" class="wall" pos="0 1.605 0.55" size="0.08 0.895 0.55"/>
  {lift}
  <site name="room:west" type="box" pos="-3 0 0" size="2.9 2.5 0.01"/>
  <site name="room:east" type="box" pos="3 0 0" size="2.9 2.5 0.01"/>
  <site name="start:robot" pos="-4.5 {y} 0"/>
  <site name="goal:west" pos="-4 0 0"/> <site name="goal:east" pos="{goal} 0 0"/>
  <site name="{sort}:east:left" pos="0 -0.71 0" euler="0 0 1.5707963267948966"/>
</worldbody></mujoco>
"""
CABIN = """
  <geom name="wall:c" class="wall" pos="2.2 0 0.55" size="0.08 1.0 0.55"/>
  <geom name="wall:d" class="wall" pos="1.1 1.0 0.55" size="1.1 0.08 0.55"/>
  <geom name="wall:e" class="wall" pos="1.1 -1.0 0.55" size="1.1 0.08 0.55"/>
"""


@cache
def _file(folder: Path, sort: str, y: float) -> Path:
    path = folder / f"{sort}{y:g}.xml"
    lift = sort == "lift"
    path.write_text(
        PLAN.format(sort=sort, lift=CABIN if lift else "", goal=1.4 if lift else 4, y=y)
    )
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("plans")


def room(folder: Path, sort: str = "sliding", *, y: float = 1.8, **counts: int) -> Scene:
    """Two halls with a sliding door between them, or a hall with a lift; the robot aside."""
    return filled(_file(folder, sort, y), 3, **counts)


def opening(world: World) -> float:
    """m that the only sliding door stands open."""
    return float(world.data.joint("door0/slide").qpos[0])


def walk(world: World, seconds: float, each: int = 30):
    """Times of each tenth of a second, on the way."""
    for _ in range(round(seconds * 300 / each)):
        for _ in range(each):
            world.substep()
        yield world.time_ns * 1e-9


def stand_still(world: World, x: float, y: float) -> None:
    """Put person0 there for good."""
    first = int(world.model.joint("person0/x").qposadr[0])
    world.data.qpos[first : first + 2] = x, y
    world.people.crowd.state["stay_until"][0] = math.inf
    mujoco.mj_forward(world.model, world.data)


class TestSlidingDoor:
    def test_it_opens_for_a_person_and_closes_behind(self, folder):
        world = World(
            room(folder, n_people=1), seed=2, dynamism=replace(Dynamism.at(1.0), door_rate=0.0)
        )
        person = world.mover_names.index("person0")
        sides, opened, shut, through = [], 0, 0, []
        for _ in walk(world, 40.0):
            x = float(world.mover_poses()[person, 0])
            sides.append(x > 0.0)
            opened, shut = opened + (opening(world) > OPEN_M), shut + (opening(world) < SHUT_M)
            if abs(x) < 0.1:
                through.append(opening(world))
        assert np.abs(np.diff(sides)).sum() >= 2
        assert min(through) > 0.9
        assert opened
        assert shut

    def test_it_lets_the_robot_through_at_rest(self, folder):
        world = World(room(folder, y=0.0), seed=1, dynamism=0.0)
        pilot, farthest, touched = Pilot(world), -9.0, []
        for _ in walk(world, 25.0, each=20):
            world.set_command(*pilot.command(20 / 300))
            touched += [contact.name for contact in world.take_contacts()]
            farthest = max(farthest, float(world.robot_pose()[0]))
        assert farthest > 3.0
        assert "door0" not in touched

    def test_it_stays_open_while_someone_stands_in_it(self, folder):
        world = World(
            room(folder, n_people=1), seed=1, dynamism=replace(Dynamism.at(1.0), door_rate=0.0)
        )
        world.data.joint("door0/slide").qpos[0] = 1.3
        stand_still(world, 0.0, 0.2)
        late = [opening(world) for time in walk(world, 12.0) if time > 4.0]
        assert min(late) > OPEN_M

    def test_a_leaf_that_meets_a_thing_stops_and_opens_again(self, folder):
        world = World(room(folder, n_chairs=1), seed=1, dynamism=0.0)
        first = int(world.model.joint("chair0/x").qposadr[0])
        world.data.qpos[first : first + 2] = -0.11, 0.3
        world.data.joint("door0/slide").qpos[0] = 1.3
        mujoco.mj_forward(world.model, world.data)
        widths = [opening(world) for _ in walk(world, 12.0, each=4)]
        narrowest = int(np.argmin(widths))
        assert widths[narrowest] > 0.1
        assert max(widths[narrowest:]) > widths[narrowest] + 0.4

    def test_at_rest_it_is_shut_and_sleeps(self, folder):
        world = World(room(folder), seed=1, dynamism=0.0)
        list(walk(world, 3.0))
        assert opening(world) < 1e-3
        assert world.data.ntree_awake < world.model.ntree
        tree = int(world.model.dof_treeid[world.model.joint("door0/slide").dofadr[0]])
        assert world.data.tree_asleep[tree] >= 0

    def test_where_it_is_goes_with_its_leaf(self, folder):
        world = World(room(folder), seed=1, dynamism=0.0)
        shut = world.mover_poses()
        world.data.joint("door0/slide").qpos[0] = 1.0
        world.data.joint("door0/slide").qvel[0] = -0.5
        poses, row = world.mover_poses(), world.mover_names.index("door0")
        np.testing.assert_allclose(poses[row] - shut[row], [0.0, -1.0, 0.0], atol=1e-12)
        assert world.mover_speeds()[row] == pytest.approx(0.5)
        assert not np.array_equal(
            MapView(world.scene, 320, 240).draw(poses), MapView(world.scene, 320, 240).draw(shut)
        )
        message = ObjectsMessage(world.scene.movers)
        message(0, poses, np.zeros(len(poses), dtype=bool))
        middle = shut[row, :2] + [0.0, 0.5 * world.scene.movers[row].radius - 1.0]
        np.testing.assert_allclose(message._placed[row, :2], middle, atol=1e-9)


class TestLift:
    def test_it_comes_some_time_after_the_robot_asked(self, folder):
        world = World(room(folder, "lift"), seed=1, dynamism=0.0, start=(-1.2, 0.0, 0.0))
        opens = next(time for time in walk(world, 15.0) if opening(world) > 0.1)
        assert ACTORS.doors.lift_s < opens < ACTORS.doors.lift_s + 1.5

    def test_the_robot_visits_the_cabin(self, folder):
        world = World(room(folder, "lift", y=0.0), seed=1, dynamism=0.0)
        pilot, inside = Pilot(world), 0
        for _ in walk(world, 50.0, each=20):
            world.set_command(*pilot.command(20 / 300))
            inside += float(world.robot_pose()[0]) > 0.7
        assert inside
        assert pilot.driver.visited >= 3

    def test_people_ride_out_of_sight_and_come_out(self, folder):
        calm = replace(Dynamism.at(1.0), stay_mean=6.0, door_rate=0.0)
        world = World(room(folder, "lift", n_people=1), seed=4, dynamism=calm)
        person = world.mover_names.index("person0")
        hidden, came_out, was_in = 0, 0, False
        for _ in walk(world, 90.0):
            x = float(world.mover_poses()[person, 0])
            hidden += x > 0.6 and opening(world) < SHUT_M
            came_out += was_in and x < -0.6
            was_in = x > 0.6 or (was_in and x > -0.6)
        assert hidden > 20
        assert came_out >= 1

    def test_nobody_asks_it_stays_shut(self, folder):
        rates = replace(Dynamism.at(0.0), door_rate=2.0)
        world = World(room(folder, "lift"), seed=1, dynamism=rates)
        assert max(opening(world) for _ in walk(world, 6.0)) < SHUT_M

    def test_saved_on_its_way_it_comes_at_the_same_instant(self, folder):
        scene = room(folder, "lift", n_people=2)
        first, second = (World(scene, seed=4, dynamism=1.0) for _ in range(2))
        for _ in walk(first, 20.0):
            if np.isfinite(first._doors.schedule["comes"][0]):
                break
        second.load_state(first.save_state())
        for _ in zip(walk(first, 6.0), walk(second, 6.0), strict=True):
            np.testing.assert_array_equal(first.data.qpos, second.data.qpos)
        assert first.save_state() == second.save_state()


def test_taken_out_it_stands_wide_open(folder):
    simulation = Simulation(room(folder), seed=1, dynamism=0.0)
    apply(simulation, Change(out=("door0",)))
    list(walk(simulation.world, 2.0))
    assert opening(simulation.world) == pytest.approx(1.36)


def test_a_mark_of_a_sliding_door_needs_its_side(tmp_path):
    text = PLAN.format(sort="sliding", lift="", goal=4, y=0).replace(":east:left", ":east:up")
    (tmp_path / "odd.xml").write_text(text)
    with pytest.raises(InvalidValueError, match=r"sliding:ROOM:left\|right"):
        filled(tmp_path / "odd.xml", 0)
