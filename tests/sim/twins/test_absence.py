# SPDX-License-Identifier: Apache-2.0
"""A mover that is out leaves no trace, one that is frozen stays; everything else is as it was."""

import mujoco
import numpy as np
import pytest

from sim.actors.people import columns
from sim.simulation import Simulation
from sim.twins.absence import Change, apply
from slam.errors import InvalidValueError, UnknownNameError

pytestmark = pytest.mark.slow
ROOM = {"scene": "arena", "seed": 3, "n_chairs": 6, "n_people": 1, "labels": True}


@pytest.fixture(scope="module")
def before():
    """A busy room after two seconds: settings, state, what comes next."""
    settings = {**ROOM, "dynamism": 1.0}
    simulation = Simulation(**settings)
    drive(simulation, 75)
    block = simulation.save_state()
    return settings, block, drive(simulation, 60), simulation.save_state()


def drive(simulation, scans):
    frames = []
    for k in range(scans):
        simulation.world.set_command(0.2, 0.5 if k % 40 < 20 else -0.5)
        frames.append(simulation.observe())
    return frames


def changed(before, change):
    settings, block, _, _ = before
    simulation = Simulation(**settings)
    simulation.load_state(block)
    apply(simulation, change)
    return simulation


def bodies_of(simulation, name):
    world = simulation.world
    return np.flatnonzero(world.bodies.mover_of_body == world.mover_names.index(name))


def test_with_nothing_changed_it_goes_on_bit_for_bit(before):
    simulation = changed(before, Change())
    assert drive(simulation, 60) == before[2]
    assert simulation.save_state() == before[3]


@pytest.mark.parametrize("name", ["chair2", "person0"])
def test_who_is_out_is_met_by_no_ray_and_the_state_keeps_its_shape(before, name):
    simulation = changed(before, Change(out=(name,)))
    frames = drive(simulation, 60)
    own = bodies_of(simulation, name)
    assert any(np.isin(f.labels.body, own).any() for f in before[2])
    assert not any(np.isin(f.labels.body, own).any() for f in frames)
    again = simulation.save_state()
    assert len(again) == len(before[3])
    Simulation(**before[0]).load_state(again)


def test_beams_that_met_something_else_are_the_same(before):
    simulation = changed(before, Change(out=("chair2",)))
    ours, theirs = drive(simulation, 1)[0], before[2][0]
    other = ~np.isin(theirs.labels.body, bodies_of(simulation, "chair2")) & ~theirs.labels.mixed
    assert other.sum() > 300
    np.testing.assert_array_equal(ours.scan.ranges[other], theirs.scan.ranges[other])
    assert ours.odometry == theirs.odometry


def test_who_is_out_is_outside_for_mujoco_too(before):
    simulation = changed(before, Change(out=("chair0", "person0")))
    drive(simulation, 10)
    world = simulation.world
    xmax = world.scene.bounds[2]
    groups = np.array([1, 1, 1, 0, 1, 0], dtype=np.uint8)
    for name in ("chair0", "person0"):
        own = bodies_of(simulation, name)
        assert (world.data.xpos[own, 0] > xmax + 10.0).all()
        x, y = world.data.xpos[own[0], :2]
        hit = np.zeros(1, dtype=np.int32)
        start, way = np.array([x - 5.0, y, 0.36]), np.array([1.0, 0.0, 0.0])
        assert mujoco.mj_ray(world.model, world.data, start, way, groups, 1, -1, hit) < 0.0
        geoms = np.flatnonzero(np.isin(world.model.geom_bodyid, own))
        assert not np.isin(world.data.contact.geom, geoms).any()


@pytest.mark.parametrize("name", ["chair2", "person0", "chair5"])
def test_who_is_frozen_stays_to_the_bit(before, name):
    simulation = changed(before, Change(frozen=(name,)))
    row = simulation.world.mover_names.index(name)
    there = simulation.world.mover_poses()[row]
    drive(simulation, 60)
    np.testing.assert_array_equal(simulation.world.mover_poses()[row], there)
    assert simulation.world.mover_speeds()[row] == 0.0


def test_others_that_meet_nothing_move_as_they_did(before):
    """Each has its own draws: at dynamism 1 a chair far away is shoved the same way."""
    simulation = changed(before, Change(frozen=("person0",)))
    drive(simulation, 60)
    settings, _, _, end = before
    was = Simulation(**settings)
    was.load_state(end)
    names = simulation.world.mover_names
    chairs = [k for k, name in enumerate(names) if name.startswith("chair")]
    gap = np.abs(simulation.world.mover_poses() - was.world.mover_poses())[chairs].max(axis=1)
    assert (gap < 1e-9).sum() >= len(chairs) - 1


@pytest.fixture(scope="module")
def collision():
    """A robot before a chair in a still room: settings, name of the chair."""
    settings = {"scene": "arena", "seed": 1, "n_chairs": 6, "dynamism": 0.0, "labels": True}
    simulation = Simulation(**settings)
    names = simulation.world.mover_names
    x, y, _ = simulation.world.mover_poses()[names.index("chair1")]
    away = 1.0 if x < 0.0 else -1.0
    start = (x + 0.9 * away, y, np.pi if away > 0.0 else 0.0)
    return {**settings, "start": start}, "chair1"


def ram(settings, change):
    simulation = Simulation(**settings)
    apply(simulation, change)
    begun, touched = simulation.world.mover_poses(), set()
    for _ in range(80):
        simulation.world.set_command(0.5, 0.0)
        simulation.observe()
        touched |= {contact.name for contact in simulation.contacts}
    moved = np.abs(simulation.world.mover_poses() - begun)[:, :2].max(axis=1)
    return dict(zip(simulation.world.mover_names, moved, strict=True)), touched


def test_a_chair_out_of_the_way_is_not_touched_and_a_frozen_one_stops_the_robot(collision):
    settings, chair = collision
    as_it_was, touched = ram(settings, Change())
    assert chair in touched
    assert as_it_was[chair] > 0.1
    out, touched = ram(settings, Change(out=(chair,)))
    assert chair not in touched
    assert out["robot"] > 0.9
    frozen, touched = ram(settings, Change(frozen=(chair,)))
    assert chair in touched
    assert frozen[chair] == 0.0
    assert frozen["robot"] < 0.5


def test_a_chair_on_castors_does_not_fall():
    simulation = Simulation("arena", seed=2, dynamism=0.0, n_chairs=3, chairs="free")
    apply(simulation, Change(out=("chair0",)))
    for _ in range(20):
        simulation.observe()
    body = bodies_of(simulation, "chair0")[0]
    assert abs(float(simulation.world.data.xpos[body, 2])) < 1e-9


def test_a_door_that_is_out_stands_open_and_is_not_seen():
    simulation = Simulation("office", seed=2, dynamism=0.0, doors="closed", labels=True)
    name = next(n for n in simulation.world.mover_names if n.startswith("door"))
    apply(simulation, Change(out=(name,)))
    frame = simulation.observe()
    row = simulation.world.mover_names.index(name)
    hinge = simulation.world.bodies.hinges([name])[0]
    turned = abs(simulation.world.mover_poses()[row, 2] - hinge[2])
    assert turned == pytest.approx(1.5, abs=0.4)
    assert not np.isin(frame.labels.body, bodies_of(simulation, name)).any()


def test_who_sat_on_a_chair_that_is_out_stands_there(before):
    settings, block, _, _ = before
    simulation = Simulation(**settings)
    simulation.load_state(block)
    people = simulation.world.people
    at, _ = simulation.world.bodies.addresses(["chair1"])
    seat = int(np.flatnonzero(people.table.at.discs[:, 0] == at[0])[0])
    people.crowd.task[["walking", "seat"]][0] = columns.SEATED, seat
    people.crowd.state["sit"][0] = 1.0
    people.crowd.state["stay_until"][0] = 1e9
    apply(simulation, Change(out=("chair1",)))
    row = simulation.world.mover_names.index("person0")
    there = simulation.world.mover_poses()[row, :2]
    drive(simulation, 30)
    assert people.crowd.task["seat"][0] == -1
    assert np.abs(simulation.world.mover_poses()[row, :2] - there).max() < 0.5


def test_names_are_checked(before):
    simulation = changed(before, Change())
    with pytest.raises(UnknownNameError, match="no mover is called 'chair99'"):
        apply(simulation, Change(out=("chair99",)))
    with pytest.raises(InvalidValueError, match="robot cannot be taken out"):
        apply(simulation, Change(frozen=("robot",)))
    with pytest.raises(InvalidValueError, match="named twice"):
        Change(out=("chair1",), frozen=("chair1",))
