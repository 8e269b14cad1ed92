# SPDX-License-Identifier: Apache-2.0
"""Goals, rewards and steps of several scans: where goals lie, what is paid, what is refused."""

import math
import re

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

import sim  # noqa: F401  (registers the environments)
from scenes.registry import OWN
from sim.gym.env import MobiliaEnv
from sim.gym.goals import NEAR_M, ROOM_M, Ground
from sim.world.kidnapping import hull_discs
from slam import se2
from slam.errors import InvalidValueError, MobiliaError

pytestmark = pytest.mark.slow


def make(id_="mobilia/Arena-v2", **settings):
    return gymnasium.make(id_, disable_env_checker=True, **settings).unwrapped


@pytest.mark.parametrize("name", ["Arena", "Classroom", "RandomRooms"])
def test_the_checker_finds_nothing_to_say_of_a_scene_with_a_goal(name):
    check_env(make(f"mobilia/{name}Goal-v2"), skip_render_check=True)


def test_every_scene_has_an_environment_with_a_goal():
    for scene in OWN:
        assert f"mobilia/{scene.title().replace('-', '')}Goal-v2" in gymnasium.registry


def test_a_random_goal_is_free_far_enough_and_can_be_reached():
    env = make(goal="random")
    for seed in range(12):
        _, info = env.reset(seed=seed)
        world = env.simulation.world
        gaps = hull_discs(world)
        clear = np.hypot(*(gaps[:, :2] - info["goal"]).T) - gaps[:, 2]
        assert (clear >= world.scene.movers[-1].radius + ROOM_M - 0.05).all()  # moved for a scan
        assert info["goal_distance"] >= NEAR_M - 0.05
        assert Ground(world).checked(info["goal"]) == info["goal"]


def test_the_seed_decides_the_goal_and_its_stream_moves_nothing_else():
    env, plain = make(goal="random"), make()
    seen, info = env.reset(seed=3)
    again, same = env.reset(seed=3)
    assert data_equivalence(seen, again, exact=True)
    assert info["goal"] == same["goal"]
    _, other = env.reset(seed=3, options={"seeds": {"goals": 99}})
    assert other["goal"] != info["goal"]
    np.testing.assert_array_equal(other["frame"].scan.ranges, info["frame"].scan.ranges)
    before, _ = plain.reset(seed=3)
    assert set(before) == {"ranges", "valid", "encoders", "time"}
    env.reset(seed=3)
    for k in range(5):
        action = np.array([0.5, 0.3 * k], np.float32)
        seen, before = env.step(action)[0], plain.step(action)[0]
        assert all(np.array_equal(seen[name], before[name]) for name in before)


def test_an_episode_s_own_goal_goes_before_that_of_the_environment():
    env = make(goal="random")
    _, info = env.reset(seed=1, options={"goal": (2.0, 1.0)})
    assert info["goal"] == (2.0, 1.0)
    _, info = make().reset(seed=1, options={"goal": "random"})
    assert info["goal_distance"] >= NEAR_M - 0.05


@pytest.mark.parametrize("source", [None, "odometry", "truth"])
def test_range_and_bearing_are_those_from_the_believed_pose(source):
    env = make(goal="random", pose_source=source)
    observation, info = env.reset(seed=2)
    start = info["frame"].truth
    for k in range(10):
        observation, _, _, _, info = env.step(np.array([0.8, math.sin(k)], np.float32))
    away, bearing = observation["goal_polar"].tolist()
    x, y = observation["goal"].tolist()
    assert (x, y) == pytest.approx((away * math.cos(bearing), away * math.sin(bearing)))
    there = se2.transform(se2.compose(start, observation["pose"]), observation["goal"])
    np.testing.assert_allclose(there, info["goal"], atol=1e-6)


@pytest.mark.parametrize("scene", ["arena", "office"])
def test_a_goal_that_cannot_be_reached_is_refused_with_one_that_can(scene):
    env = MobiliaEnv(scene)
    _, info = env.reset(seed=0)
    wall = env.simulation.world.scene.obstacles[0]
    for goal in (tuple(wall[:2]), (500.0, 0.0), (-8.0, -1.0)):
        with pytest.raises(InvalidValueError, match="does not lie on free floor") as caught:
            env.reset(seed=0, options={"goal": goal})
        nearest = re.search(r"nearest is \((.*), (.*)\)", str(caught.value))
        assert nearest is not None
        _, info = env.reset(seed=0, options={"goal": tuple(map(float, nearest.groups()))})
    assert info["goal"] is not None


def ahead(reward: str, frame_skip: int = 1, speed: float = 1.0, steps: int = 200):
    """Rewards of a drive straight to a goal 1.2 m ahead, and the last information."""
    env = make(dynamism=0.0, reward=reward, frame_skip=frame_skip)
    empty = {"scene": {"n_chairs": 0}}
    _, info = env.reset(seed=1, options=empty)
    x, y, theta = info["pose"]
    goal = (x + 1.2 * math.cos(theta), y + 1.2 * math.sin(theta))
    _, info = env.reset(seed=1, options={"goal": goal, **empty})
    start, rewards, terminated = info["goal_distance"], [], False
    while not terminated and len(rewards) < steps:
        _, reward_, terminated, _, info = env.step(np.array([speed, 0.0], np.float32))
        rewards.append(reward_)
    return rewards, {**info, "start": start}, env.simulation.world.time_ns * 1e-9


def test_progress_is_the_way_towards_the_goal_which_ends_the_episode():
    rewards, info, _ = ahead("progress")
    assert info["is_success"]
    assert info["goal_distance"] < 0.4
    assert sum(rewards) == pytest.approx(info["start"] - info["goal_distance"], abs=1e-9)


def test_a_sparse_reward_is_one_at_the_goal_and_nothing_before():
    rewards, info, _ = ahead("sparse")
    assert rewards[-1] == 1.0
    assert set(rewards[:-1]) == {0.0}
    assert info["is_success"]
    rewards, info, _ = ahead("sparse", speed=0.0, steps=5)
    assert rewards == [0.0] * 5
    assert not info["is_success"]


def test_a_shaped_reward_pays_for_the_way_and_the_goal_and_charges_for_time():
    rewards, info, seconds = ahead("shaped")
    assert info["is_success"]
    way = sum(rewards) - 10.0 + 0.1 * seconds
    assert way == pytest.approx(0.8, abs=0.15)  # of 1.2 m, in an open room
    rewards, _, seconds = ahead("shaped", speed=0.0, steps=5)
    assert sum(rewards) == pytest.approx(-0.1 * 5 / 37.5, abs=1e-2)


def test_a_shaped_reward_charges_for_a_hard_collision():
    env = make(dynamism=0.0, goal="random", reward="shaped", frame_skip=4)
    env.reset(seed=2, options={"scene": {"n_chairs": 0}})
    for _ in range(200):
        _, reward, _, _, info = env.step(np.array([1.0, 0.0], np.float32))
        if info["hard_collision"]:
            assert reward < -4.0
            return
    pytest.fail("it never reached a wall")


def test_a_step_of_several_scans_is_as_many_steps_of_one():
    one, four = make(goal="random"), make(goal="random", frame_skip=4)
    one.reset(seed=5)
    four.reset(seed=5)
    for k in range(5):
        action = np.array([0.6, 0.2 * k], np.float32)
        each = [one.step(action) for _ in range(4)]
        together = four.step(action)
        assert data_equivalence(each[-1][0], together[0], exact=True)
        assert together[1] == pytest.approx(sum(step[1] for step in each), abs=1e-12)
        names = {name for step in each for name in step[4]["contacts"]}
        assert set(together[4]["contacts"]) == names


def test_a_step_of_several_scans_ends_with_the_episode():
    _, info, seconds = ahead("sparse", frame_skip=1)
    _, same, at = ahead("sparse", frame_skip=50)
    assert at == seconds
    assert same["goal_distance"] == info["goal_distance"]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"goal": "anywhere"}, "goal must be random or 2 values"),
        ({"reward": "dense"}, "reward must be one of progress, sparse, shaped"),
        ({"frame_skip": 0}, "frame_skip must be a whole number from 1"),
        ({"scene": "offise"}, "Did you mean 'office'"),
        ({"odometry": "pionear3dx"}, "Did you mean 'pioneer3dx'"),
        ({"scan_height_m": 3.0}, "scan_height_m must be a number from"),
    ],
    ids=repr,
)
def test_odd_settings_are_refused_when_the_environment_is_made(settings, message):
    with pytest.raises(MobiliaError, match=message):
        MobiliaEnv(**({"scene": "arena"} | settings))
