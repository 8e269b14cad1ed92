# SPDX-License-Identifier: Apache-2.0
"""Ranges all around the robot, from what it saw before."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import sim  # noqa: F401
from sim.gym.memory import LidarMemory
from slam.errors import InvalidValueError


def _room(**settings):
    env = gymnasium.make(
        "mobilia/ArenaGoal-v2", dynamism=0.0, pose_source="truth", laser="lms221:ideal",
        disable_env_checker=True,
    )  # fmt: skip
    return LidarMemory(env, **settings)


def test_observations_lie_in_their_space():
    env = _room(n_sectors=24, far_m=3.0)
    seen, _ = env.reset(seed=3)
    for _ in range(3):
        assert set(seen) == set(env.observation_space.spaces)
        assert env.observation_space.contains(seen)
        assert seen["ranges"].shape == seen["ranges_before"].shape == (24,)
        seen, *_ = env.step(np.array([0.2, 0.2]))


def test_what_is_behind_is_known_once_it_was_seen():
    env = _room()
    seen, _ = env.reset(seed=3)
    behind = np.r_[0:17, 55:72]  # sectors out of view
    assert (seen["ranges"][behind] == 4.0).all()
    before = seen["ranges"]
    turned = 0.0
    while turned < 0.5 * np.pi:
        seen, *_ = env.step(np.array([0.0, 1.0]))
        turned = float(seen["pose"][2])
    assert (seen["ranges"][behind] < 4.0).any()
    # What was to the right is behind now: as far as it was, a sector beside at most.
    moved = round(turned / (2.0 * np.pi) * 72)
    was = np.roll(before, -moved)[4:14]
    now = seen["ranges"][4:14]
    close = was < 3.5
    assert close.any()
    assert np.abs(now - was)[close].max() < 0.15


def test_it_is_forgotten_after_a_while_and_at_a_reset():
    env = _room(remembered_s=0.3, before_s=0.0)
    env.reset(seed=3)
    for _ in range(12):
        env.step(np.array([0.0, 1.0]))
    for _ in range(8):
        seen, *_ = env.step(np.zeros(2))
    behind = np.r_[0:17, 55:72]
    assert (seen["ranges"][behind] == 4.0).all()
    assert np.array_equal(env.reset(seed=3)[0]["ranges"], _room().reset(seed=3)[0]["ranges"])


def test_speeds_are_those_of_the_pose():
    env = _room()
    env.reset(seed=3)
    for _ in range(15):
        seen, *_ = env.step(np.array([0.0, 0.5]))
    assert seen["velocity"] == pytest.approx([0.0, 0.6], abs=0.02)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"n_sectors": 3}, "n_sectors"),
        ({"far_m": 0.0}, "far_m must be > 0, got 0"),
        ({"remembered_s": -1.0}, r"remembered_s must lie in \[0, 60\], got -1"),
        ({"before_s": np.nan}, "before_s"),
    ],
)
def test_settings_out_of_range_are_refused(settings, words):
    with pytest.raises(InvalidValueError, match=words):
        _room(**settings)


def test_an_environment_without_a_pose_is_refused():
    with pytest.raises(InvalidValueError, match="needs observations with an entry 'pose'"):
        LidarMemory(gymnasium.make("mobilia/Arena-v2"))
