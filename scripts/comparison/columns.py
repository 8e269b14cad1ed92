# SPDX-License-Identifier: Apache-2.0
"""The row of one SLAM in ``runs.csv``: who, how it ended, and every metric of the table."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scripts.metrics import table
from scripts.metrics.judged import Judged, lost_s
from slam.errors import SlamFailedError
from slam.evaluation import metrics
from slam.frames import NS_PER_S
from slam.replay import Track
from slam.trajectory import Trajectory

STEADY_SCANS = 5  # timings count after this


def scored(
    track: Track, final: Trajectory | None, failure: SlamFailedError | None, truth: Trajectory
) -> dict[str, Any]:
    """The row of one SLAM, its maps and identity aside; None where there is no number."""
    steady_s = np.array(track.durations_s[STEADY_SCANS:])
    judged = replace(Judged.of(track, None, final), steady_s=steady_s)
    row: dict[str, Any] = {"scans": len(track.estimates), **_computed(judged)}
    lost_at_s = lost_at(track.online(), truth)
    if failure is not None:
        outcome = getattr(failure, "outcome", "raised")
        if lost_at_s is None:
            lost_at_s = _failed_at_s(track, truth)
        return row | {
            "outcome": outcome, "failure": str(failure), "lost": 1, "lost_at_s": lost_at_s,
        }  # fmt: skip
    row |= {"outcome": "finished" if lost_at_s is None else "lost", "failure": None}
    row |= {"lost": int(lost_at_s is not None), "lost_at_s": lost_at_s}
    return row | _computed(replace(judged, truth=truth))


def _computed(judged: Judged) -> dict[str, Any]:
    """The columns that the table of metrics computes, those without a value left out."""
    values = {key: table.METRICS[key].of(judged) for key in table.COLUMNS}
    return {key: value for key, value in values.items() if value is not None}


def lost_at(online: Trajectory, truth: Trajectory) -> float | None:
    """Seconds from the start to the loss (``slam.evaluation.lost``); None if it never was lost."""
    if len(online) == 0:
        return None
    return lost_s(metrics.pose_errors(online, truth), truth)


def _failed_at_s(track: Track, truth: Trajectory) -> float:
    """Of the scan that it did not answer."""
    k = min(len(track.estimates), len(truth) - 1)
    return float(truth.stamps_ns[k] - truth.stamps_ns[0]) / NS_PER_S
