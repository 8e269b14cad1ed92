# SPDX-License-Identifier: Apache-2.0
"""A robot that is carried elsewhere, and a change that comes once."""

from dataclasses import replace

import numpy as np
import pytest

from scenes.assembly import moved
from sim.driving.pilot import Pilot
from sim.recording.recipe import Recipe
from sim.simulation import Simulation, tour
from sim.twins.absence import Change, apply
from sim.twins.twins import Twins
from sim.world.kidnapping import FAR_M
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Frame

ONE = {"scene": "arena", "seed": 4, "dynamism": 0.0, "seconds": 8.0, "scanner": "noise"}
EVERY_S = 6.0


def driven(recipe: Recipe) -> list[Frame]:
    return list(tour(Simulation(**recipe.simulation()), recipe.seconds))


@pytest.fixture(scope="module")
def carried() -> list[Frame]:
    return driven(Recipe(**ONE, kidnap_every_s=EVERY_S))


def leaps(frames: list[Frame]) -> list[int]:
    steps = np.diff([frame.truth[:2] for frame in frames], axis=0)
    return (1 + np.flatnonzero(np.sqrt((steps * steps).sum(axis=1)) > 0.5)).tolist()


def test_it_is_carried_far_to_where_it_was_and_its_wheels_do_not_know(carried: list[Frame]):
    (k,) = leaps(carried)
    before, after = carried[k - 1], carried[k]
    assert after.stamp_ns > EVERY_S * 1e9
    assert np.hypot(*(after.truth - before.truth)[:2]) >= FAR_M - 0.1
    earlier = np.array([frame.truth for frame in carried[:k]])
    assert np.hypot(*(earlier - after.truth)[:, :2].T).min() < 0.02
    rolled = se2.between(before.odometry.T_odom_robot, after.odometry.T_odom_robot)
    assert np.hypot(rolled[0], rolled[1]) < 0.03


def test_up_to_then_it_is_the_same_drive(carried: list[Frame]):
    (k,) = leaps(carried)
    plain = driven(Recipe(**{**ONE, "seconds": 2.0}))
    for one, other in zip(plain, carried, strict=False):
        assert np.array_equal(one.truth, other.truth)
        assert np.array_equal(one.scan.ranges, other.scan.ranges, equal_nan=True)
    assert k > len(plain)


@pytest.mark.parametrize("scanner", ["noise", "utm30lx:noise"])
def test_it_goes_on_from_a_saved_state(scanner: str):
    recipe = Recipe(**{**ONE, "scanner": scanner}, kidnap_every_s=EVERY_S)
    first, second = (Simulation(**recipe.simulation()) for _ in range(2))
    for simulation in (first, second):
        simulation.world.set_command(0.7, 0.0)
    for _ in range(100):
        first.observe()
    second.load_state(first.save_state())
    for _ in range(round(6.5 / first.scan_period_s) - 100):
        a, b = first.observe(), second.observe()
        assert np.array_equal(a.truth, b.truth)
        assert np.array_equal(a.scan.ranges, b.scan.ranges, equal_nan=True)
        assert a.odometry == b.odometry
    (visited, words), (places, others) = first._kidnapping.save(), second._kidnapping.save()
    assert words == others
    assert words["done"] == 1
    assert np.array_equal(visited["kidnap.visited"], places["kidnap.visited"])
    with pytest.raises(InvalidValueError, match="kidnaps are in the state"):
        Simulation(**replace(recipe, kidnap_every_s=None).simulation()).load_state(
            first.save_state()
        )


def carried_from(simulation: Simulation, visited: np.ndarray) -> np.ndarray:
    """Where it is put after having been at these places."""
    kidnapping, world = simulation._kidnapping, simulation.world
    kidnapping.load({"kidnap.visited": visited}, {"noted_ns": 1 << 60, "done": -1})
    assert kidnapping.carried(world)
    return world.robot_pose()


def test_it_is_carried_to_the_same_place_without_a_mover_that_is_not_there():
    settings = {"scene": "office", "dynamism": 0.0, "kidnap_every_s": 5.0, "crowd": "beds:1"}
    probe = Simulation(seed=2, **settings).world
    beds = probe.mover_names.index("bed0")
    low, high = np.array(probe.scene.bounds).reshape(2, 2)
    places = np.column_stack([np.random.default_rng(1).uniform(low, high, (200, 2)), np.zeros(200)])
    put = {}
    for out in ((), ("bed0",), ("bed_pusher0",), ("chair0",)):
        simulation = Simulation(seed=2, **settings)
        apply(simulation, Change(out=out))
        put[out] = carried_from(simulation, places)
    away = np.hypot(*(probe.mover_poses()[:, :2] - put[()][:2]).T)
    assert away[beds] > 1.0
    for out, place in put.items():
        assert np.array_equal(place, put[()]), out
    more = np.vstack([places, probe.robot_pose()])
    assert np.array_equal(carried_from(Simulation(seed=2, **settings), more), put[()])


@pytest.mark.parametrize(
    ("ahead", "left", "free"), [(1.4, 0.0, False), (1.34, 0.84, False), (1.75, 0.0, True)]
)
def test_it_is_not_put_where_a_long_thing_ends(ahead: float, left: float, free: bool):
    """Clear of the hull in the middle of a bed, but not of its end, nor of its corner."""
    simulation = Simulation("gallery", seed=3, dynamism=0.0, kidnap_every_s=5.0, crowd="beds:1")
    world = simulation.world
    x, y, yaw = world.mover_poses()[world.mover_names.index("bed0")].tolist()
    place = np.array([moved((x, y, yaw), (ahead, left, 0.0))])
    assert np.hypot(*(place[0] - world.robot_pose())[:2]) > FAR_M
    simulation._kidnapping.load({"kidnap.visited": place}, {"noted_ns": 1 << 60, "done": -1})
    assert simulation._kidnapping.carried(world) == free


def changed(moment_s: float, seconds: float, saved_at: int | None = None) -> set[float]:
    """Times at which something was put elsewhere."""
    recipe = Recipe(
        scene="office", seed=3, dynamism=0.0, change=1.0, change_at_s=moment_s, seconds=seconds,
        scanner="noise", options={"crowd": "none", "n_people": 0},
    )  # fmt: skip
    simulation = Simulation(**recipe.simulation())
    times = set()
    for k, _ in enumerate(tour(simulation, recipe.seconds)):
        times |= {event.time_s for event in simulation.rearranged}
        if k == saved_at:
            block = simulation.save_state()
            simulation._changed = not simulation._changed
            simulation.load_state(block)
            with pytest.raises(InvalidValueError, match="moment of change is in the state"):
                Simulation(**replace(recipe, change_at_s=None).simulation()).load_state(block)
    return times


@pytest.mark.parametrize(("moment_s", "saved_at"), [(1.0, 50), (5.0, 150)])
def test_a_change_at_one_moment_comes_once_and_then(moment_s: float, saved_at: int):
    (time_s,) = changed(moment_s, moment_s + 3.0, saved_at)
    assert 0.0 <= time_s - moment_s < 0.03


def test_a_moment_of_change_is_refused_where_it_is_without_effect():
    for wrong in ({"change_at_s": 0.0}, {"change_at_s": 5.0, "session": 1}):
        with pytest.raises(InvalidValueError, match="change_at_s"):
            Recipe(**ONE, **wrong)
        with pytest.raises(InvalidValueError, match="change_at_s"):
            Simulation("arena", **wrong)


def test_twins_are_neither_carried_nor_of_a_session():
    for wrong in ({"kidnap_every_s": 5.0}, {"session": 1}):
        with pytest.raises(InvalidValueError, match=next(iter(wrong))):
            Twins("arena", seconds=1.0, **wrong)


def test_the_name_of_an_episode_tells_moments_apart():
    assert Recipe(**ONE).name == "arena-d0-s0004"
    words = {"moving_share": 0.25, "change_at_s": 60.5, "kidnap_every_s": 12.0}
    assert Recipe(**ONE, **words).name == "arena-d0-share0.25-at60.5-kidnap12-s0004"


def test_a_driver_of_one_decision_a_second_does_not_take_a_leap_for_speed():
    world = Simulation("arena", seed=4, dynamism=0.0).world
    pilot = Pilot(world)
    here = world.robot_pose()
    for leap_m, speed in ((3.0, 0.0), (0.9, 0.9)):
        pilot._velocity(here, 1.0)
        there = se2.compose(here, np.array([leap_m, 0.0, 0.0]))
        assert pilot._velocity(there, 1.0)[0] == pytest.approx(speed)
