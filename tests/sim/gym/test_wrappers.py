# SPDX-License-Identifier: Apache-2.0
"""Wrappers: small observations, the same for one room and for many, and stacked by Gymnasium."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import sim  # noqa: F401  (registers the environments)
from sim.gym import wrappers
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
SETTINGS = {"goal": "random", "frame_skip": 2}


def make(**settings):
    return gymnasium.make("mobilia/Arena-v2", disable_env_checker=True, **settings)


def test_pooled_is_the_least_of_each_group():
    ranges = np.random.default_rng(0).random((2, 361))
    for n in (1, 36, 360, 361):
        expected = [[part.min() for part in np.array_split(row, n)] for row in ranges]
        np.testing.assert_array_equal(wrappers.pooled(ranges, n), expected)


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version:UserWarning")
def test_wrapped_and_stacked_it_is_still_an_environment():
    env = wrappers.GoalVector(wrappers.LidarMinPooling(make(**SETTINGS), 24))
    assert env.observation_space.shape == (27,)
    check_env(env, skip_render_check=True, skip_close_check=True)
    stacked = gymnasium.wrappers.FrameStackObservation(env, 3)
    first, _ = stacked.reset(seed=0)
    seen, *_ = stacked.step(np.array([1.0, 0.5], np.float32))
    assert stacked.observation_space.contains(seen)
    np.testing.assert_array_equal(seen[-2], first[-1])


def test_the_vector_says_how_far_and_which_way():
    env = wrappers.GoalVector(make(**SETTINGS), near_m=2.0)
    seen, info = env.reset(seed=1)
    raw, _ = env.env.reset(seed=1)
    away, bearing = raw["goal_polar"]
    np.testing.assert_allclose(seen[:-3], np.minimum(raw["ranges"] / 2.0, 1.0), rtol=1e-6)
    np.testing.assert_allclose(seen[-3:], [away / 8.0, np.cos(bearing), np.sin(bearing)], rtol=1e-6)
    assert info["goal_distance"] == pytest.approx(away, abs=0.05)


def test_many_rooms_look_as_the_single_ones():
    many = gymnasium.make_vec(
        "mobilia/Arena-v2", num_envs=2, vectorization_mode="vector_entry_point", **SETTINGS
    )
    many = wrappers.GoalVector(wrappers.LidarMinPooling(many))
    single = wrappers.GoalVector(wrappers.LidarMinPooling(make(**SETTINGS)))
    seen, _ = many.reset(seed=3)
    assert many.observation_space.contains(seen)
    np.testing.assert_array_equal(seen[1], single.reset(seed=4)[0])
    action = np.array([[0.5, 0.1]] * 2, np.float32)
    np.testing.assert_array_equal(many.step(action)[0][1], single.step(action[1])[0])
    many.close()


def test_a_curriculum_sets_the_dynamism_of_each_episode():
    env = wrappers.DynamismCurriculum(make())

    def stays():
        return env.unwrapped.simulation.world.rates.chair_push_rate

    env.reset(seed=0)
    assert stays() == 0.0
    env.set_level(1.0)
    env.reset(seed=0)
    first = stays()
    env.reset()
    assert stays() != first
    env.reset(seed=0)
    assert stays() == first > 0.0
    env.reset(options={"dynamism": 0.0})
    assert stays() == 0.0


def test_what_cannot_be_wrapped_is_refused():
    with pytest.raises(InvalidValueError, match="'goal_polar': make the environment with a goal"):
        wrappers.GoalVector(make())
    with pytest.raises(InvalidValueError, match="n_sectors"):
        wrappers.LidarMinPooling(make(), 362)
    with pytest.raises(InvalidValueError, match="near_m"):
        wrappers.GoalVector(make(**SETTINGS), 0.0)
    with pytest.raises(InvalidValueError, match="dynamism"):
        wrappers.DynamismCurriculum(make(), 1.5)
    flat = gymnasium.wrappers.FlattenObservation(make())
    with pytest.raises(InvalidValueError, match="an entry 'ranges'"):
        wrappers.LidarMinPooling(flat)
