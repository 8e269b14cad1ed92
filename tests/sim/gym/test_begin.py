# SPDX-License-Identifier: Apache-2.0
"""A room built ahead of time is the one that a reset would have built, or is not used."""

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

from sim.gym import env as environment
from sim.gym.env import MobiliaEnv

pytestmark = pytest.mark.slow


class Later(ThreadPoolExecutor):
    """Runs nothing until ``now``."""

    def __init__(self):
        super().__init__(1)
        self.left = []

    def submit(self, *work):
        self.left.append((Future(), work))
        return self.left[-1][0]

    def now(self):
        for future, (call, *words) in self.left:
            if future.set_running_or_notify_cancel():
                future.set_result(call(*words))


def episode(room: MobiliaEnv, **reset: object) -> list[object]:
    seen = [room.reset(**reset)]
    return seen + [room.step(np.array([0.6, 0.2 * k], np.float32))[:4] for k in range(4)]


@pytest.mark.parametrize("ahead", ["built", "not begun", "another", "failed", "options"])
def test_an_episode_is_the_same_whether_its_room_was_built_ahead(ahead):
    settings = {"scene": "arena", "goal": "random", "pose_source": "odometry", "dynamism": 0.8}
    plain, prepared = MobiliaEnv(**settings), MobiliaEnv(**settings)
    threads = Later()
    episode(plain, seed=3)
    episode(prepared, seed=3)
    prepared.prepare(threads)
    if ahead in ("built", "another", "options"):
        threads.now()
    elif ahead == "failed":
        threads.left[0][0].set_exception(MemoryError())
    reset = {"another": {"seed": 8}, "options": {"options": {"n_chairs": 2}}}.get(ahead, {})
    assert data_equivalence(episode(plain, **reset), episode(prepared, **reset), exact=True)
    assert threads.left[0][0].cancelled() == (ahead == "not begun")
    assert data_equivalence(episode(plain), episode(prepared), exact=True)


def test_rooms_that_are_built_ahead_are_those_that_begin(monkeypatch):
    """Every episode but the first of each room is built once, and on the other thread."""
    built = []
    begun = environment.begun
    monkeypatch.setattr(
        environment,
        "begun",
        lambda plan, seed, *rest: (built.append(seed), begun(plan, seed, *rest))[1],
    )
    with ThreadPoolExecutor(1) as threads:
        room = MobiliaEnv("arena", goal="random")
        room.reset(seed=1)
        for _ in range(3):
            room.prepare(threads)
            room._ahead.built.result()
            room.reset()
    assert len(built) == len(set(built)) == 4
