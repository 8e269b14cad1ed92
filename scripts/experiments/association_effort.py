# SPDX-License-Identifier: Apache-2.0
"""What JCBB and IPJC cost: ``python -m scripts.experiments.association_effort``.

n landmarks known to 2 mm, a pose that is off by 0.1 m and 2 mrad, and all n seen with 5 mm of
error, among points that come from no landmark but lie about 0.15 m from one. Landmarks lie as
densely whatever their number. Of whole searches: medians over the seeds of processor time, of
hypotheses looked into (nodes) and of tests of a pair, the last two counted where they are made.
JCBB's tree is walked in Python, its test is compiled; IPJC's search is compiled whole: compare how
they grow, not their times with each other.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

import numpy as np

from scripts.experiments.shared import Row, of
from scripts.experiments.study import Study
from slam import se2
from slam.frames import Float
from slam.landmarks.association import METHODS
from slam.landmarks.filter import EkfFilter
from slam.landmarks.hypotheses import Gates

SQUARE_M2 = 3.0  # for each landmark
LANDMARK_STD_M, SENSOR_STD_M, CLUTTER_STD_M = 0.002, 0.005, 0.15
POSE_STD = (0.1, 0.1, 0.002)
REPEATS = 4  # of which the first compiles


def scene(n: int, clutter: int, seed: int) -> tuple[EkfFilter, Float, Float]:
    """A filter with n landmarks, and the points (n + clutter, 2) seen with their covariances."""
    rng = np.random.default_rng([n, seed])
    half = np.sqrt(n * SQUARE_M2) / 2.0
    landmarks = rng.uniform(-half, half, (n, 2))
    state = EkfFilter()
    state.add(landmarks, np.tile(np.eye(2) * LANDMARK_STD_M**2, (n, 1, 1)))
    state.predict(np.zeros(3), np.diag(np.square(POSE_STD)))
    seen = se2.transform(se2.inverse(rng.normal(0.0, POSE_STD)), landmarks)
    seen = seen + rng.normal(0.0, SENSOR_STD_M, seen.shape)
    near = landmarks[rng.integers(0, n, clutter)]
    points = np.concatenate([seen, near + rng.normal(0.0, CLUTTER_STD_M, near.shape)])
    covariances = np.tile(np.eye(2) * SENSOR_STD_M**2, (len(points), 1, 1))
    return state, rng.permutation(points), covariances


def run(case: Row) -> Row:
    """ms of processor time, the least of a few repeats, and what was counted."""
    n = case["pairs"]
    state, points, covariances = scene(n, case["clutter"], case["seed"])
    spent = []
    for _ in range(REPEATS):
        started = time.process_time()
        found = METHODS[case["method"]](state, np.arange(n), points, covariances, Gates())
        spent.append(1e3 * (time.process_time() - started))
    effort = found.effort
    counts = {"nodes": effort.nodes, "tests": effort.tests, "complete": effort.complete}
    return {"ms": min(spent), **counts}


def cell(rows: Sequence[Row]) -> str:
    """Time, nodes, tests."""
    words = ", ".join(of(key, form="{:.3g}")(rows) for key in ("ms", "nodes", "tests"))
    return words if all(row["complete"] for row in rows) else f"{words} (cut short)"


STUDY = Study(
    name="association_effort",
    axes={"pairs": (4, 8, 16, 32), "clutter": (0, 2, 4, 6), "method": ("jcbb", "ipjc")},
    run=run, lines=("pairs", "clutter"), across="method", cell=cell,
    told="ms, nodes, tests; medians of {seeds} scenes.", defaults={"seeds": 5, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
