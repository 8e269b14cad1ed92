# SPDX-License-Identifier: Apache-2.0
"""Steps and resets before and after: ``python -m scripts.benches.sides CHECKOUT PAGE.md``.

A process of the older checkout and one of this take turns at the same work, so that what else runs
on the machine hits both. The place ``sides`` of the page gets medians of processor time, and the
ratios with their intervals.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from copy import copy
from inspect import signature
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

import sim  # noqa: F401  (registers the environments)
from sim.gym.vector import MobiliaVectorEnv
from sim.gym.wrappers import goal_rooms
from sim.sensors.lidar.models.lms221 import Lms221Config

SEED = 100
PAIRS = 11
LOW, HIGH = 1, 9  # of the sorted ratios: the median lies between these, 98.8 %, whatever their law
ROOM_ROWS = 8  # of steps and resets; those of learners are a table of their own
LEARN = 512  # transitions between two updates of the network
ROOM: dict[str, Any] = {"terminate_on_collision": True, "time_limit_s": 30.0}
_WORKERS = "n_workers" in signature(MobiliaVectorEnv).parameters  # an older checkout has threads
ALONE = {"n_workers": 0} if _WORKERS else {"n_threads": 1}
Found = dict[str, float]  # us of processor time by row
Work = Callable[[], Found]


def works() -> Iterator[Work]:
    """What is compared; each goes on where it stopped."""
    for scene in ("Office", "Arena"):
        env: Any = None
        for name, laser in (("ideal scan", Lms221Config.ideal()), ("every effect", None)):
            env = gymnasium.make(f"mobilia/{scene}-v2", disable_env_checker=True,
                                 time_limit_s=1e6, laser=laser).unwrapped  # fmt: skip
            env.reset(seed=SEED)
            yield stepping(f"step, {scene.lower()}, {name}", env, (2,), 150)
        world = env.simulation.world
        yield physics(f"8 `mj_step`, {scene.lower()}", world.model, copy(world.data))
        yield resetting(f"reset, {scene.lower()}", env)
    for n, scans in ((1, "all"), (4, "last"), (16, "last")):
        rooms = goal_rooms("mobilia/ArenaGoal-v2", n, scans=scans, **ROOM, **ALONE)
        rooms.reset(seed=SEED)
        yield stepping(f"learner's step, rooms: {n}", rooms, (n, 2), 96 // n)
    for n in (1, 4, 16):
        yield learning(n)


def stepping(name: str, room: Any, shape: tuple[int, ...], steps: int) -> Work:
    """Steps under a new random command every second; rooms that end begin again."""
    rng, done, action = np.random.default_rng(SEED), 0, np.zeros(shape)

    def run() -> Found:
        nonlocal done, action
        start = time.process_time()
        for _ in range(steps):
            if done % 37 == 0:
                action = rng.uniform(-1.0, 1.0, shape)
            done += 1
            _, _, terminated, truncated, _ = room.step(action)
            if np.any(ended := terminated | truncated):
                room.reset(options={"reset_mask": ended})
        return {name: (time.process_time() - start) / (steps * action.size / 2) * 1e6}

    return run


def physics(name: str, model: Any, data: Any) -> Work:
    """MuJoCo's own steps of a scan, without people, doors and scanner."""

    def run() -> Found:
        start = time.process_time()
        for _ in range(800):
            mujoco.mj_step(model, data)
        return {name: (time.process_time() - start) / 100 * 1e6}

    return run


def resetting(name: str, env: Any) -> Work:
    """Resets, another seed each time."""
    seeds = iter(range(10**6))

    def run() -> Found:
        start = time.process_time()
        for _ in range(3):
            env.reset(seed=next(seeds))
        return {name: (time.process_time() - start) / 3 * 1e6}

    return run


def learning(n: int) -> Work:
    """PPO with Stable-Baselines3 on one thread; what the learner itself takes of it."""
    import torch
    from stable_baselines3 import PPO

    from sim.gym.learning import learning_rooms

    torch.set_num_threads(1)
    rooms, inside = learning_rooms("mobilia/ArenaGoal-v2", n, **ROOM, **ALONE), 0.0
    step = rooms.step

    def timed(action: Any) -> Any:
        nonlocal inside
        start = time.process_time()
        told = step(action)
        inside += time.process_time() - start
        return told

    rooms.step = timed
    model = PPO("MlpPolicy", rooms, n_steps=LEARN // n, batch_size=256, seed=SEED, device="cpu")

    def run() -> Found:
        nonlocal inside
        start, inside = time.process_time(), 0.0
        model.learn(LEARN, reset_num_timesteps=False)
        all_us, rooms_us = (s / LEARN * 1e6 for s in (time.process_time() - start, inside))
        return {f"PPO, rooms: {n}": all_us, f"of it the learner itself, {n}": all_us - rooms_us}

    return run


def serve() -> None:
    """One side: a line out for each line in, the rows of the work of that number."""
    mine = list(works())
    for work in mine:
        work()  # compiled now
    print(json.dumps(len(mine)), flush=True)
    for line in sys.stdin:
        print(json.dumps(mine[int(line)]()), flush=True)


def main(checkout: Path, page: Path) -> None:
    """Let both take turns, and fill the page."""
    from scripts import marks
    from scripts.machine import machine

    sides: list[Any] = [
        subprocess.Popen(
            [sys.executable, "-P", __file__], env={**os.environ, "PYTHONPATH": str(folder)},
            cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )
        for folder in (checkout.resolve(), Path(__file__).parents[2])
    ]  # fmt: skip
    count, _ = (json.loads(side.stdout.readline()) for side in sides)
    pairs: dict[str, list[list[float]]] = {}
    for k in [k for k in range(count) for _ in range(PAIRS)]:
        found = []
        for side in sides:
            print(k, file=side.stdin, flush=True)
            found.append(json.loads(side.stdout.readline()))
        for name in found[0]:
            pairs.setdefault(name, []).append([each[name] for each in found])
    for side in sides:
        side.communicate()
    rows = []
    for name, times in pairs.items():
        before, now = np.array(times).T
        ratios = np.sort(now / before)
        rows.append(
            [name, f"{np.median(before):.0f}", f"{np.median(now):.0f}",
             f"{np.median(ratios):.2f} ({ratios[LOW]:.2f}–{ratios[HIGH]:.2f})"]
        )  # fmt: skip
    heads = ("µs of processor time", "before", "now", "now / before (98.8 %)")
    where = f"Seed {SEED}, {machine()['processor']} at load {os.getloadavg()[0]:.0f}."
    tables = (marks.table(heads, part) for part in (rows[:ROOM_ROWS], rows[ROOM_ROWS:]))
    marks.fill_page(page, "sides", "\n\n".join([*tables, where]))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:])) if sys.argv[1:] else serve()
