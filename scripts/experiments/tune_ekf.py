# SPDX-License-Identifier: Apache-2.0
"""How the EKF was tuned: ``python -m scripts.experiments.tune_ekf points`` (or ``corners``).

One pass over the numbers, each in turn over a few values with the others as they are in the preset,
on the training seeds 0 to 19 and nothing else; results are shown on seeds from 200 on. The score is
the mean over the runs of log10(RMSE / 1 m): a factor counts the same wherever it happens, and a run
that is lost counts, but not for everything. Seeds are paired: beside each value's change of the
score stands in how many seeds (mean over their worlds) it was better and worse than the preset, and
the two-sided probability of that by chance. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import scenes
import sim
import slam
from scripts.comparison.plan import scripts_of, sources
from scripts.jobs import Job, run_jobs
from scripts.paper.runs import follow, sign_test, truth_of
from sim.simulation import stream
from slam import create
from slam.ekf.slam import PRESETS
from slam.errors import InvalidValueError, MobiliaError
from slam.evaluation import metrics
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Float, Frame
from slam.frontend.odometry_sum import thinned

TRAINING = range(20)
WORLDS: dict[str, tuple[dict[str, Any], ...]] = {
    "points": ({"moving": 0.0}, {"moving": 0.25}, {"moving": 0.5}, {"moving": 0.75}),
    "corners": (
        {"scene": "arena", "dynamism": 1.0, "walls": "visible"},
        {"scene": "arena", "dynamism": 1.0, "walls": "none"},
        {"scene": "office", "dynamism": 0.5},
    ),
}
VALUES: dict[str, tuple[Any, ...]] = {
    "individual_gate": (0.99, 0.999, 0.9999, 0.999999),
    "joint_gate": (0.95, 0.99, 0.999, 0.999999),
    "posterior_gate": (0.9, 0.95, 0.99, 0.9999),
    "noise_scale": (0.8, 1.0, 1.25, 1.5),
    "confirm_looks": (2, 4, 8, 12),
    "detection": (0.6, 0.7, 0.8, 0.9),
    "memory_looks": (2.0, 4.0, 8.0, 16.0),
    "separation_m": (0.0, 0.15, 0.3),
}
SECONDS = 30.0


def frames_of(preset: str, world: dict[str, Any], seed: int) -> list[Frame]:
    """One run of one world."""
    if preset == "points":
        return list(PointWorld(PointWorldConfig(**world), seed=seed).stream())
    room = {**world, "change": 0.0, "crowd": "none"}  # of world 1, as it was tuned
    return thinned(list(stream(seed=seed, seconds=SECONDS, **room)), 5)


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


def made_of(preset: str) -> tuple[Path, ...]:
    """The code that a run depends on; rooms are simulated for corners only."""
    called = (slam,) if preset == "points" else (slam, sim, scenes)
    return (*sources(*called), *scripts_of(__file__, "scripts.experiments.tune_ekf"))


def tune(
    preset: str, seeds: Sequence[int], folder: Path, processes: int, knobs: Sequence[str]
) -> list[tuple[dict[str, Any], Float]]:
    """Of each trial its scores (seeds, worlds), the preset itself first."""
    frozen = PRESETS[preset]()
    trials: list[dict[str, Any]] = [{}]
    for knob in knobs:
        trials += [{knob: value} for value in VALUES[knob] if value != getattr(frozen, knob)]
    worlds = range(len(WORLDS[preset]))
    code = made_of(preset)
    jobs = [
        Job(
            name=f"{preset}-{world}-seed-{seed}",
            call=run_one,
            arguments={"preset": preset, "world": world, "seed": seed, "trials": trials},
            suffix=".json",
            code=code,
        )
        for seed in seeds
        for world in worlds
    ]
    files = run_jobs(jobs, folder, processes=processes, title=f"tuning the EKF for {preset}")
    runs = np.array([json.loads(file.read_text()) for file in files.values()])
    scores = runs.reshape(len(seeds), len(worlds), len(trials))
    return [(changes, scores[:, :, k]) for k, changes in enumerate(trials)]


def table(preset: str, results: Sequence[tuple[dict[str, Any], Float]]) -> Iterator[str]:
    """Lines of Markdown: each value's change of the score, paired over the seeds and by world."""
    frozen, base = PRESETS[preset](), results[0][1]
    worlds = [" ".join(str(v) for v in world.values()) for world in WORLDS[preset]]
    medians = ", ".join(
        f"{1e3 * 10**score:.1f} mm ({world})"
        for score, world in zip(np.median(base, axis=0).tolist(), worlds, strict=True)
    )
    yield f"Preset {preset}, {len(base)} seeds: score {base.mean():+.3f}; median RMSE {medians}."
    yield ""
    yield f"| knob | frozen | value | change | better : worse | p | {' | '.join(worlds)} |"
    yield "|---|---:|---:|---:|---:|---:|" + "---:|" * len(worlds)
    for changes, scores in results[1:]:
        ((knob, value),) = changes.items()
        by_seed, change = base.mean(axis=1).tolist(), scores - base
        test = sign_test(scores.mean(axis=1).tolist(), by_seed)
        cells = [knob, f"{getattr(frozen, knob):g}", f"{value:g}", f"{change.mean():+.3f}"]
        cells += [f"{test.wins} : {test.losses}", f"{test.p:.2g}"]
        cells += [f"{x:+.3f}" for x in change.mean(axis=0).tolist()]
        yield f"| {' | '.join(cells)} |"


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("preset", choices=sorted(WORLDS))
    parser.add_argument("--seeds", type=int, default=len(TRAINING), help="the first so many")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/tune-ekf"))
    parser.add_argument("--knobs", nargs="+", choices=list(VALUES), default=list(VALUES))
    wanted = parser.parse_args(arguments)
    try:
        if not 1 <= wanted.seeds <= len(TRAINING):
            raise InvalidValueError(
                f"--seeds must lie in [1, {len(TRAINING)}], the training seeds, got {wanted.seeds}"
            )
        seeds = list(TRAINING)[: wanted.seeds]
        results = tune(wanted.preset, seeds, wanted.out, wanted.jobs, wanted.knobs)
        for line in table(wanted.preset, results):
            print(line)
    except MobiliaError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
