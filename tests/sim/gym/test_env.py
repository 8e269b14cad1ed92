# SPDX-License-Identifier: Apache-2.0
"""The contract of the Gymnasium environments, checked as registered ones."""

import math

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

import sim  # noqa: F401  (registers the environments)
from sim.gym.env import MobiliaEnv
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.view import gl
from slam.errors import InvalidValueError, MobiliaError

pytestmark = pytest.mark.slow
IDS = ("mobilia/Arena-v2", "mobilia/Office-v2")


def make(id_: str, **settings):
    return gymnasium.make(id_, disable_env_checker=True, **settings).unwrapped


@pytest.mark.parametrize("id_", IDS)
def test_the_checker_finds_nothing_to_say(id_):
    # warnings are errors in this suite, and the env has a spec, so reset determinism is checked too
    check_env(make(id_, render_mode="map"), skip_render_check=gl.find().backend is None)


def test_it_can_be_made_without_importing_sim_first():
    env = gymnasium.make("sim:mobilia/Arena-v2", disable_env_checker=True)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)


def test_no_return_is_range_max_and_invalid_and_an_inf_in_the_frame():
    env = make("mobilia/Office-v2")
    observation, info = env.reset(seed=0)
    scan = info["frame"].scan
    np.testing.assert_array_equal(observation["valid"].astype(bool), scan.valid)
    assert (observation["ranges"][observation["valid"] == 0] == scan.spec.range_max).all()
    valid = observation["valid"] == 1
    np.testing.assert_array_equal(observation["ranges"][valid], scan.ranges[valid])


def test_truth_is_in_info_only():
    env = make("mobilia/Arena-v2")
    observation, info = env.reset(seed=0)
    assert set(observation) == {"ranges", "valid", "encoders", "time"}
    assert {"pose", "frame", "beam_time", "contacts", "movers"} <= set(info)
    assert info["beam_time"].shape == (361,)
    assert info["beam_time"].max() - info["beam_time"].min() == pytest.approx(
        1.0 / 75.0 + 179.5 / 360.0 / 75.0, abs=1e-9
    )  # the last half-degree beam of the second turn


def test_without_a_goal_the_reward_is_zero_and_time_truncates():
    env = make("mobilia/Arena-v2", time_limit_s=0.2)
    env.reset(seed=0)
    ends = [env.step(np.zeros(2, np.float32))[1:4] for _ in range(8)]
    assert all(reward == 0.0 and not terminated for reward, terminated, _ in ends)
    assert ends[-1][2] is True
    assert ends[0][2] is False


def test_a_hard_collision_ends_the_episode_only_when_asked():
    def crash(**settings):
        env = make("mobilia/Arena-v2", dynamism=0.0, time_limit_s=30.0, **settings)
        env.reset(seed=2, options={"scene": {"n_chairs": 0}})
        for _ in range(700):
            _, _, terminated, _, info = env.step(np.array([1.0, 0.0], np.float32))
            if info["hard_collision"]:
                return terminated
        pytest.fail("it never reached a wall")

    assert crash(terminate_on_collision=True) is True
    assert crash() is False


@pytest.mark.film
@pytest.mark.skipif(gl.find().backend is None, reason="NO OpenGL HERE: 3D pictures not tested")
def test_the_cameras_see_a_room():
    for view in ("top", "follow", "persp"):
        env = make("mobilia/Arena-v2", render_mode="rgb_array", view=view, render_size=(160, 120))
        env.reset(seed=0)
        picture = env.render()
        env.close()
        assert picture.shape == (120, 160, 3)
        assert picture.std() > 10.0


@pytest.fixture(scope="module")
def running() -> MobiliaEnv:
    env = MobiliaEnv("arena")
    env.reset(seed=0, options={"n_chairs": 0})
    return env


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"options": {"gaol": (1, 2)}}, "reset options: unknown key 'gaol'.*Did you mean 'goal'"),
        ({"options": {"goal": (1, 2, 3)}}, "option goal must be"),
        ({"options": {"goal": (math.nan, 0)}}, r"option goal\[0\] must be a number"),
        ({"options": {"seeds": {"chiars": 1}}}, "Did you mean 'chairs'"),
        ({"options": {"scene": {"n_chairs": -1}}}, "n_chairs"),
        ({"options": {"scene": {"dynamism": 0.1}}}, "'dynamism' is none of them"),
        ({"options": {"scene": "office"}}, "reset options.scene must be a table"),
        ({"options": {"laser": "best"}}, "no scanner is called .best.. Known: lms221"),
        ({"options": {"start": (0.0, 0.0)}}, "option start must be"),
        ({"options": {"start": (99.0, 0.0, 0.0)}}, "free floor"),
        ({"options": 5}, "reset options must be a table, got 5"),
        ({"seed": -1}, "seed must be a whole number >= 0"),
        ({"seed": 3.5}, "seed must be a whole number"),
    ],
)
def test_an_odd_reset_is_refused_by_name_and_the_episode_goes_on(running, arguments, message):
    with pytest.raises(MobiliaError, match=message):
        running.reset(**{"seed": 0} | arguments)
    running.step(np.zeros(2))


def test_an_episode_can_have_its_own_counts_rates_laser_and_start():
    env = make("mobilia/Arena-v2")
    start = (1.2, 1.1, 0.7)
    observation, info = env.reset(
        seed=3,
        options={
            "n_chairs": 2,
            "crowd": "none",  # nobody stands where it starts
            "rates": {"chair_push_rate": 0.3, "moving_share": 1.0},
            "laser": Lms221Config(resolution_deg=1.0, noise_std_m=0.0),
            "start": start,
        },
    )
    world = env.simulation.world
    np.testing.assert_allclose(info["pose"], start, atol=1e-6)
    assert [m.kind.partition("_")[0] for m in world.scene.movers] == ["chair", "chair", "robot"]
    assert (world.rates.chair_push_rate, world.rates.moving_share) == (0.3, 1.0)
    assert env.simulation.laser.config.noise_std_m == 0.0
    assert observation["ranges"].shape == (181,)
    assert env.observation_space.contains(observation)
    observation, _ = env.reset(seed=3)
    assert observation["ranges"].shape == (361,)
    assert env.observation_space.contains(observation)


def test_a_start_on_a_chair_is_refused():
    env = make("mobilia/Arena-v2")
    layout = {"seeds": {"layout": 1}}
    _, info = env.reset(seed=0, options=layout)
    with pytest.raises(InvalidValueError, match="taken by chair0"):
        env.reset(seed=0, options={"start": info["movers"]["chair0"], **layout})


ODD_ACTIONS = [
    np.array([np.nan, 0.0]),
    np.array([-np.inf, 0.0]),
    np.zeros(3),
    0.5,
    None,
    "go",
    [None, 1.0],
    [[0.0], [0.0, 1.0]],
]


@pytest.mark.parametrize("action", ODD_ACTIONS, ids=repr)
def test_what_is_no_action_is_refused_and_nothing_moves(running, action):
    before = running.simulation.world.time_ns
    with pytest.raises(InvalidValueError, match="two finite numbers"):
        running.step(action)
    assert running.simulation.world.time_ns == before


def test_finite_actions_beyond_the_space_are_clipped():
    def after(action) -> dict:
        env = MobiliaEnv("arena")
        env.reset(seed=0, options={"n_chairs": 0})
        return env.step(action)[0]

    assert data_equivalence(after([1e30, -7]), after(np.array([1.0, -1.0], np.float32)), exact=True)


def test_numpy_s_and_huge_seeds_are_seeds():
    env = MobiliaEnv("arena")
    same = [env.reset(seed=s, options={"n_chairs": 1})[0] for s in (7, np.int64(7), np.uint8(7))]
    assert data_equivalence(same[0], same[1], exact=True)
    assert data_equivalence(same[0], same[2], exact=True)
    env.reset(seed=2**70, options={"n_chairs": 1})


def test_a_step_before_the_first_reset_is_an_error_of_ours_and_of_gymnasium():
    with pytest.raises(MobiliaError, match="reset") as caught:
        MobiliaEnv("arena").step(np.zeros(2))
    assert isinstance(caught.value, gymnasium.error.ResetNeeded)


@pytest.mark.parametrize(
    "settings",
    [
        {"time_limit_s": [1]},
        {"terminate_on_collision": "no"},
        {"laser": 5},
        {"scene": None},
        {"odometry": 3},
        {"render_mode": "human3000"},
        {"view": "x"},
        {"render_size": (0, 5)},
    ],
    ids=repr,
)
def test_odd_arguments_are_refused_by_name(settings):
    (name,) = settings
    with pytest.raises(InvalidValueError, match=name):
        MobiliaEnv(**({"scene": "arena"} | settings))
