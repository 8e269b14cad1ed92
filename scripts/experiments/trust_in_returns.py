# SPDX-License-Identifier: Apache-2.0
"""What each part of the trust in returns is worth in a crowd: one taken out at a time.

``python -m scripts.experiments.trust_in_returns``. Over all runs: geometric mean and worst of the
unaligned online error, and the share of silent failures. The oracle sees the same scans without the
returns of what can move.
"""

from __future__ import annotations

import sys

import numpy as np

from scripts.experiments import shared
from scripts.experiments.shared import CM, of
from scripts.experiments.study import Study

PARTS = (
    "shunting",
    "shunting{standing.settled_s=0}",  # all returns have the whole weight
    "shunting{standing.left_s=0}",  # what left is not looked for
    "shunting{standing.came_s=0}",  # what came is not looked for
    "shunting{standing.along_m=0.001,standing.thin_m=0}",  # without surfaces
    "shunting{standing.young_trace=0}",
    "shunting{standing.thin_m=0}",  # thin things are judged, too
    "shunting{standing.vague_m=1000,standing.sigmas=0}",  # vague poses judge
    "shunting{standing.disagreed=0}",  # odometry is not asked
    "shunting{carried_per_h=0}",  # never in doubt
    "oracle(shunting)",
)

STUDY = Study(
    name="trust_in_returns",
    axes={"scene": ("arena", "office", "gallery", "station"), "motion": (1.0,), "slam": PARTS},
    drive=lambda case: {
        "scene": case["scene"], "seed": case["seed"], "dynamism": case["motion"], "change": 0.0,
        "seconds": case["seconds"], "scanner": "noise", "every": 8,
    },
    run=shared.judged, lines=("slam",),
    columns={
        "mean, cm": of("ate_unaligned_m", shared.geometric, CM),
        "worst, cm": of("ate_unaligned_m", np.max, CM, "{:.1f}"),
        "silent": of("silent_share", np.mean, form="{:.3f}"),
    },
    defaults={"seeds": 2, "first_seed": 0, "seconds": 50.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
