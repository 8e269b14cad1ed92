# SPDX-License-Identifier: Apache-2.0
"""A robot that is carried elsewhere, and a change that comes once."""

from __future__ import annotations

import numpy as np
import pytest

from sim.recording.recipe import Recipe
from sim.simulation import Simulation, tour
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


def test_it_goes_on_from_a_saved_state(carried: list[Frame]):
    recipe = Recipe(**ONE, kidnap_every_s=EVERY_S)
    first, second = (Simulation(**recipe.simulation()) for _ in range(2))
    for simulation in (first, second):
        simulation.world.set_command(0.7, 0.0)
    for _ in range(100):
        first.observe()
    second.load_state(first.save_state())
    assert second._kidnapping.save()[1] == first._kidnapping.save()[1]
    for _ in range(140):
        a, b = first.observe(), second.observe()
    assert np.array_equal(a.truth, b.truth)
    with pytest.raises(InvalidValueError, match="kidnaps are in the state"):
        Simulation(**Recipe(**ONE).simulation()).load_state(first.save_state())


def test_recipes_without_it_are_what_they_were():
    plain = Recipe(**ONE)
    assert not {"kidnap_every_s", "change_at_s", "moving_share"} & set(plain.words())
    assert Recipe(**ONE, kidnap_every_s=5.0).sha256 != plain.sha256
    for wrong in ({"kidnap_every_s": 0.5}, {"change_at_s": -1.0}, {"moving_share": 1.5}):
        with pytest.raises(InvalidValueError, match=next(iter(wrong))):
            Recipe(**ONE, **wrong)
    with pytest.raises(InvalidValueError, match="exclude each other"):
        Recipe(**ONE, kidnap_every_s=5.0, twin="dynamic")


def test_a_change_at_one_moment_comes_once():
    recipe = Recipe(
        scene="office", seed=4, dynamism=0.0, change=1.0, change_at_s=4.0, seconds=7.0,
        scanner="noise", options={"crowd": "none", "n_people": 0},
    )  # fmt: skip
    simulation = Simulation(**recipe.simulation())
    times = set()
    for _ in tour(simulation, recipe.seconds):
        times |= {event.time_s for event in simulation.rearranged}
    assert len(times) == 1
    assert min(times) == pytest.approx(4.0, abs=0.05)
