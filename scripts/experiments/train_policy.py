# SPDX-License-Identifier: Apache-2.0
"""Train a policy to reach goals among what moves, and ask which pose it needs.

``python -m scripts.experiments.train_policy`` (needs the extra ``rl``).

The network learns in the scene with its pose by odometry, at every dynamism: it corrects
a reactive rule, with PPO of Stable-Baselines3. Then it drives on seeds that it was not trained on,
with the true pose, that of the SLAM and that of the wheels, at five levels of dynamism. The rule
alone and the built-in driver without avoidance do the same with the true pose. Prints a table, and
writes results, the learning curve and the page. ``--weights FILE`` keeps the network while it
learns, and its episodes beside it in a file of JSON; with ``--steps 0`` both are read from there.
``--cache FOLDER`` keeps what was driven, so that an evaluation can be stopped and goes on.
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
from joblib import Memory, Parallel, delayed

from scripts.experiments.goal_policies import OUTCOMES, digest, drive, untrained
from scripts.experiments.goal_room import room
from scripts.experiments.measured import add_options, head, seeds_of
from scripts.experiments.policy_tables import (
    DRIVER,
    LEVELS,
    MEAN_OF,
    POSES,
    RULE,
    picture,
    share_interval,
    tables,
)
from scripts.marks import fill_page
from scripts.result_files import write
from slam.errors import InvalidValueError, LogFormatError, MobiliaError

MARK = "train_policy"
PAGE, PICTURE = Path("docs/gymnasium.md"), Path("docs/pictures/policy_curve.png")
_TAKEN = ("steps", "seconds", "processor_s")  # by a training
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
        return Monitor(room(wanted.scene, "odometry", 1.0, wanted.seconds))

    rooms = [make] * wanted.rooms
    env = DummyVecEnv(rooms) if wanted.jobs == 1 else SubprocVecEnv(rooms, "forkserver")
    model = untrained(env, wanted.seed)
    diary = Diary(wanted, weights, env, model)
    weights.parent.mkdir(parents=True, exist_ok=True)
    try:
        model.learn(wanted.steps, callback=diary.heard)
        diary.keep()
    finally:
        env.close()


class Diary:
    """Keeps the network while it learns, and what happened, and prints a line now and then."""

    def __init__(self, wanted: argparse.Namespace, weights: Path, env: Any, model: Any) -> None:
        self._wanted, self._weights, self._env, self._model = wanted, weights, env, model
        self._episodes: list[Row] = []
        self._began = time.perf_counter()
        self._steps = 0  # so far

    def heard(self, found: dict[str, Any], _globals: dict[str, Any]) -> bool:
        """As Stable-Baselines3 calls it."""
        steps = self._steps = int(found["self"].num_timesteps)
        for info in found["infos"]:
            if "episode" in info:
                told = {key: float(info["episode"][key]) for key in ("r", "l")}
                row = {"step": steps, "reached": bool(info["is_success"]), **told}
                self._episodes.append(row)
        if steps // self._wanted.rooms % KEPT == 0:
            self.keep()
        if steps // self._wanted.rooms % TOLD == 0:
            last = [row["reached"] for row in self._episodes[-MEAN_OF:]]
            share = f"{np.mean(last):.0%}" if last else "-"
            wall_s = time.perf_counter() - self._began
            print(f"{steps} steps, {len(self._episodes)} episodes, reached {share}, "
                  f"{wall_s:.0f} s, of the processors {self._processor_s():.0f} s",
                  file=sys.stderr, flush=True)  # fmt: skip
        return True

    def _processor_s(self) -> float:
        """Processor time of this process and of those of the rooms."""
        if self._wanted.jobs == 1:
            return time.process_time()
        return time.process_time() + float(sum(self._env.env_method("processor_s")))

    def keep(self) -> None:
        """Write the network and what happened so far."""
        import torch

        torch.save(self._model.policy.state_dict(), self._weights)
        taken = {
            "steps": self._steps, "asked": self._wanted.steps,
            "seconds": time.perf_counter() - self._began, "processor_s": self._processor_s(),
        }  # fmt: skip
        rows = {str(k): row for k, row in enumerate(self._episodes)}
        write(self._weights.with_suffix(".json"), taken, {"episodes": rows})


def evaluate(wanted: argparse.Namespace, weights: Path) -> dict[str, Row]:
    """By "who level": outcomes of all seeds, and the share that reached the goal, with interval."""
    seeds = seeds_of(wanted)
    cells = [(DRIVER, "truth", level) for level in LEVELS]
    cells += [(RULE, "truth", level) for level in LEVELS]
    cells += [(str(weights), pose, level) for pose in POSES for level in LEVELS]
    driven = Memory(wanted.cache, verbose=0).cache(drive)
    found = Parallel(n_jobs=wanted.jobs)(
        delayed(driven)(who, wanted.scene, pose, level, list(seeds), wanted.seconds, digest(who))
        for who, pose, level in cells
    )
    out: dict[str, Row] = {}
    for (who, pose, level), rows in zip(cells, found, strict=True):
        name = who if who in (DRIVER, RULE) else pose
        counts = {word: sum(row["outcome"] == word for row in rows) for word in OUTCOMES}
        low, high = share_interval(counts["reached"], len(rows))
        taken = [row["seconds"] for row in rows if row["outcome"] == "reached"]
        out[f"{name} {level:g}"] = {
            **counts, "low": low, "high": high,
            "median_s": float(np.median(taken)) if taken else None,
            "outcomes": "".join(row["outcome"][0] for row in rows),
        }  # fmt: skip
    return out


def _told(wanted: argparse.Namespace, first: Row, training: Row) -> str:
    n, where = wanted.seeds, first["machine"]
    return (
        f"Share of {n} goals reached in {wanted.seconds:g} s without a hard collision, its 95 % "
        f"interval, and the share of hard collisions. Scene {wanted.scene}, "
        f"world {first['world']}, seeds {wanted.first_seed} to {wanted.first_seed + n - 1}. "
        f"The policy was trained for {training['steps']} steps with {wanted.rooms} rooms and seed "
        f"{wanted.seed}. That took {training['processor_s'] / 60:.1f} minutes of processor time in "
        f"{training['seconds'] / 60:.1f} minutes, on {where['cores']} cores ({where['processor']})."
        "\n\n"
        f"`{first['command']}`"
    )


def _training(path: Path) -> Row:
    """What ``train`` wrote beside the weights; ``LogFormatError`` where it is something else."""
    try:
        found: Row = json.loads(path.read_text(encoding="utf-8"))
        rows = found["episodes"].values()
        numbers = [*(found[k] for k in _TAKEN), *(row[k] for row in rows for k in _CURVE)]
        if rows and all(isinstance(value, int | float) for value in numbers):
            return found
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise LogFormatError(path, f"not what a training left ({error!r:.200})") from error
    raise LogFormatError(path, "not the episodes of a training")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="arena")
    parser.add_argument("--steps", type=int, default=300_000, help="of training; 0: none")
    parser.add_argument("--rooms", type=int, default=4, help="to learn in side by side")
    parser.add_argument("--seed", type=int, default=0, help="of the training")
    parser.add_argument("--weights", type=Path, help="file of the trained network")
    parser.add_argument("--cache", type=Path, help="folder that keeps what was driven")
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
    picture(list(training.pop("episodes").values()), wanted.picture)
    cells = evaluate(wanted, weights)
    text = f"{_told(wanted, first, training)}\n\n{tables(cells, wanted.seeds)}"
    write(wanted.results, {**first, "training": training}, {"cells": cells})
    if not wanted.no_page:
        fill_page(wanted.page, MARK, text)
    return text


if __name__ == "__main__":
    sys.exit(main())
