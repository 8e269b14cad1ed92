# SPDX-License-Identifier: Apache-2.0
"""Is the covariance honest on real logs? ``python -m scripts.experiments.log_covariance``.

The online pose in the frame of the first one, beside the corrected poses that the log holds, which
are those of another SLAM and have an error of their own. NEES / 3 is 1 where the covariance is
right; its mean over scans hides a covariance that is far too large, so the medians of the error and
of what two sigma claim stand beside it. How sharp the map is by our final poses and by the log's,
in nats below shuffled poses, says which of the two to believe.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

from scripts.experiments.shared import CM, Row, of
from scripts.experiments.study import Study
from scripts.metrics.judged import Judged, world_truth
from slam.evaluation.consistency import KeptScans
from slam.logs import open_log
from slam.replay import Track
from slam.system import create

LOGS = (
    "intel/intel-corrected", "fhw_museum/fhw-corrected", "mit_csail/csail-corrected",
    "belgioioso/belgioioso-corrected", "freiburg_101/freiburg-101-corrected",
    "seattle/seattle-corrected", "edmonton/edmonton-corrected",
)  # fmt: skip


def file_of(case: Row) -> Path:
    """The log of a case."""
    return Path(case["data"]) / f"{case['log']}.log.xz"


def run(case: Row) -> Row:
    """Errors and claims, m, of one log."""
    frames = [frame for frame in open_log(file_of(case)) if frame.truth is not None]
    track, kept = Track(case["slam"], create(case["slam"])), KeptScans()
    failure = track.survive(frames)
    if failure is not None:
        raise failure
    for frame, estimate in zip(frames, track.estimates, strict=True):
        kept.note(frame, estimate.T_map_robot)
    truth = world_truth(frames)
    judged, covariances = Judged.of(track, truth), track.covariances()
    claimed = 2.0 * np.sqrt(covariances[:, 0, 0] + covariances[:, 1, 1])
    ours = kept.judged((track.final() or track.online()).poses)
    theirs = kept.judged(truth.poses)
    return {
        "scans": len(frames), "ate_m": judged.ate(), "nees_over_3": judged.nees_over_3(),
        "error_m": float(np.median(judged.pairs.distances)), "claimed_m": float(np.median(claimed)),
        "ours_nats": math.nan if ours is None else ours.sharper_nats,
        "theirs_nats": math.nan if theirs is None else theirs.sharper_nats,
    }  # fmt: skip


STUDY = Study(
    name="log_covariance",
    axes={"log": LOGS, "data": ("../shared/data",), "slam": ("shunting",)},
    run=run, data=lambda case: [file_of(case)], lines=("log",),
    columns={
        "scans": of("scans", form="{:.0f}"), "ATE, cm": of("ate_m", scale=CM, form="{:.0f}"),
        "NEES / 3": of("nees_over_3"),
        "median error, cm": of("error_m", scale=CM, form="{:.0f}"),
        "median 2 σ, cm": of("claimed_m", scale=CM, form="{:.0f}"),
        "sharpness, nats": of("ours_nats"), "by the log's poses": of("theirs_nats"),
    },
    told="`shunting`, seven logs, online poses in the frame of the first.",
    page=Path("docs/uncertainty.md"), defaults={"seeds": 1, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
