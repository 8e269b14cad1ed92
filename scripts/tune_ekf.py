# SPDX-License-Identifier: Apache-2.0
"""How the EKF's knobs were set: ``python -m scripts.tune_ekf points`` (or ``corners``).

One pass over the knobs, each in turn over a few values with the others as they are in the preset,
on the training seeds 0 to 19 and nothing else; results are shown on seeds from 100 on. The score is
the mean over the runs of log10(RMSE / 1 m): a factor counts the same wherever it happens, and a run
that is lost counts, but not for everything. Prints each value's score and the best ones.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import slam
from scripts.accuracy import thinned
from scripts.jobs import Job, run_jobs
from scripts.reproduce.runs import follow, truth_of
from sim.simulation import stream
from slam import create, metrics
from slam.frames import Frame
from slam.points import PointWorld, PointWorldConfig

TRAINING = range(20)
WORLDS: dict[str, tuple[dict[str, Any], ...]] = {
    "points": ({"moving": 0.0}, {"moving": 0.25}, {"moving": 0.5}),
    "corners": (
        {"scene": "arena", "dynamism": 1.0, "walls": "visible"},
        {"scene": "arena", "dynamism": 1.0, "walls": "none"},
        {"scene": "office", "dynamism": 0.5},
    ),
}
VALUES: dict[str, tuple[Any, ...]] = {
    "individual_gate": (0.999, 0.9999, 0.999999),
    "joint_gate": (0.99, 0.999, 0.999999),
    "posterior_gate": (0.99, 0.9999, 0.99999),
    "noise_scale": (1.0, 1.25, 2.0),
    "confirm_looks": (2, 4, 8, 12),
    "detection": (0.7, 0.8, 0.9),
    "memory_looks": (2.0, 4.0, 8.0),
    "separation_m": (0.0, 0.15, 0.3),
}
SECONDS = 30.0


def frames_of(preset: str, world: dict[str, Any], seed: int) -> list[Frame]:
    """One run of one world."""
    if preset == "points":
        return list(PointWorld(PointWorldConfig(**world), seed=seed).stream())
    return thinned(list(stream(seed=seed, seconds=SECONDS, **world)), 5)


def run_one(
    path: Path, *, preset: str, world: int, seed: int, trials: list[dict[str, Any]]
) -> None:
    """log10 of the RMSE of every trial (changes of the preset) on one run."""
    frames = frames_of(preset, WORLDS[preset][world], seed)
    truth = truth_of(frames)
    scores = []
    for changes in trials:
        track = follow(create("ekf", preset=preset, **changes), frames, "EKF")
        scores.append(math.log10(max(metrics.ate(track.online(), truth).value, 1e-6)))
    path.write_text(json.dumps(scores))


def tune(
    preset: str, seeds: Sequence[int], folder: Path, processes: int, knobs: Sequence[str]
) -> list[tuple[dict[str, Any], float]]:
    """Mean score of each trial, the preset itself first."""
    trials: list[dict[str, Any]] = [{}]
    trials += [{knob: value} for knob in knobs for value in VALUES[knob]]
    jobs = [
        Job(
            name=f"{preset}-{world}-seed-{seed}",
            call=run_one,
            arguments={"preset": preset, "world": world, "seed": seed, "trials": trials},
            suffix=".json",
            code=(Path(slam.__file__).parent, Path(__file__)),
        )
        for world in range(len(WORLDS[preset]))
        for seed in seeds
    ]
    files = run_jobs(jobs, folder, processes=processes, title=f"tuning the EKF for {preset}")
    scores = [json.loads(file.read_text()) for file in files.values()]
    return [
        (changes, sum(run[k] for run in scores) / len(scores)) for k, changes in enumerate(trials)
    ]


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("preset", choices=sorted(WORLDS))
    parser.add_argument("--seeds", type=int, default=len(TRAINING), help="the first so many")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/tune-ekf"))
    parser.add_argument("--knobs", nargs="+", choices=list(VALUES), default=list(VALUES))
    wanted = parser.parse_args(arguments)
    seeds = list(TRAINING)[: wanted.seeds]
    results = tune(wanted.preset, seeds, wanted.out, wanted.jobs, wanted.knobs)
    preset = results[0][1]
    print(f"preset '{wanted.preset}': {preset:+.3f} (log10 of RMSE in m)")
    for knob in wanted.knobs:
        of_knob = {c[knob]: score for c, score in results if knob in c}
        best = min(of_knob, key=lambda value: of_knob[value])
        told = "  ".join(f"{value}: {score - preset:+.3f}" for value, score in of_knob.items())
        print(f"  {knob:16s} {told}   best {best}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
