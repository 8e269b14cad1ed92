# SPDX-License-Identifier: Apache-2.0
"""Train a policy to reach goals among what moves, and ask which pose it needs.

``python -m scripts.experiments.train_policy`` (needs the extra ``rl``).

PPO of Stable-Baselines3 learns in the scene with its pose by odometry, at a dynamism that grows to
1 over the first half. Then it drives on seeds that it was not trained on, with the true pose, that
of the SLAM and that of the wheels, at five levels of dynamism. The built-in driver without
avoidance does the same with the true pose. Prints a table, and writes results, the learning curve
and the page. ``--weights FILE`` keeps the network while it learns, and its episodes beside it in a
file of JSON; with ``--steps 0`` both are read from there.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from matplotlib.figure import Figure
from scipy.stats import binomtest

from scripts.experiments.goal_policies import OUTCOMES, Told, drive, room, untrained
from scripts.experiments.measured import add_options, head, seeds_of, table
from scripts.figures import save, styled
from scripts.marks import fill_page
from scripts.result_files import write
from slam.errors import InvalidValueError, LogFormatError, MobiliaError

MARK = "train_policy"
PAGE, PICTURE = Path("docs/gymnasium.md"), Path("docs/pictures/policy_curve.png")
POSES = ("truth", "shunting", "odometry")
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
DRIVER = "driver"
GROWN = 0.5  # share of the training after which the dynamism may be anything up to 1
MEAN_OF = 100  # episodes of the mean in the curve
_CURVE = ("step", "reached", "r")  # of each episode
TOLD, KEPT = 256, 2048  # steps of a room after which a line is printed, and the network is kept

Row = dict[str, Any]


def train(wanted: argparse.Namespace, weights: Path) -> None:
    """Train and write the weights, and beside them what the training took, episode by episode."""
    import torch
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    torch.set_num_threads(1)

    def make() -> Any:
        return Monitor(Told(room(wanted.scene, "odometry", 0.0, wanted.seconds)))

    rooms = [make] * wanted.rooms
    env = DummyVecEnv(rooms) if wanted.jobs == 1 else SubprocVecEnv(rooms, "forkserver")
    model = untrained(env, wanted.seed)
    episodes: list[Row] = []
    began = time.perf_counter()

    def keep(steps: int) -> None:
        torch.save(model.policy.state_dict(), weights)
        taken = {"steps": steps, "asked": wanted.steps, "seconds": time.perf_counter() - began}
        rows = {str(k): row for k, row in enumerate(episodes)}
        write(weights.with_suffix(".json"), taken, {"episodes": rows})

    def note(found: dict[str, Any], _globals: dict[str, Any]) -> bool:
        steps = found["self"].num_timesteps
        for info in found["infos"]:
            if "episode" in info:
                told = {key: float(info["episode"][key]) for key in ("r", "l")}
                episodes.append({"step": steps, "reached": bool(info["is_success"]), **told})
        if steps // wanted.rooms % KEPT == 0:
            keep(steps)
        if steps // wanted.rooms % TOLD == 0:
            env.env_method("set_level", min(1.0, steps / (GROWN * wanted.steps)))
            last = [row["reached"] for row in episodes[-MEAN_OF:]]
            share = f"{np.mean(last):.0%}" if last else "-"
            spent = time.perf_counter() - began
            print(f"{steps} steps, {len(episodes)} episodes, reached {share}, {spent:.0f} s",
                  file=sys.stderr, flush=True)  # fmt: skip
        return True

    weights.parent.mkdir(parents=True, exist_ok=True)
    try:
        model.learn(wanted.steps, callback=note)
        keep(int(model.num_timesteps))
    finally:
        env.close()


def evaluate(wanted: argparse.Namespace, weights: Path) -> dict[str, Row]:
    """By "who level": outcomes of all seeds, and the share that reached the goal, with interval."""
    seeds = seeds_of(wanted)
    cells = [(DRIVER, "truth", level) for level in LEVELS]
    cells += [(str(weights), pose, level) for pose in POSES for level in LEVELS]
    found = Parallel(n_jobs=wanted.jobs)(
        delayed(drive)(who, wanted.scene, pose, level, seeds, wanted.seconds)
        for who, pose, level in cells
    )
    out: dict[str, Row] = {}
    for (who, pose, level), rows in zip(cells, found, strict=True):
        name = DRIVER if who == DRIVER else pose
        counts = {word: sum(row["outcome"] == word for row in rows) for word in OUTCOMES}
        low, high = share_interval(counts["reached"], len(rows))
        taken = [row["seconds"] for row in rows if row["outcome"] == "reached"]
        out[f"{name} {level:g}"] = {
            **counts, "low": low, "high": high,
            "median_s": float(np.median(taken)) if taken else None,
            "outcomes": "".join(row["outcome"][0] for row in rows),
        }  # fmt: skip
    return out


def share_interval(k: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share, of ``k`` in ``n``."""
    interval = binomtest(k, n).proportion_ci(confidence_level=0.95, method="wilson")
    return float(interval.low), float(interval.high)


def markdown(cells: dict[str, Row], n: int) -> str:
    """The table: share of goals reached in %, with its interval, and in brackets collisions."""
    names = {
        DRIVER: "driver without avoidance, true pose", "truth": "policy, true pose",
        "shunting": "policy, `shunting`", "odometry": "policy, odometry",
    }  # fmt: skip
    rows = []
    for name, words in names.items():
        told = [words]
        for level in LEVELS:
            cell = cells[f"{name} {level:g}"]
            told.append(
                f"{cell['reached'] / n:.0%} ({cell['low']:.0%} to {cell['high']:.0%}), "
                f"{cell['collided'] / n:.0%}"
            )
        rows.append(told)
    return table(["dynamism", *(f"{level:g}" for level in LEVELS)], rows)


@styled()
def picture(episodes: Sequence[Row], path: Path, asked: int | None = None) -> None:
    """The learning curve: share of goals reached, and reward, over the last episodes.

    ``asked``: steps that the training was to take, where that is known.
    """
    figure = Figure(figsize=(6.4, 3.4))
    axes = figure.add_subplot()
    steps = np.array([row["step"] for row in episodes]) / 1e3
    reached = _mean([100.0 * row["reached"] for row in episodes])
    reward = _mean([row["r"] for row in episodes])
    axes.plot(steps, reached, color="#168c5a", label="goals reached, %")
    axes.set(xlabel="steps of training, thousands", ylabel="goals reached, %", ylim=(0, 100))
    beside = axes.twinx()
    beside.plot(steps, reward, color="#1f61be", label="reward of an episode")
    beside.set_ylabel("reward of an episode")
    beside.grid(visible=False)
    beside.spines["right"].set_visible(True)
    lines = [*axes.get_lines(), *beside.get_lines()]
    axes.legend(lines, [str(line.get_label()) for line in lines], loc="lower right")
    words = f"means of {MEAN_OF} episodes"
    if asked is not None:
        words += f"; dynamism up to 1 from {GROWN * asked / 1e3:.0f} thousand steps on"
    axes.set_title(words, fontsize=9)
    save(figure, path)


def _mean(values: Sequence[float]) -> Any:
    """Of each value and those before it, ``MEAN_OF`` at most."""
    sums = np.cumsum(np.concatenate([[0.0], values]))
    ends = np.arange(1, len(values) + 1)
    starts = np.maximum(0, ends - MEAN_OF)
    return (sums[ends] - sums[starts]) / (ends - starts)


def _told(wanted: argparse.Namespace, first: Row, training: Row) -> str:
    n, where = wanted.seeds, first["machine"]
    return (
        f"Share of {n} goals reached in {wanted.seconds:g} s without a hard collision, its 95 % "
        f"interval, and the share of hard collisions. Scene {wanted.scene}, "
        f"world {first['world']}, seeds {wanted.first_seed} to {wanted.first_seed + n - 1}. "
        f"The policy was trained for {training['steps']} steps with {wanted.rooms} rooms and seed "
        f"{wanted.seed}, in {training['seconds'] / 60:.1f} minutes, on {where['cores']} cores "
        f"({where['processor']})."
        "\n\n"
        f"`{first['command']}`"
    )


def _training(path: Path) -> Row:
    """What ``train`` wrote beside the weights; ``LogFormatError`` where it is something else."""
    try:
        found: Row = json.loads(path.read_text(encoding="utf-8"))
        rows = found["episodes"].values()
        numbers = [found["steps"], found["seconds"], *(row[k] for row in rows for k in _CURVE)]
        if rows and all(isinstance(value, int | float) for value in numbers):
            return found
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise LogFormatError(path, f"not what a training left ({error!r:.200})") from error
    raise LogFormatError(path, "not the episodes of a training")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="arena")
    parser.add_argument("--steps", type=int, default=150_000, help="of training; 0: none")
    parser.add_argument("--rooms", type=int, default=4, help="to learn in side by side")
    parser.add_argument("--seed", type=int, default=0, help="of the training")
    parser.add_argument("--weights", type=Path, help="file of the trained network")
    parser.add_argument("--picture", type=Path, default=PICTURE)
    add_options(parser, "train_policy.json", PAGE)
    parser.set_defaults(seeds=40, seconds=30.0, jobs=2)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, drive, print and write."""
    wanted = _parser().parse_args(arguments)
    try:
        first = head(wanted, MARK, arguments, "scene", "steps", "rooms", "seed")
        with tempfile.TemporaryDirectory() as spare:
            text = _run(wanted, first, wanted.weights or Path(spare) / "policy.pt")
    except ImportError as error:
        print(f"{error}: install the extra rl, pip install 'mobilia[rl]'", file=sys.stderr)
        return 1
    except (MobiliaError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(text)
    return 0


def _run(wanted: argparse.Namespace, first: Row, weights: Path) -> str:
    if wanted.steps == 0 and not weights.is_file():
        raise InvalidValueError(f"--steps 0 needs a file of --weights, got {wanted.weights}")
    if wanted.steps:
        train(wanted, weights)
    training = _training(weights.with_suffix(".json"))
    picture(list(training.pop("episodes").values()), wanted.picture, training.get("asked"))
    cells = evaluate(wanted, weights)
    text = f"{_told(wanted, first, training)}\n\n{markdown(cells, wanted.seeds)}"
    write(wanted.results, {**first, "training": training}, {"cells": cells})
    if not wanted.no_page:
        fill_page(wanted.page, MARK, text)
    return text


if __name__ == "__main__":
    sys.exit(main())
