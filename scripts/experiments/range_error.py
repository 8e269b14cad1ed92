# SPDX-License-Identifier: Apache-2.0
"""The scanner's systematic error learnt: ``python -m scripts.experiments.range_error``.

For each scene, dynamism and scanner: the unaligned and the aligned online error with the error
learnt and without, and in how many runs an error was found.
"""

from __future__ import annotations

import sys

import numpy as np

from scripts.experiments import shared
from scripts.experiments.shared import CM, of
from scripts.experiments.study import Study

SLAMS = ("shunting", "shunting{range_error.learn=on}")


STUDY = Study(
    name="range_error",
    axes={"scanner": ("noise", "full"), "scene": ("office", "arena"), "level": (0.0, 0.5),
          "slam": SLAMS},
    drive=lambda case: shared.world_1(case, scanner=case["scanner"], every=8),
    run=shared.judged, lines=("scene", "level", "scanner", "slam"),
    columns={
        "ATE, cm": of("ate_unaligned_m", scale=CM), "worst": of("ate_unaligned_m", np.max, CM),
        "aligned": of("ate_se2_m", scale=CM),
        "found": lambda rows: f"{sum(row.get('found', False) for row in rows)} of {len(rows)}",
    },
    defaults={"seeds": 3, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
