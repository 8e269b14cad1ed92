# SPDX-License-Identifier: Apache-2.0
"""Rooms as a learner sees them: scans that nobody wants, and Stable-Baselines3."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import sim  # noqa: F401  (registers the environments)
from sim.gym.wrappers import goal_rooms
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
ID = "mobilia/ArenaGoal-v2"


@pytest.mark.parametrize("laser", ["lms221", "utm30lx"])  # the latter's scans last no whole steps
def test_without_change_a_scan_left_out_changes_nothing(laser):
    rooms = [
        gymnasium.make(
            ID, scans=scans, dynamism=0.8, change=0.0, laser=laser, disable_env_checker=True
        )
        for scans in ("all", "last")
    ]
    seen = [room.reset(seed=3) for room in rooms]
    for k in range(12):
        seen = [room.step(np.array([0.7, 0.3 * (k % 3) - 0.2], np.float32)) for room in rooms]
        assert data_equivalence(seen[0][0], seen[1][0], exact=True)
        assert seen[0][1:4] == seen[1][1:4]


def test_a_step_that_ends_an_episode_early_still_has_a_scan():
    room = gymnasium.make(ID, scans="last", time_limit_s=0.06, disable_env_checker=True)
    room.reset(seed=1)
    seen, _, _, truncated, _ = room.step(np.zeros(2, np.float32))
    assert truncated
    assert 0.05 < float(seen["time"]) < 0.1
    assert seen["valid"].any()


def test_stable_baselines_gets_ends_last_observations_and_the_same_bits():
    pytest.importorskip("stable_baselines3")
    from sim.gym.learning import Rooms, learning_rooms

    with pytest.raises(InvalidValueError, match="disabled"):
        Rooms(goal_rooms(ID, 1, autoreset_mode="next_step"))
    settings = {"time_limit_s": 0.4, "terminate_on_collision": True}
    ours, plain = learning_rooms(ID, 2, n_stack=1, **settings), goal_rooms(ID, 2, **settings)
    ours.seed(5)
    first, _ = plain.reset(seed=[5, 6])
    np.testing.assert_array_equal(ours.reset(), first)
    command = np.array([[0.5, 0.1], [0.2, -0.3]], np.float32)
    for _ in range(3):
        seen, rewards, ends, _ = ours.step(command)
        np.testing.assert_array_equal(seen, (there := plain.step(command))[0])
        np.testing.assert_array_equal(rewards, there[1].astype(np.float32))
        assert not ends.any()
    seen, _, ends, infos = ours.step(command)
    last, _, _, truncated, _ = plain.step(command)
    assert ends.all()
    assert truncated.all()
    for room, info in enumerate(infos):
        np.testing.assert_array_equal(info["terminal_observation"], last[room])
        assert info["TimeLimit.truncated"]
        assert info["episode"]["l"] == 4
        assert info["is_success"] is False
        assert not np.array_equal(seen[room], last[room])  # of the next episode
    assert ours.env_method("close") == [None, None]
    ours.close()
    plain.close()
