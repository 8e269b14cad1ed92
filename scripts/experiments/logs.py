# SPDX-License-Identifier: Apache-2.0
"""Errors, claims and loops on logs of real robots: ``python -m scripts.experiments.logs``.

The online pose in the frame of the first one, beside the corrected poses that the log holds, which
are those of another SLAM and have an error of their own. The mean of NEES / 3 hides a covariance
that is far too large, so the medians of the error and of what two sigma claim stand beside it. How
sharp the map is by our final poses and by the log's, in nats below shuffled poses, says which of
the two to believe. ``--every 2`` takes every second scan, ``--way backwards`` the log from its end.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from scripts.comparison.entry import scored
from scripts.experiments.study import CM, Row, Study, of
from scripts.metrics.judged import Judged, world_truth
from slam.evaluation import metrics
from slam.evaluation.consistency import KeptScans
from slam.frames import Frame
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


def backwards(frames: Sequence[Frame]) -> list[Frame]:
    """The same scans and poses, from the last to the first."""
    ends = frames[0].stamp_ns + frames[-1].stamp_ns
    return [
        replace(
            frame,
            stamp_ns=ends - frame.stamp_ns,
            odometry=replace(frame.odometry, stamp_ns=ends - frame.stamp_ns),
            scan=frame.scan and replace(frame.scan, stamp_ns=ends - frame.stamp_ns),
        )
        for frame in reversed(frames)
    ]


def run(case: Row) -> Row:
    """The columns of a comparison; claims and errors, m; how sharp the map is by whose poses."""
    frames = [f for f in open_log(file_of(case)) if f.truth is not None][:: case["every"]]
    frames = backwards(frames) if case["way"] == "backwards" else frames
    track, kept = Track(case["slam"], create(case["slam"])), KeptScans()
    failure = track.survive(frames)
    if failure is not None:
        raise failure
    for frame, estimate in zip(frames, track.estimates, strict=True):
        kept.note(frame, estimate.T_map_robot)
    truth, final = world_truth(frames), track.final() or track.online()
    covariances = track.covariances()
    claimed = 2.0 * np.sqrt(covariances[:, 0, 0] + covariances[:, 1, 1])
    sharp = {
        name: found.sharper_nats
        for name, poses in (("ours", final.poses), ("theirs", truth.poses))
        if (found := kept.judged(poses)) is not None
    }
    return scored(track, final, None, truth) | sharp | {
        "final_m": metrics.ate(final, truth, align="se2").value,
        "error_m": float(np.median(Judged.of(track, truth).pairs.distances)),
        "claimed_m": float(np.median(claimed)),
        "moved": sum(any(e.diagnostics.get("correction", ())) for e in track.estimates),
    }  # fmt: skip


STUDY = Study(
    name="logs",
    axes={"log": LOGS, "data": ("data",), "slam": ("shunting",), "every": (1,),
          "way": ("forwards",)},
    run=run, data=lambda case: [file_of(case)], lines=("log", "slam", "every", "way"),
    columns={
        "scans": of("scans", form="{:.0f}"),
        "ATE, cm": of("ate_unaligned_m", scale=CM, form="{:.0f}"),
        "aligned": of("ate_se2_m", scale=CM, form="{:.1f}"),
        "final": of("final_m", scale=CM, form="{:.1f}"), "NEES / 3": of("nees_over_3"),
        "median error, cm": of("error_m", scale=CM, form="{:.0f}"),
        "median 2 σ, cm": of("claimed_m", scale=CM, form="{:.0f}"),
        "sharpness, nats": of("ours"), "by the log's poses": of("theirs"),
        "corrections": of("moved", form="{:.0f}"),
        "ms a scan": of("ms_per_scan_p50", form="{:.1f}"),
        "p99.9": of("ms_per_scan_p999", form="{:.1f}"),
    },
    told="Online poses in the frame of the first; aligned, and of the final trajectory aligned.",
    page=Path("docs/uncertainty.md"), defaults={"seeds": 1, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
