# SPDX-License-Identifier: Apache-2.0
"""Does shunting work with every scanner? ``python -m scripts.experiments.scanners``.

A tour of the office with each scanner, its statistical error alone and every error that its data
sheet states. The SLAM gets about five scans a second of each, as in ``mobilia compare``, and
nothing of it is set for the scanner.
"""

from __future__ import annotations

import sys

import numpy as np

from scripts.experiments import shared
from scripts.experiments.shared import CM, losses, of
from scripts.experiments.study import Study
from scripts.options import every_of
from sim.sensors.lidar.registry import names

SCANNERS = [
    *(f"{name}:{errors}" for name in names() if name != "scanner" for errors in ("noise", "full")),
    "scanner(fov_deg=240,beams=481,rate_hz=20,sigma_m=0.02):noise",  # has no other error
]

STUDY = Study(
    name="scanners",
    axes={"scene": ("office",), "level": (0.5,), "scanner": SCANNERS, "slam": ("shunting",)},
    drive=lambda case: shared.world_1(
        case, scanner=case["scanner"], every=every_of(case["scanner"], None, 8)
    ),
    run=shared.judged, lines=("scanner",),
    columns={
        "scans used": lambda rows: f"1 in {every_of(rows[0]['scanner'], None, 8)}",
        "median ATE, cm": of("ate_unaligned_m", scale=CM, form="{:.1f}"),
        "largest, cm": of("ate_unaligned_m", np.max, CM, "{:.1f}"), "lost": losses,
        "ms an update": of("ms_per_scan_p50", form="{:.1f}"),
    },
    defaults={"seeds": 3, "first_seed": 100, "seconds": 30.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
