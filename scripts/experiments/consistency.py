# SPDX-License-Identifier: Apache-2.0
"""Does a run that agrees with itself err less? ``python -m scripts.experiments.consistency``.

Runs of several SLAMs on simulated drives, some of which lose the robot: the numbers that
``slam.evaluation.consistency`` gives without truth, beside the true error of the same poses.
Spearman's rank correlation over all runs, with the 95 % interval of a bootstrap that draws drives.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from scripts.comparison.recording import Recording
from scripts.experiments.shared import Row
from scripts.experiments.study import Study
from scripts.marks import table
from scripts.metrics.judged import world_truth
from slam.evaluation import metrics
from slam.evaluation.consistency import KeptScans
from slam.evaluation.statistics import RESAMPLES, SEED
from slam.frames import Float
from slam.replay import Track
from slam.system import create

SIGNS = {"sharper_nats": -1.0, "apart_cm": 1.0, "excess_cm": 1.0}  # of what grows with the error
FEW = 20  # runs with a number: fewer say nothing
NAMES = {
    "sharper_nats": "the map is less sharp", "apart_cm": "revisits lie apart",
    "excess_cm": "the same beyond neighbours",
}  # fmt: skip


def run(case: Row, recording: Recording) -> Row:
    """Consistency and error, m, of the final poses."""
    frames = recording.frames
    track, kept = Track(case["slam"], create(case["slam"])), KeptScans()
    failure = track.survive(frames)
    if failure is not None:
        return {"failed": str(failure)}
    for frame, estimate in zip(frames, track.estimates, strict=True):
        kept.note(frame, estimate.T_map_robot)
    final = track.final() or track.online()
    found = kept.judged(final.poses)
    error_m = metrics.ate(final, world_truth(frames), align="se2").value
    return {"error_m": error_m} | ({} if found is None else found.block())


def correlations(rows: Sequence[Row], key: str) -> list[tuple[str, float, float, float, int]]:
    """Spearman's rho of a number and the error, its 95 % interval, and of how many runs.

    Over all runs, and the mean over drives of that of the SLAMs on one drive: what is asked where
    one log is at hand.
    """
    drives: dict[tuple[str, float, int], list[tuple[float, float]]] = {}
    for row in rows:
        if row.get(key) is not None and "error_m" in row:
            pair = SIGNS[key] * row[key], row["error_m"]
            drives.setdefault((row["scene"], row["motion"], row["seed"]), []).append(pair)
    groups = [np.array(pairs) for pairs in drives.values()]

    def rho(pairs: Float) -> float:
        return float(spearmanr(pairs[:, 0], pairs[:, 1]).statistic)

    def pooled(chosen: Sequence[int]) -> float:
        return rho(np.vstack([groups[k] for k in chosen]))

    own = {k: rho(pairs) for k, pairs in enumerate(groups) if len(pairs) > 2}

    def within(chosen: Sequence[int]) -> float:
        found = [own[k] for k in chosen if k in own]
        return float(np.mean(found)) if found else math.nan

    rng, out = np.random.default_rng(SEED), []
    draws = [rng.integers(0, len(groups), len(groups)).tolist() for _ in range(RESAMPLES)]
    for name, of_drives in (("all runs", pooled), ("SLAMs on one drive", within)):
        low, high = np.nanquantile([of_drives(d) for d in draws], [0.025, 0.975]).tolist()
        count = sum(map(len, groups))
        out.append((name, of_drives(range(len(groups))), low, high, count))
    return out


def tell(rows: Sequence[Row]) -> str:
    """The correlations of each number."""
    lines = []
    for key, name in NAMES.items():
        have = sum(row.get(key) is not None for row in rows)
        if have < FEW:
            lines.append([f"{name} (`{key}`)", "–", "too few to tell", "", str(have)])
            continue
        for over, rho, low, high, n in correlations(rows, key):
            interval = f"{low:.2f} to {high:.2f}"
            lines.append([f"{name} (`{key}`)", over, f"{rho:.2f}", interval, str(n)])
    return table(("where the error is larger", "over", "Spearman's rho", "95 %", "runs"), lines)


STUDY = Study(
    name="consistency",
    axes={
        "scene": ("office", "arena", "gallery", "station"), "motion": (1.0,),
        "slam": ("shunting", "occupancy", "kiss-icp", "odometry"),
    },
    drive=lambda case: {
        "scene": case["scene"], "seed": case["seed"], "dynamism": case["motion"], "change": 0.0,
        "seconds": case["seconds"], "scanner": "noise", "every": 8,
    },
    run=run, tell=tell,
    page=Path("docs/consistency.md"), defaults={"seeds": 3, "first_seed": 0, "seconds": 50.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
