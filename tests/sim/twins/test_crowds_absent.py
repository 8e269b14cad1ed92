# SPDX-License-Identifier: Apache-2.0
"""Who holds something goes out with it; groups by one word; leaders that are out or frozen."""

import numpy as np
import pytest

import scenes
from scenes.groups import with_held
from sim.simulation import Simulation
from sim.twins.absence import Change, apply
from sim.twins.room import _Shapes

pytestmark = pytest.mark.slow
CROWD = "escorts:3,groups:4,boards:1,trains:1,couches:1,cleaners:1"
ROOM = {"scene": "arena", "seed": 3, "n_chairs": 4, "n_people": 0, "labels": True,
        "dynamism": 0.6, "change": 0.0, "crowd": CROWD, "walls": "visible"}  # fmt: skip


def drive(simulation, scans):
    frames = []
    for k in range(scans):
        simulation.world.set_command(0.3, 0.4 if k % 40 < 20 else -0.4)
        frames.append(simulation.observe())
    return frames


@pytest.fixture(scope="module")
def before():
    """A crowd after three seconds: state, where everybody is, what comes next."""
    simulation = Simulation(**ROOM)
    drive(simulation, 110)
    block = simulation.save_state()
    return block, simulation.world.mover_poses(), drive(simulation, 40), simulation.save_state()


def changed(before, change):
    simulation = Simulation(**ROOM)
    simulation.load_state(before[0])
    apply(simulation, change)
    return simulation


def pose(simulation, name):
    return simulation.world.mover_poses()[simulation.world.mover_names.index(name)]


def way(simulation, before, name):
    at = pose(simulation, name) - before[1][simulation.world.mover_names.index(name)]
    return float(np.hypot(at[0], at[1]))


def test_who_pushed_what_is_out_walks_on_with_empty_hands(before):
    """Its kernel looks up what it holds, which is no row of any table any more."""
    simulation = changed(before, Change(out=("board0",)))
    people = simulation.world.people
    pusher = people.names.index("board_pusher0")
    assert people.crowd.task["held"][pusher] == -1
    drive(simulation, 400)
    assert way(simulation, before, "board_pusher0") > 0.5
    assert np.isfinite(simulation.world.data.qpos).all()


def test_saved_with_things_in_hand_it_goes_on_bit_for_bit(before):
    again = Simulation(**ROOM)
    again.load_state(before[0])
    assert (again.world.people.table.held.at["qb"] >= 0).sum() >= 5
    assert drive(again, 40) == before[2]
    assert again.save_state() == before[3]


def test_whoever_goes_out_takes_along_what_it_holds_and_no_more():
    holds = scenes.build("arena", 3, crowd=CROWD).holds
    assert with_held(holds, ["board_pusher0"]) == ("board_pusher0", "board0")
    assert with_held(holds, ["train_puller0"]) == ("train_puller0", "wagon0", "wagon1")
    assert with_held(holds, ["carrier0"]) == ("carrier0", "couch0")
    assert with_held(holds, ["wagon0"]) == ("wagon0", "wagon1")
    assert with_held(holds, ["board0", "escort0"]) == ("board0", "escort0")


def test_a_long_thing_of_a_twin_is_in_the_way_along_its_whole_length():
    simulation = Simulation(**{**ROOM, "crowd": "boards:1", "dynamism": 0.0})
    world = simulation.world
    row = world.mover_names.index("board0")
    x, y, yaw = pose(simulation, "board0").tolist()
    along, across = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    past = np.linspace(-1.0, 1.0, 60)[:, None] * across
    for off, free in ((0.0, False), (-0.7, False), (0.7, False), (2.0, True)):
        line = np.array([x, y]) + off * along + past
        shapes = _Shapes(world, [np.column_stack([line, np.zeros(60)])])
        assert shapes.clear(row, np.array([x, y, yaw])) == free


@pytest.mark.parametrize(
    ("name", "gone"),
    [("board_pusher0", ["board0"]), ("train_puller0", ["wagon0", "wagon1"])],
)
def test_what_is_parked_stays_parked_and_is_met_by_no_ray(before, name, gone):
    simulation = changed(before, Change(out=(name,)))
    world = simulation.world
    there = [pose(simulation, each) for each in (name, *gone)]
    frames = drive(simulation, 40)
    rows = [world.mover_names.index(each) for each in (name, *gone)]
    own = np.flatnonzero(np.isin(world.bodies.mover_of_body, rows))
    assert not any(np.isin(f.labels.body, own).any() for f in frames)
    for each, at in zip((name, *gone), there, strict=True):
        assert at[0] > world.scene.bounds[2] + 10.0
        np.testing.assert_array_equal(pose(simulation, each), at)
    others = ["escort0", "group0", "couch0"]
    assert all(pose(simulation, each)[0] < world.scene.bounds[2] for each in others)


@pytest.mark.parametrize(
    ("name", "let_go"), [("board_pusher0", "board0"), ("train_puller0", "wagon0")]
)
def test_what_is_let_go_stands_where_it_is(before, name, let_go):
    simulation = Simulation(**ROOM)
    simulation.load_state(before[0])
    apply(simulation, Change(out=(name,)), held=False)
    drive(simulation, 40)
    assert pose(simulation, name)[0] > simulation.world.scene.bounds[2] + 10.0
    assert way(simulation, before, let_go) < 0.2


def test_who_follows_a_leader_that_is_out_stands_and_one_that_is_not_goes_on(before):
    simulation = changed(before, Change(out=("group0",)))
    names = ("group1", "group2", "group3")
    drive(simulation, 5)
    there = {name: pose(simulation, name) for name in names}
    drive(simulation, 80)
    assert all(np.hypot(*(pose(simulation, n) - there[n])[:2]) < 0.5 for n in names)
    assert max(way(simulation, before, f"escort{k}") for k in range(3)) > 0.5


def test_a_frozen_leader_stays_and_keeps_its_people_about_it(before):
    simulation = changed(before, Change(frozen=("group0",)))
    there = pose(simulation, "group0")
    drive(simulation, 110)
    np.testing.assert_array_equal(pose(simulation, "group0"), there)
    for k in (1, 2, 3):
        assert np.hypot(*(pose(simulation, f"group{k}") - there)[:2]) < 3.0


def test_a_frozen_holder_keeps_its_thing_and_a_frozen_thing_its_place(before):
    simulation = changed(before, Change(frozen=("board_pusher0",)))
    drive(simulation, 60)
    assert way(simulation, before, "board_pusher0") == 0.0
    assert way(simulation, before, "board0") < 0.8
    simulation = changed(before, Change(frozen=("board0",)))
    drive(simulation, 60)
    assert way(simulation, before, "board0") == 0.0
