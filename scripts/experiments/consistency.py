# SPDX-License-Identifier: Apache-2.0
"""Does a run that agrees with itself err less? ``python -m scripts.experiments.consistency``.

Runs of several SLAMs on simulated drives, some of which lose the robot: the numbers that
``slam.evaluation.consistency`` gives without truth, beside the true error of the same poses.
Spearman's rank correlation over all runs, with the 95 % interval of a bootstrap that draws drives.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from scripts.comparison.recording import Recording
from scripts.experiments.honesty import SCENES, crowd
from scripts.experiments.measured import table
from scripts.experiments.shared import CM, Row
from scripts.experiments.study import Study
from scripts.metrics.judged import world_truth
from slam.evaluation import metrics
from slam.evaluation.consistency import KeptScans
from slam.evaluation.statistics import RESAMPLES, SEED
from slam.replay import Track
from slam.system import create

SIGNS = {"sharper_nats": -1.0, "apart_cm": 1.0, "excess_cm": 1.0}  # of what grows with the error
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


def correlation(rows: Sequence[Row], key: str) -> tuple[float, float, float, int]:
    """Spearman's rho of a number and the error, its 95 % interval, and the runs that have both."""
    whole = [row for row in rows if row.get(key) is not None and "error_m" in row]
    drives: dict[tuple[str, float, int], list[tuple[float, float]]] = {}
    for row in whole:
        pair = SIGNS[key] * row[key], row["error_m"]
        drives.setdefault((row["scene"], row["motion"], row["seed"]), []).append(pair)

    def rho(chosen: Sequence[int]) -> float:
        groups = list(drives.values())
        pairs = np.array([pair for k in chosen for pair in groups[k]])
        return float(spearmanr(pairs[:, 0], pairs[:, 1]).statistic)

    rng, n = np.random.default_rng(SEED), len(drives)
    drawn = [rho(rng.integers(0, n, n).tolist()) for _ in range(RESAMPLES)]
    low, high = np.nanquantile(drawn, [0.025, 0.975]).tolist()
    return rho(range(n)), low, high, len(whole)


def tell(rows: Sequence[Row]) -> str:
    """The correlations, and the errors by how far revisits lie apart."""
    lines = []
    for key, name in NAMES.items():
        rho, low, high, n = correlation(rows, key)
        lines.append([f"{name} (`{key}`)", f"{rho:.2f}", f"{low:.2f} to {high:.2f}", str(n)])
    parts = [table(("where", "Spearman's rho with the error", "95 %", "runs"), lines)]
    steps = [(0.0, 3.0), (3.0, 6.0), (6.0, 12.0), (12.0, np.inf)]
    lines = []
    for low, high in steps:
        own = [CM * row["error_m"] for row in rows if low <= (row.get("apart_cm") or -1.0) < high]
        if own:
            word = f"{low:g} to {high:g}" if np.isfinite(high) else f"{low:g} and more"
            q = np.quantile(own, [0.1, 0.5, 0.9])
            lines.append([word, str(len(own)), f"{q[1]:.1f}", f"{q[0]:.1f} to {q[2]:.1f}"])
    heads = ("revisits apart, cm", "runs", "true error, cm, median", "80 % of the runs")
    return "\n\n".join([*parts, table(heads, lines)])


STUDY = Study(
    name="consistency",
    axes={
        "scene": SCENES, "motion": (1.0,),
        "slam": ("shunting", "occupancy", "kiss-icp", "odometry"),
    },
    drive=crowd, run=run, tell=tell,
    page=Path("docs/consistency.md"), defaults={"seeds": 3, "first_seed": 0, "seconds": 50.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
