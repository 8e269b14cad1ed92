# SPDX-License-Identifier: Apache-2.0
"""Accuracy over seeds nobody tuned on: ``python -m scripts.experiments.accuracy``.

The median over the seeds of the unaligned online error, the worst beside it, the same aligned and
of the corrected trajectory, the heading, NEES / 3 after the first 5 s (1 where the covariance is
right), runs off by more than ``LOST_M``, and scans in doubt. All drives are of world 1: no crowd.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from scripts.experiments import shared
from scripts.experiments.shared import CM, of
from scripts.experiments.study import Study
from slam.evaluation.lost import LOST_M

DEG = 180.0 / math.pi
ARENA, BARE = {"scene": "arena", "dynamism": 0.5}, {"crowd": "none", "walls": "none"}
DRIVES = {
    **{f"office {level:g}": {"scene": "office", "dynamism": level} for level in (0.0, 0.5, 1.0)},
    "arena, all move": {**ARENA, "moving_share": 1.0},
    **{
        f"no walls, {which} move": {**ARENA, "moving_share": share, "options": BARE}
        for which, share in (("30 %", 0.3), ("50 %", 0.5), ("all", 1.0))
    },
    "corridor": {"scene": "corridor", "dynamism": 0.0},
}

STUDY = Study(
    name="accuracy",
    axes={"scanner": ("noise", "full"), "drive": tuple(DRIVES), "every": (8, 1),
          "slam": ("shunting", "occupancy", "odometry")},
    drive=lambda case: shared.world_1(
        {"scene": "", "level": 0.0, **case}, scanner=case["scanner"], **DRIVES[case["drive"]]
    ),
    run=shared.judged, lines=("drive", "scanner", "every", "slam"),
    columns={
        "ATE, cm": of("ate_unaligned_m", scale=CM), "worst": of("ate_unaligned_m", np.max, CM),
        "aligned": of("ate_se2_m", scale=CM), "final": of("ate_final_m", scale=CM),
        "heading, °": of("heading_rmse_rad", scale=DEG, form="{:.3f}"),
        "worst, °": of("heading_rmse_rad", np.max, DEG, "{:.3f}"),
        "NEES / 3": of("nees_over_3", np.mean),
        "lost": of("ate_unaligned_m", lambda ates: (ates > LOST_M).sum(), form="{:.0f}"),
        "doubt": of("doubted", np.sum, form="{:.0f}"), "ms": of("ms_per_scan_p50"),
    },
    defaults={"first_seed": 100},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
