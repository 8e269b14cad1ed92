# SPDX-License-Identifier: Apache-2.0
"""Sessions of one building: as much changes between two of them as was asked for."""

import math

import mujoco
import numpy as np
import pytest

from scenes import build
from sim.actors.rearranging import is_movable, is_out
from sim.core.seeds import Seeds
from sim.simulation import Simulation
from sim.world.sessions import Days, seeds_of
from sim.world.times_of_day import DAY, MOST_SESSIONS, time_of
from sim.world.world import World
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
ALL = ("apartment", "arena", "classroom", "corridor", "office", "random-rooms", "warehouse")


def days(scene: str, seed: int, share: float) -> Days:
    seeds = Seeds(seed)
    return Days(build(scene, seed=seeds.integer("layout")), seeds, share)


def elsewhere(made: Days, session: int) -> list[str]:
    """What stands elsewhere in that session than in the one before."""
    before, after = made.arrangement(session - 1), made.arrangement(session)
    names = []
    for name, here in before.poses.items():
        there = after.poses[name]
        if here is None or there is None:
            names += [name] if here != there else []
        elif math.dist(here[:2], there[:2]) > 0.05 or abs(here[2] - there[2]) > 0.1:
            names.append(name)
    return names + [k for k, a in before.angles.items() if abs(a - after.angles[k]) > 0.1]


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("scene", ["office", "classroom"])
def test_the_share_that_stands_elsewhere_is_the_one_asked_for(scene, share):
    for seed in range(20, 24):
        made = days(scene, seed, share)
        shares = [len(elsewhere(made, k)) / made.n for k in range(1, 10)]
        assert shares == pytest.approx([share] * 9, abs=0.05)


@pytest.mark.parametrize("scene", ALL)
def test_a_session_is_a_room_at_rest_in_which_nothing_overlaps(scene):
    names = None
    for session in (3, 4, 7):
        world = World(scene, seed=5, dynamism=0.0, change=0.6, session=session)
        mujoco.mj_forward(world.model, world.data)
        here = [m.name for m in world.scene.movers if is_movable(m) or m.kind == "door"]
        assert names is None or names == here
        names = here
        assert world.data.contact.dist.min(initial=0.0) > -1e-3
        before = world.mover_poses()
        for _ in range(60):
            world.substep()
        far = np.hypot(*(before - before[-1])[:, :2].T) > 2.5  # doors open for the robot
        things = np.array([is_movable(m) for m in world.scene.movers])
        assert np.abs(world.mover_poses() - before)[far | things].max() < 0.01


def test_times_of_day_say_who_is_there_and_what_moves():
    assert [time_of(k).name for k in range(6)] == [*(t.name for t in DAY), "morning"]
    night = World("office", seed=1, dynamism=0.7, change=0.5, session=4)
    assert night.people.names == []
    assert night.rates.chair_push_rate == night.rates.door_rate == 0.0
    assert math.isinf(night.rates.stay_mean)
    meeting = World("office", seed=1, dynamism=0.7, change=0.5, session=2, crowd="none")
    assert len(meeting.people.names) == 6


def test_doors_are_open_by_day_and_shut_at_night():
    made = days("office", 8, 0.5)
    angles = {k: np.mean([*made.arrangement(k).angles.values()]) for k in (5, 6, 9, 10)}
    assert min(angles[5], angles[6], angles[10]) > 0.7
    assert angles[9] < 0.7


def test_chairs_stand_against_the_wall_after_cleaning_and_at_their_desks_in_the_morning():
    made = days("office", 8, 0.8)
    first = made.arrangement(0).poses

    def at_home(session):
        poses = made.arrangement(session).poses
        return sum(poses[name] == first[name] for name in first if name.startswith("chair"))

    assert at_home(5) > at_home(3) + 3


def test_a_session_is_made_alone_and_the_same_from_the_same_seed():
    late = days("office", 4, 0.4).arrangement(7)
    made = days("office", 4, 0.4)
    for k in range(8):
        made.arrangement(k)
    assert made.arrangement(7) == late
    assert days("office", 5, 0.4).arrangement(7) != late
    ends = []
    for _ in range(2):
        simulation = Simulation("office", seed=4, dynamism=0.5, change=0.4, session=3)
        for _ in range(3):
            simulation.observe()
        ends.append(simulation.save_state())
    assert ends[0] == ends[1]


def test_session_0_is_the_scene_and_starts_move_about():
    made = days("office", 6, 0.3)
    scene = made.arranged(made.scene, 0)
    assert dict(scene.initial) == dict(made.scene.initial)
    assert scene.start == made.scene.start
    starts = {made.arranged(made.scene, k).start for k in range(5)}
    assert len(starts) == 5
    assert np.array_equal(made.arranged(made.scene, 4).static_map.values, scene.static_map.values)


def test_streams_of_a_session_are_its_own_but_for_the_building():
    base = Seeds(3)
    one, two = seeds_of(base, 1), seeds_of(base, 2)
    for name in ("lidar", "driving", "people", "chairs"):
        assert len({s.integer(name) for s in (base, one, two)}) == 3
    assert one.integer("layout") == base.integer("layout")
    assert seeds_of(base, 0) is base


def test_what_is_out_of_the_building_is_beyond_every_beam():
    world = World("office", seed=5, dynamism=0.0, change=0.8, session=9)
    poses = world.mover_poses()
    out = [k for k in range(len(poses)) if is_out(poses[k], world.scene.bounds)]
    assert out
    assert all(poses[k, 0] > 500.0 for k in out)


@pytest.mark.parametrize("session", [-1, MOST_SESSIONS, 1.5, True, "1"])
def test_a_session_that_is_none_is_refused(session):
    with pytest.raises(InvalidValueError, match="session"):
        World("arena", session=session)
