# SPDX-License-Identifier: Apache-2.0
"""Many rooms at once are the single rooms, bit for bit."""

from operator import attrgetter

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import sim  # noqa: F401  (registers the environments)
from sim.gym.vector import MobiliaVectorEnv
from slam.errors import InvalidValueError, MobiliaError

pytestmark = pytest.mark.slow
N, STEPS = 3, 14
SETTINGS = {"time_limit_s": 0.25, "dynamism": 0.8}


def make(**settings):
    return gymnasium.make_vec(
        "mobilia/Arena-v2",
        num_envs=N,
        vectorization_mode="vector_entry_point",
        **{**SETTINGS, **settings},
    )


def actions(step: int) -> np.ndarray:
    return np.array([[0.6, 0.3 * i - 0.2 * (step % 3)] for i in range(N)], dtype=np.float32)


GOALS = {
    "time_limit_s": 0.75, "reward": "shaped", "goal": "random", "frame_skip": 3,
    "pose_source": "odometry",
}  # fmt: skip


@pytest.mark.parametrize("n_workers", [0, 2])
@pytest.mark.parametrize("more", [{}, GOALS])
def test_it_is_the_single_environments_through_resets(more, n_workers):
    many = make(n_workers=n_workers, **more)
    singles = gymnasium.make_vec(
        "mobilia/Arena-v2",
        num_envs=N,
        vectorization_mode="sync",
        disable_env_checker=True,
        **{**SETTINGS, **more},
    )
    ours, theirs = many.reset(seed=5)[0], singles.reset(seed=5)[0]
    assert data_equivalence(ours, theirs, exact=True)
    ends = 0
    for k in range(STEPS):
        ours, theirs = many.step(actions(k)), singles.step(actions(k))
        assert data_equivalence(ours[:4], theirs[:4], exact=True)
        for name in ("pose", "goal", "goal_distance") if more else ("pose",):
            np.testing.assert_array_equal(ours[4][name], np.stack(theirs[4][name]))
        ends += int(ours[3].sum())
    assert ends == N
    many.close()
    singles.close()


def test_rooms_differ_and_the_seed_decides():
    many = make()
    first, _ = many.reset(seed=1)
    again, infos = many.reset(seed=1)
    other, _ = many.reset(seed=2)
    assert data_equivalence(first, again, exact=True)
    assert not np.array_equal(first["ranges"][0], first["ranges"][1])
    np.testing.assert_array_equal(first["ranges"][1], other["ranges"][0])
    assert many.observation_space.contains(first)
    assert infos["pose"].shape == (N, 3)
    assert many.each(attrgetter("simulation.frame.scan.ranges"), [2])[0].shape == (361,)


def test_a_mask_resets_some_rooms_and_disabled_means_disabled():
    many = make(autoreset_mode="disabled", time_limit_s=0.06)
    many.reset(seed=1)
    for k in range(2):
        _, _, _, truncated, _ = many.step(actions(k))
    assert truncated.all()
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"rooms \[0, 1, 2\] have ended: .*_mask"):
        many.step(actions(0))
    mask = np.array([True, False, True])
    seen, _ = many.reset(seed=[7, None, 9], options={"reset_mask": mask})
    assert (seen["time"] > 0.05).tolist() == [False, True, False]


def test_odd_settings_actions_seeds_and_masks_are_refused_before_any_room_moves():
    for settings in ({"n_workers": -1}, {"autoreset_mode": "same_step"}):
        with pytest.raises(InvalidValueError, match=next(iter(settings))):
            make(**settings)
    rooms = MobiliaVectorEnv(2, scene="arena")
    with pytest.raises(InvalidValueError, match="seed must be 2 seeds"):
        rooms.reset(seed=[1, 2, 3])
    with pytest.raises(InvalidValueError, match="when making the environments"):
        rooms.reset(seed=1, options={"laser": "utm30lx"})
    with pytest.raises(MobiliaError, match="reset"):
        rooms.step(np.zeros((2, 2)))
    rooms.reset(seed=[1, np.int64(2)], options={"n_chairs": 0, "reset_mask": [True, True]})
    for odd in ([[0.0, 0.0], [0.0, np.nan]], np.zeros(2), np.zeros((3, 2)), None, "go", 0.0):
        with pytest.raises(InvalidValueError, match=r"\(2, 2\) finite numbers"):
            rooms.step(odd)
    assert len(set(rooms.each(attrgetter("simulation.world.time_ns")))) == 1
    for options in (5, {"reset_mask": [1, 0]}, {"reset_mask": "ab"}):
        with pytest.raises(InvalidValueError, match="option"):
            rooms.reset(options=options)
    with pytest.raises(InvalidValueError, match="seed must be a whole number"):
        rooms.reset(seed=3.5)
    rooms.close()
