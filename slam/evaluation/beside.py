# SPDX-License-Identifier: Apache-2.0
"""A log and its twin, scan beside scan: by how much the ranges of the same beams differ."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.evaluation.evidence import COARSE_M, evidence_of
from slam.frames import Float, Frame

NEAR_M = (0.05, 0.10)  # beams nearer than that agree


@dataclass(frozen=True, kw_only=True, eq=False)
class Beside:
    """Of all n beams of the log that have a return.

    points   (n, 2) m, where the log's return lies
    apart    (n,) m, the twin's range less the log's; inf where the twin has no return
    stands   (n,) whether other scans of the log say that what is there stands
    """

    points: Float
    apart: Float
    stands: NDArray[np.bool_]

    def words(self) -> dict[str, Any]:
        """Medians and shares: of all beams, of those on what stands, and of the others."""
        of = {"all": np.ones_like(self.stands), "stands": self.stands, "changed": ~self.stands}
        return {name: self._part(chosen) for name, chosen in of.items()}

    def _part(self, chosen: NDArray[np.bool_]) -> dict[str, Any]:
        apart = np.abs(self.apart[chosen])
        if not len(apart):
            return {"beams": 0}
        within = {f"within_{100 * m:.0f}_cm": round(float((apart <= m).mean()), 4) for m in NEAR_M}
        return {
            "beams": len(apart),
            "median_m": round(float(np.median(apart)), 4),
            "nearer_m": round(float(np.median(self.apart[chosen])), 4),
            **within,
        }


def beside(log: Iterable[Frame], twin: Iterable[Frame], poses: Float) -> Beside:
    """Of frames at the same poses of the robot, (n, 3) in the frame of the building."""
    frames = list(log)
    scans = [frame.scan for frame in frames if frame.scan is not None]
    coarse = evidence_of(scans, poses, COARSE_M)
    points, apart, stands = [], [], []
    for ours, theirs, pose in zip(scans, twin, poses, strict=True):
        if theirs.scan is None:
            continue
        laser = se2.compose(pose, ours.spec.T_robot_laser)
        valid, heading = ours.valid, laser[2] + ours.spec.angles
        ranges = ours.ranges[valid].astype(np.float64)
        x = laser[0] + ranges * np.cos(heading[valid])
        y = laser[1] + ranges * np.sin(heading[valid])
        points.append(np.column_stack([x, y]))
        seen = np.where(theirs.scan.valid, theirs.scan.ranges, np.inf)[valid]
        apart.append(seen - ranges)
        stands.append(coarse.stands(points[-1]))
    return Beside(
        points=np.concatenate(points), apart=np.concatenate(apart), stands=np.concatenate(stands)
    )
