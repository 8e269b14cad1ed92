# SPDX-License-Identifier: Apache-2.0
"""Does the SLAM work at any scan rate? ``python -m scripts.experiments.rates``.

Each stream, a scene at a dynamism or a track at a level, is simulated once at 37.5 scans a second,
and replayed with one scan in so many. Between the scans that are kept, odometry sums up. Every
number of the SLAM stays the same.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from scripts.experiments import shared
from scripts.experiments.shared import CM, PERCENT, of, on_stream, share
from scripts.experiments.study import Study
from slam.evaluation.lost import LOST_RULE

STREAMS = ("office", "arena", "rush-hour", "slow-scans", "kidnapped-in-a-crowd")
FULL_HZ = 37.5  # scans a second of the LMS-221

STUDY = Study(
    name="rates",
    axes={"stream": STREAMS, "level": (0.5,), "slam": ("shunting", "oracle(shunting)"),
          "every": (38, 19, 8, 4, 2, 1)},
    drive=lambda case: on_stream(*(case[key] for key in ("stream", "level", "seed", "seconds"))),
    run=shared.judged, apart="slam", lines=("stream", "every"), hidden=("every",),
    pooled=("stream",),
    columns={
        "scans/s": lambda rows: f"{FULL_HZ / rows[0]['every']:.3g}",
        "error, cm": of("error_m", shared.geometric, CM),
        "worst, cm": of("error_m", np.max, CM, "{:.1f}"),
        "lost": lambda rows: f"{sum(row['lost_s'] is not None for row in rows)} of {len(rows)}",
        "silent": of("silent_share", np.mean, PERCENT, "{:.1f} %"),
        "admitted": share("told", "due"),
        "false alarms": share("false", "good", "{:.1f} %"), "NEES / 3": of("nees_over_3"),
    },
    told="World {world}, {seeds} drives of a stream, level {level[0]:g}, training seeds from "
    "{first_seed}; scenes for {seconds:g} s, tracks as long as they are. Lost: " + LOST_RULE + ".",
    page=Path("docs/rates.md"), results=True, defaults={"seeds": 3, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
