# SPDX-License-Identifier: Apache-2.0
"""Environments whose observation holds a believed pose: by whom it is asked, never the truth."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

import sim  # noqa: F401  (registers the environments)
from sim.gym.vector import MobiliaVectorEnv
from slam import create, se2
from slam.errors import InvalidValueError, SlamFailedError, UnknownNameError
from slam.odometry import OdometrySlam

pytestmark = pytest.mark.slow
GOAL = (3.0, 2.0)
ENTRY = "slam.odometry:OdometrySlam"


def make(source, **settings):
    return gymnasium.make(
        "mobilia/Arena-v2", pose_source=source, disable_env_checker=True, **settings
    ).unwrapped


def rollout(env, steps=15, seed=3, **options):
    seen = [env.reset(seed=seed, options={"goal": GOAL, **options})]
    for k in range(steps):
        observation, _, _, _, info = env.step(np.array([0.8, 0.1 * k], np.float32))
        seen.append((observation, info))
    return seen


@pytest.mark.parametrize("source", ["truth", "odometry", "shunting", ENTRY, create("odometry")])
def test_the_checker_finds_nothing_to_say(source):
    check_env(make(source), skip_render_check=True)


def test_truth_is_the_truth_and_the_goal_is_where_it_truly_is():
    start = (1.2, 1.1, 0.7)
    for observation, info in rollout(make("truth"), start=start, n_chairs=0, motion=0.0):
        truth = se2.between(start, info["frame"].truth)
        np.testing.assert_allclose(observation["pose"], truth, atol=1e-9)
        T_world_robot = se2.compose(start, observation["pose"])
        np.testing.assert_allclose(se2.transform(T_world_robot, observation["goal"]), GOAL)


@pytest.mark.parametrize("source", ["odometry", ENTRY])
def test_a_slam_says_what_it_says_on_the_same_frames(source):
    alone = create("odometry")
    for observation, info in rollout(make(source)):
        estimate = alone.update(info["frame"].without_truth())
        np.testing.assert_array_equal(observation["pose"], estimate.T_map_robot)
        assert observation["trusted"] == 1
    assert not np.array_equal(observation["pose"], se2.between((0, 0, 0), info["frame"].truth))


def test_it_begins_anew_with_each_episode_and_the_rest_stays_as_without_it():
    env, plain = make(create("shunting")), make(None)
    first = [observation for observation, _ in rollout(env)]
    again = [observation for observation, _ in rollout(env)]
    assert data_equivalence(first, again, exact=True)
    for mine, (other, _) in zip(first, rollout(plain), strict=True):
        assert set(other) == {"ranges", "valid", "encoders", "time"}
        assert all(np.array_equal(mine[name], other[name]) for name in other)
    assert not np.array_equal(first[-1]["pose"], rollout(env, seed=4)[-1][0]["pose"])


def test_a_slam_that_fails_is_told_by_name():
    class Broken:
        def reset(self): ...
        def update(self, frame):
            raise ValueError("no idea")

        def map(self): ...
        def trajectory(self): ...

    with pytest.raises(SlamFailedError, match="SLAM 'Broken', scan 0, raised ValueError: no idea"):
        make(Broken()).reset(seed=0)


def test_what_is_no_source_is_refused():
    with pytest.raises(UnknownNameError, match="no SLAM is called 'gps'"):
        make("gps")
    for wrong in (7, object(), [1.0, 2.0]):
        with pytest.raises(InvalidValueError, match="pose_source must be"):
            make(wrong)
    with pytest.raises(InvalidValueError, match="pose_source must be a name for 2 environments"):
        MobiliaVectorEnv(2, scene="arena", pose_source=create("odometry"))


class OverFiles(OdometrySlam):
    def estimates_at_end(self):
        return []


def test_a_slam_that_runs_at_the_end_only_is_refused():
    with pytest.raises(InvalidValueError, match="no pose before the last scan, and an environment"):
        make(OverFiles())
