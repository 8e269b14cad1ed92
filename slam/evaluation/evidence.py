# SPDX-License-Identifier: Apache-2.0
"""Which places of a log stand: cells that scans hit, and cells that scans look through.

Scans are laid over each other at given poses. Neighbouring returns on one surface are joined, so
that a wall far away is a line and no dots. ``beside`` puts a log and its twin scan beside scan.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam._jit import njit
from slam.errors import InvalidValueError
from slam.frames import Float, Frame, Scan
from slam.system import Raster

CELL_M = 0.05  # of a plan: a wall is two to four cells thick
COARSE_M = 0.2  # of what stands or not, as wide as a leg with the error of its pose
JOIN_M = 0.3  # neighbouring returns nearer than this lie on one surface
KEPT_BACK_M = 0.2  # before a return nothing is said to be free
FAR_M = 25.0  # returns farther away place a surface badly, as the heading errs
SEEN_THROUGH, TIMES = 5, 4  # scans that look through a place, and times as many as hit it: it moved
OCCUPIED = 0.25  # share of the scans that hit a cell, of those that say something: a wall
MOST_CELLS = 40_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """(rows, columns) scans that hit each cell, and that look through it; row 0 the lowest y.

    low  x m, y m of the lower left corner
    """

    hits: NDArray[np.int32]
    through: NDArray[np.int32]
    low: tuple[float, float]
    cell_m: float

    def raster(self) -> Raster:
        """1 where a surface is, 0 free, NaN unknown."""
        said = self.hits + self.through
        share = self.hits / np.maximum(said, 1)
        values = np.where((self.hits >= 1) & (share >= OCCUPIED), 1.0, 0.0)
        values[said == 0] = np.nan
        return Raster(
            values=values.astype(np.float32),
            resolution_m=self.cell_m,
            T_map_origin=np.array([*self.low, 0.0]),
        )

    def stands(self, points: Float) -> NDArray[np.bool_]:
        """(n,) whether what is at (n, 2) m stands: not looked through far more often than hit."""
        j = np.floor((points[:, 0] - self.low[0]) / self.cell_m).astype(np.int64)
        i = np.floor((points[:, 1] - self.low[1]) / self.cell_m).astype(np.int64)
        rows, columns = self.hits.shape
        inside = (i >= 0) & (j >= 0) & (i < rows) & (j < columns)
        i, j = np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)
        hits, through = self.hits[i, j], self.through[i, j]
        moved = (through >= SEEN_THROUGH) & (through >= TIMES * np.maximum(hits, 1))
        stands: NDArray[np.bool_] = inside & ~moved
        return stands


def evidence_of(
    scans: Iterable[Scan], poses: Sequence[Float] | Float, cell_m: float = CELL_M
) -> Evidence:
    """What ``scans`` say, each taken at its pose of the robot, (n, 3) m, m, rad.

    Raises ``InvalidValueError`` for a floor of more than 40 million cells.
    """
    lasers = []
    for scan, pose in zip(scans, poses, strict=True):
        laser = se2.compose(np.asarray(pose, dtype=np.float64), scan.spec.T_robot_laser)
        ranges = np.where(scan.valid, scan.ranges, np.nan).astype(np.float64)
        lasers.append((laser, ranges, scan.spec.angles))
    reach = [min(FAR_M, float(np.nanmax(r, initial=0.0))) for _, r, _ in lasers]
    xy = np.array([laser[:2] for laser, _, _ in lasers]).reshape(-1, 2)
    far = np.array(reach).reshape(-1, 1)
    low = np.floor((xy - far).min(axis=0) / cell_m - 2.0) * cell_m
    size = np.ceil(((xy + far).max(axis=0) - low) / cell_m).astype(np.int64) + 2
    if size.prod() > MOST_CELLS:
        raise InvalidValueError(
            f"the scans cover {size[0] * cell_m:.0f} x {size[1] * cell_m:.0f} m, at most "
            f"{math.sqrt(MOST_CELLS) * cell_m:.0f} m squared at cells of {cell_m:g} m"
        )
    hits = np.zeros((size[1], size[0]), dtype=np.int32)
    through, marks = np.zeros_like(hits), np.zeros_like(hits)
    for number, (laser, ranges, angles) in enumerate(lasers):
        _add(laser, ranges, angles, (low[0], low[1], cell_m), 2 * number + 2, hits, through, marks)
    return Evidence(hits=hits, through=through, low=(float(low[0]), float(low[1])), cell_m=cell_m)


@njit
def _add(  # noqa: PLR0913 (kernel)
    laser: Float,
    ranges: Float,
    angles: Float,
    frame: tuple[float, float, float],
    mark: int,
    hits: NDArray[np.int32],
    through: NDArray[np.int32],
    marks: NDArray[np.int32],
) -> None:
    """Count one scan: each cell once, as hit or as looked through."""
    low_x, low_y, cell = frame
    ax = ay = math.nan
    for k in range(len(ranges)):
        r = ranges[k]
        if not r <= FAR_M:
            ax = math.nan
            continue
        c, s = math.cos(laser[2] + angles[k]), math.sin(laser[2] + angles[k])
        x, y = laser[0] + r * c, laser[1] + r * s
        apart = math.sqrt((x - ax) ** 2 + (y - ay) ** 2)
        steps = int(apart / (0.5 * cell)) + 1 if apart < JOIN_M else 1
        for step in range(steps):
            share = (step + 1) / steps
            px, py = x, y
            if steps > 1:
                px, py = ax + share * (x - ax), ay + share * (y - ay)
            i, j = int((py - low_y) / cell), int((px - low_x) / cell)
            if marks[i, j] != mark + 1:
                marks[i, j] = mark + 1
                hits[i, j] += 1
        ax, ay = x, y
    for k in range(len(ranges)):
        r = min(ranges[k], FAR_M)
        if math.isnan(r):
            continue
        c, s = math.cos(laser[2] + angles[k]), math.sin(laser[2] + angles[k])
        for step in range(int((r - KEPT_BACK_M) / (0.5 * cell))):
            px, py = laser[0] + 0.5 * cell * step * c, laser[1] + 0.5 * cell * step * s
            i, j = int((py - low_y) / cell), int((px - low_x) / cell)
            if marks[i, j] < mark:
                marks[i, j] = mark
                through[i, j] += 1


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
