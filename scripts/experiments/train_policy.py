# SPDX-License-Identifier: Apache-2.0
"""Train a policy to reach goals among what moves, and ask which pose it needs.

``python -m scripts.experiments.train_policy`` (needs the extra ``rl``).

The network learns in the arena with its pose by odometry, at every dynamism: it corrects a reactive
rule, with PPO of Stable-Baselines3. Then it drives on seeds that it was not trained on, with the
true pose, that of the SLAM and that of the wheels, at five levels of dynamism. The rule alone and
the built-in driver without avoidance do the same with the true pose. ``--weights FILE`` keeps the
network while it learns, and its episodes beside it in a file of JSON; with ``--steps 0`` both are
read from there.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from scripts.experiments.goal_room import SCENE, bare_room, room
from scripts.experiments.measured import ended, table
from scripts.experiments.shared import PERCENT, Row
from scripts.experiments.study import Study
from scripts.figures import save, styled
from scripts.result_files import write
from sim.driving.drive import Driver, TourConfig
from sim.driving.navgrid import NavGrid
from sim.gym.env import OMEGA_MAX_RADPS, V_MAX_MPS, MobiliaEnv
from slam.errors import InvalidValueError, LogFormatError, MissingDependencyError
from slam.evaluation.statistics import share_interval
from slam.frames import Float

WEIGHTS = "out/policy.pt"
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
DRIVER, RULE = "driver without avoidance", "reactive rule alone"
POSES = {DRIVER: "truth", RULE: "truth", "policy, true pose": "truth",
         "policy, `shunting`": "shunting", "policy, odometry": "odometry"}  # fmt: skip
OUTCOMES = ("reached", "collided", "late")
ARRIVED_M = 0.3  # of the driver's goal, within that of the environment
NO_DISCS: Float = np.zeros((0, 5))
MEAN_OF = 100  # episodes of the mean in the curve
KEPT = 2048  # steps of a room after which the network is kept
_TAKEN = ("steps", "seconds", "processor_s")  # by a training
_CURVE = ("step", "reached", "r")  # of each episode
Act = Callable[[MobiliaEnv, Any], Any]


def untrained(env: Any, seed: int) -> Any:
    """PPO before its first step."""
    from stable_baselines3 import PPO

    return PPO(
        "MlpPolicy", env, n_steps=512, batch_size=256, n_epochs=6, learning_rate=3e-4, gamma=0.985,
        gae_lambda=0.95, policy_kwargs={"net_arch": [128, 128], "log_std_init": -1.0}, seed=seed,
        device="cpu", verbose=1,
    )  # fmt: skip


def train(wanted: argparse.Namespace) -> None:
    """Write the weights, and beside them what the training took, episode by episode."""
    import torch
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    torch.set_num_threads(1)
    rooms = [lambda: Monitor(room("odometry", 1.0))] * wanted.rooms
    apart = wanted.rooms > 1
    env = SubprocVecEnv(rooms, "forkserver") if apart else DummyVecEnv(rooms)
    model, began, episodes = untrained(env, wanted.seed), time.perf_counter(), dict[str, Row]()
    wanted.weights.parent.mkdir(parents=True, exist_ok=True)

    def keep(steps: int) -> None:
        torch.save(model.policy.state_dict(), wanted.weights)
        processor_s = time.process_time() + (sum(env.env_method("processor_s")) if apart else 0.0)
        taken = {"steps": steps, "asked": wanted.steps, "rooms": wanted.rooms, "seed": wanted.seed,
                 "seconds": time.perf_counter() - began, "processor_s": processor_s}  # fmt: skip
        write(wanted.weights.with_suffix(".json"), taken, {"episodes": episodes})

    def heard(found: dict[str, Any], _globals: dict[str, Any]) -> bool:
        steps = int(found["self"].num_timesteps)
        for info in found["infos"]:
            if "episode" in info:
                reached, r = bool(info["is_success"]), float(info["episode"]["r"])
                episodes[str(len(episodes))] = {"step": steps, "reached": reached, "r": r}
        if steps // wanted.rooms % KEPT == 0:
            keep(steps)
        return True

    try:
        model.learn(wanted.steps, callback=heard)
        keep(int(model.num_timesteps))
    finally:
        env.close()


def training(path: Path) -> Row:
    """What ``train`` wrote beside the weights; ``LogFormatError`` where it is something else."""
    try:
        found: Row = json.loads(path.read_text(encoding="utf-8"))
        rows = found["episodes"].values()
        numbers = [*(found[k] for k in _TAKEN), *(row[k] for row in rows for k in _CURVE)]
        if rows and all(isinstance(value, int | float) for value in numbers):
            return found
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise LogFormatError(path, f"not what a training left ({error!r:.200})") from error
    raise LogFormatError(path, "not the episodes of a training")


@cache
def network(weights: str) -> Act:
    """A trained policy, its most likely action. Nothing but parameters is read from its file."""
    import torch

    torch.set_num_threads(1)
    model = untrained(room("odometry", 1.0), seed=0)
    model.policy.load_state_dict(torch.load(weights, weights_only=True, map_location="cpu"))
    return lambda env, seen: model.predict(seen, deterministic=True)[0]


def blind(env: MobiliaEnv) -> Act:
    """The built-in driver on the static layout with the true pose: it does not see what moves."""
    scene, goal = env.simulation.world.scene, env.goal
    assert goal is not None
    config = TourConfig(goal_radius_m=ARRIVED_M)
    grid = NavGrid(scene.bounds, scene.obstacles, config.robot_radius_m - 0.05)
    driver = Driver(grid, np.array([goal]), config)
    last = [env.simulation.world.robot_pose(), np.zeros(1)]

    def act(env: MobiliaEnv, seen: Any) -> Any:
        world = env.simulation.world
        here, now_s = world.robot_pose(), world.time_ns * 1e-9
        dt = max(now_s - float(last[1][0]), env.simulation.scan_period_s)
        moved, turned = here[:2] - last[0][:2], float(here[2] - last[0][2])
        ahead = float(moved[0]) * math.cos(here[2]) + float(moved[1]) * math.sin(here[2])
        last[:] = [here, np.array([now_s])]
        v, omega = driver.command(here, (ahead / dt, turned / dt), NO_DISCS, dt)
        return np.array([v / V_MAX_MPS, omega / OMEGA_MAX_RADPS])

    return act


def run(case: Row) -> Row:
    """One episode: the outcome, and s until its end."""
    who, pose = case["who"], POSES[case["who"]]
    env = (bare_room if who == DRIVER else room)(pose, 0.0, case["seconds"])
    inner: MobiliaEnv = env.unwrapped
    seen, info = env.reset(seed=case["seed"], options={"dynamism": case["level"]})
    if who == DRIVER:
        act = blind(inner)
    else:
        act = (lambda env, seen: np.zeros(2)) if who == RULE else network(case["weights"])
    over = False
    while not over:
        seen, _, terminated, truncated, info = env.step(act(inner, seen))
        over = terminated or truncated
    outcome = OUTCOMES[1 if info["hard_collision"] else 0 if info["is_success"] else 2]
    return {"outcome": outcome, "end_s": inner.simulation.world.time_ns * 1e-9}


def tell(rows: Sequence[Row]) -> str:
    """How it was trained; what is reached; and that less what the driver reaches."""
    known = training(Path(rows[0]["weights"]).with_suffix(".json"))
    levels = list(dict.fromkeys(row["level"] for row in rows))
    drivers = list(dict.fromkeys(row["who"] for row in rows))
    cells = {
        at: [row for row in rows if (row["who"], row["level"]) == at]
        for at in product(drivers, levels)
    }  # fmt: skip
    heads = ["dynamism", *(f"{level:g}" for level in levels)]
    first = [[who, *(share(cells[who, level]) for level in levels)] for who in drivers]
    second = []
    for who in drivers[1:] if drivers[0] == DRIVER else []:
        gaps = [reached(cells[who, level]) - reached(cells[DRIVER, level]) for level in levels]
        second.append([who, *map(gap, [*gaps, np.mean(gaps, axis=0)])])
    return "\n\n".join((
        f"The policy was trained for {known['steps']} steps, in {known['processor_s'] / 60:.1f} "
        f"minutes of processor time and {known['seconds'] / 60:.1f} minutes.",
        table(heads, first),
        "What is reached more than by the driver, in percentage points: mean over the same seeds "
        "and its 95 % interval.",
        table([*heads, "all"], second),
    ))  # fmt: skip


def reached(rows: Sequence[Row]) -> Float:
    """1 or 0 of each seed."""
    return np.array([float(row["outcome"] == "reached") for row in rows])


def share(rows: Sequence[Row]) -> str:
    """Of goals reached, with its interval; and of collisions."""
    n, collided = len(rows), sum(row["outcome"] == "collided" for row in rows)
    low, high = share_interval(round(reached(rows).sum()), n)
    return f"{reached(rows).mean():.0%} ({low:.0%} to {high:.0%}), {collided / n:.0%}"


def gap(by_seed: Float) -> str:
    """Mean, and half its 95 % interval (normal)."""
    n = len(by_seed)
    half = 1.96 * float(np.std(by_seed, ddof=1)) / math.sqrt(n) if n > 1 else math.inf
    return f"{PERCENT * by_seed.mean():+.0f} ± {PERCENT * half:.0f}"


@styled()
def curve(rows: Sequence[Row], path: Path) -> None:
    """Share of goals reached, and reward, over the last episodes of the training."""
    known = training(Path(rows[0]["weights"]).with_suffix(".json"))
    episodes = list(known["episodes"].values())
    steps = np.array([row["step"] for row in episodes]) / 1e3
    figure = Figure(figsize=(6.4, 4.8))
    both = figure.subplots(2, 1, sharex=True)
    told = (("reached", "goals reached", "#168c5a"), ("r", "reward of an episode", "#1f61be"))
    for axes, (key, label, color) in zip(both, told, strict=True):
        sums = np.cumsum([0.0, *(row[key] for row in episodes)])
        ends = np.arange(1, len(sums))
        begins = np.maximum(0, ends - MEAN_OF)
        axes.plot(steps, (sums[ends] - sums[begins]) / (ends - begins), color=color)
        axes.set_ylabel(label)
    both[0].set_title(f"means of {MEAN_OF} episodes, as driven while learning", fontsize=9)
    both[1].set_xlabel("steps of training, thousands")
    save(figure, path)


STUDY = Study(
    name="train_policy",
    axes={"who": tuple(POSES), "level": LEVELS, "weights": (WEIGHTS,)},
    run=run, data=lambda case: [Path(case["weights"])], tell=tell, draw=curve,
    picture=Path("docs/pictures/policy_curve.png"), page=Path("docs/gymnasium.md"), results=True,
    told="Share of {seeds} goals reached in {seconds:g} s without a hard collision, its 95 % "
    f"interval, and the share of hard collisions. Scene {SCENE}, "
    "world {world}, seeds from {first_seed}.",
    defaults={"seeds": 40, "seconds": 30.0, "jobs": 2},
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, then drive."""
    parser = argparse.ArgumentParser(description=__doc__, add_help=False)
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--rooms", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--weights", type=Path, default=Path(WEIGHTS))
    words = sys.argv[1:] if arguments is None else list(arguments)
    wanted, rest = parser.parse_known_args(words)
    asked = {"-h", "--help"} & set(words)
    if not asked and (status := ended(lambda: _trained(wanted))):
        return status
    return STUDY.main([*rest, "--weights", str(wanted.weights)])


def _trained(wanted: argparse.Namespace) -> None:
    if wanted.steps == 0 and not wanted.weights.is_file():
        raise InvalidValueError(f"--steps 0 needs a file of --weights, got {wanted.weights}")
    try:
        if wanted.steps:
            train(wanted)
    except ImportError as error:
        raise MissingDependencyError(
            f"{error}: install the extra rl, pip install 'mobilia[rl]' "
            "--extra-index-url https://download.pytorch.org/whl/cpu"
        ) from error


if __name__ == "__main__":
    sys.exit(main())
