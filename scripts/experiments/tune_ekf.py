# SPDX-License-Identifier: Apache-2.0
"""How the EKF was tuned: ``python -m scripts.experiments.tune_ekf --preset points`` (``corners``).

One pass over the numbers, each in turn over a few values with the others as they are in the preset,
on the training seeds 0 to 19 and nothing else; results are shown on seeds from 200 on. The score is
the mean over the runs of log10(RMSE / 1 m): a factor counts the same wherever it happens, and a run
that is lost counts, but not for everything. Seeds are paired: beside each value's change of the
score stands in how many seeds (mean over their worlds) it was better and worse than the preset, and
the two-sided probability of that by chance.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from scripts.comparison.recording import Recording
from scripts.experiments import shared
from scripts.experiments.measured import table
from scripts.experiments.shared import Row
from scripts.experiments.study import Study
from scripts.paper.runs import follow, sign_test, truth_of
from slam import create
from slam.ekf.slam import PRESETS
from slam.errors import InvalidValueError
from slam.evaluation import metrics
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Float

TRAINING = range(20)
WORLDS: dict[str, tuple[dict[str, Any], ...]] = {
    "points": ({"moving": 0.0}, {"moving": 0.25}, {"moving": 0.5}, {"moving": 0.75}),
    "corners": (
        {"scene": "arena", "dynamism": 1.0, "walls": "visible"},
        {"scene": "arena", "dynamism": 1.0, "walls": "none"},
        {"scene": "office", "dynamism": 0.5},
    ),
}
FROZEN = "preset"  # in the place of a knob: nothing is changed
VALUES: dict[str, tuple[Any, ...]] = {
    FROZEN: (0.0,),
    "individual_gate": (0.99, 0.999, 0.9999, 0.999999),
    "joint_gate": (0.95, 0.99, 0.999, 0.999999),
    "posterior_gate": (0.9, 0.95, 0.99, 0.9999),
    "noise_scale": (0.8, 1.0, 1.25, 1.5),
    "confirm_looks": (2, 4, 8, 12),
    "detection": (0.6, 0.7, 0.8, 0.9),
    "memory_looks": (2.0, 4.0, 8.0, 16.0),
    "separation_m": (0.0, 0.15, 0.3),
}


def fits(case: Row) -> bool:
    """Whether there is such a world, and such a value that the preset has not."""
    if case["seed"] not in TRAINING:
        raise InvalidValueError(f"seeds must lie in 0 to {TRAINING[-1]}, got {case['seed']}")
    values = VALUES[case["knob"]]
    there = case["world"] < len(WORLDS[case["preset"]]) and case["value"] < len(values)
    frozen = getattr(PRESETS[case["preset"]](), case["knob"], None)
    return bool(there and values[case["value"]] != frozen)


def drive(case: Row) -> Row | None:
    """A room of world 1, as it was tuned; points are made by the run."""
    if case["preset"] == "points":
        return None
    world = dict(WORLDS["corners"][case["world"]])
    options = {"crowd": "none", **({"walls": world.pop("walls")} if "walls" in world else {})}
    level = world.pop("dynamism")
    return shared.world_1({**case, **world, "level": level}, "full", every=5, options=options)


def run(case: Row, recording: Recording | None = None) -> Row:
    """log10 of the RMSE of one trial on one run."""
    if recording is None:
        config = PointWorldConfig(**WORLDS["points"][case["world"]])
        frames = list(PointWorld(config, seed=case["seed"]).stream())
    else:
        frames = list(recording.frames)
    knob = case["knob"]
    changes = {} if knob == FROZEN else {knob: VALUES[knob][case["value"]]}
    track = follow(create("ekf", preset=case["preset"], **changes), frames, "EKF")
    ate = metrics.ate(track.online(), truth_of(frames)).value
    return {"score": math.log10(max(ate, 1e-6))}


def tell(rows: Sequence[Row]) -> str:
    """Of each preset: each value's change of the score, paired over the seeds and by world."""
    parts = []
    for preset in dict.fromkeys(row["preset"] for row in rows):
        own = [row for row in rows if row["preset"] == preset]
        worlds = sorted({row["world"] for row in own})
        names = [" ".join(str(v) for v in WORLDS[preset][k].values()) for k in worlds]
        base, frozen, cells = _scores(own, FROZEN, 0), PRESETS[preset](), []
        trials = dict.fromkeys((row["knob"], row["value"]) for row in own)
        for knob, value in [trial for trial in trials if trial[0] != FROZEN]:
            scores = _scores(own, knob, value)
            change = scores - base
            test = sign_test(scores.mean(axis=1).tolist(), base.mean(axis=1).tolist())
            cells.append([
                knob, f"{getattr(frozen, knob):g}", f"{VALUES[knob][value]:g}",
                f"{change.mean():+.3f}", f"{test.wins} : {test.losses}", f"{test.p:.2g}",
                *(f"{x:+.3f}" for x in change.mean(axis=0).tolist()),
            ])  # fmt: skip
        medians = 1e3 * 10 ** np.median(base, axis=0)
        told = ", ".join(f"{m:.1f} mm ({n})" for m, n in zip(medians, names, strict=True))
        parts += [
            f"Preset {preset}, {len(base)} seeds: score {base.mean():+.3f}; median RMSE {told}.",
            table(["knob", "frozen", "value", "change", "better : worse", "p", *names], cells),
        ]
    return "\n\n".join(parts)


def _scores(rows: Sequence[Row], knob: str, value: int) -> Float:
    """(seeds, worlds)."""
    own = [row for row in rows if (row["knob"], row["value"]) == (knob, value)]
    found = {(row["seed"], row["world"]): row["score"] for row in own}
    seeds, worlds = (sorted({at[k] for at in found}) for k in (0, 1))
    return np.array([[found[seed, world] for world in worlds] for seed in seeds])


STUDY = Study(
    name="tune_ekf",
    axes={"preset": tuple(WORLDS), "world": (0, 1, 2, 3), "knob": tuple(VALUES),
          "value": (0, 1, 2, 3)},
    fits=fits, drive=drive, run=run, tell=tell,
    told="Training seeds {first_seed} to 19 at most.",
    defaults={"seeds": len(TRAINING), "first_seed": 0, "seconds": 30.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
