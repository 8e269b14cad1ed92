# SPDX-License-Identifier: Apache-2.0
"""Does the SLAM say so when a crowd has carried it off? ``python -m scripts.experiments.honesty``.

Streams are crowds on train seeds. A scan is *due* that is off by more than ``SILENT_M`` for
``DUE_S`` or longer. It is *admitted* where the error is within 3 sigma of the covariance of
position, or the SLAM is not converged. A *false alarm* is a scan that is less far off and not
converged. ``python -m scripts.experiments.pushes`` is about the same streams.
"""

from __future__ import annotations

import sys
from pathlib import Path

from scripts.experiments import shared
from scripts.experiments.shared import CM, Row, of, share
from scripts.experiments.study import Study

SCENES = ("office", "arena", "gallery", "station")
TRAIN = {1.0: range(8), 0.75: range(8, 14), 0.5: range(14, 20)}  # seeds of each motion


def crowd(case: Row) -> Row:
    """The crowd alone: nothing changes places; one scan in 8, of 37.5 a second."""
    return {
        "scene": case["scene"], "seed": case["seed"], "dynamism": case["motion"],
        "motion": case["motion"], "change": 0.0, "seconds": case["seconds"], "scanner": "noise",
        "every": 8,
    }  # fmt: skip


def trained(case: Row) -> bool:
    """Whether that seed is one of its motion."""
    return case["seed"] in TRAIN.get(case["motion"], ())


STUDY = Study(
    name="honesty",
    axes={"scene": SCENES, "motion": tuple(TRAIN), "slam": ("shunting",)},
    drive=crowd, fits=trained, run=shared.judged,
    lines=("motion", "scene"), pooled=("motion", "scene"),
    columns={
        "ATE, cm": of("ate_unaligned_m", shared.geometric, CM), "lost": shared.losses,
        "scans due": of("due", sum, form="{:.0f}"), "admitted": share("told", "due", "{:.1f} %"),
        "false alarms": share("false", "good", "{:.2f} %"), "NEES / 3": of("nees_over_3"),
    },
    page=Path("docs/uncertainty.md"), defaults={"seeds": 20, "first_seed": 0, "seconds": 50.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
