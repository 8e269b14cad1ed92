# SPDX-License-Identifier: Apache-2.0
"""What a run along a log is judged by: errors, jumps, when a carried robot is found, NEES."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scripts.experiments import relations
from slam import se2
from slam.frames import Float

HEAD, HEAD_M = 50, 2.0  # scans at the beginning on which a run is laid on its reference, at least
FOUND_M, FOUND_RAD = 0.5, 0.2  # the pose of a carried robot stands right


@dataclass(frozen=True, kw_only=True)
class Run:
    """What ``along_log`` wrote."""

    stamps_ns: NDArray[np.int64]
    online: Float
    final: Float
    odometry: Float
    reference: Float
    covariance: Float
    converged: NDArray[np.bool_]
    spent_ms: Float

    @property
    def seconds(self) -> Float:
        """(n,) of the stamps."""
        return relations.seconds(self.stamps_ns)


def steps(poses: Float) -> list[Float]:
    """The motion (3,) from each pose to the next."""
    return [se2.between(a, b) for a, b in pairwise(poses)]


def jumps_m(run: Run) -> Float:
    """(n - 1,) m, each step of the reported pose beyond that of odometry; NaN without one."""
    pairs = zip(steps(run.online), steps(run.odometry), strict=True)
    return np.array([np.hypot(*se2.between(a, b)[:2]) for a, b in pairs])


def head_of(reference: Float, carried: int | None) -> slice:
    """The scans on which a run is laid on its reference: before the robot is carried."""
    away = np.hypot(*(reference[:, :2] - reference[0, :2]).T) > HEAD_M
    first = int(away.argmax()) if away.any() else len(reference)
    return slice(0, min(max(HEAD, first + 1), carried or len(reference)))


def errors(poses: Float, reference: Float, head: slice) -> Float:
    """(n, 3) in the frame of the reference, laid on it (SE(2), least squares) by those scans."""
    T = se2.fit(poses[head, :2], reference[head, :2])
    moved = np.column_stack([se2.transform(T, poses[:, :2]), poses[:, 2] + T[2]])
    off = moved - reference
    off[:, 2] = se2.wrap_array(off[:, 2])
    return off


def found_s(seconds: Float, off: Float, carried: int) -> float:
    """s from the carrying until the pose stands right for good; infinite where it never does."""
    wrong = (np.hypot(off[:, 0], off[:, 1]) > FOUND_M) | (np.abs(off[:, 2]) > FOUND_RAD)
    last = np.flatnonzero(wrong[carried:])
    first = carried + (int(last[-1]) + 1 if len(last) else 0)
    return float(seconds[first] - seconds[carried]) if first < len(seconds) else float("inf")


def nees(online: Float, covariance: Float, truth: Float, head: slice) -> float:
    """Median over the scans of e' P^-1 e, with e by ``head``; 2.37 where P is right."""
    T = se2.fit(truth[head, :2], online[head, :2])
    off = online - np.column_stack([se2.transform(T, truth[:, :2]), truth[:, 2] + T[2]])
    off[:, 2] = se2.wrap_array(off[:, 2])
    known = np.linalg.det(covariance) > 0.0
    weighed = np.linalg.solve(covariance[known], off[known, :, None])[:, :, 0]
    return float(np.median((off[known] * weighed).sum(axis=1)))


def truth_of(path: Path, seconds: Float) -> Float:
    """(n, 3) true poses of a TUM file at those times; NaN outside."""
    rows = np.array([line.split() for line in relations.lines_of(path)], dtype=np.float64)
    poses = np.column_stack([rows[:, 1:3], 2.0 * np.arctan2(rows[:, 6], rows[:, 7])])
    at = relations.by_time(rows[:, 0], poses)
    return np.array([pose if (pose := at(t)) is not None else np.full(3, np.nan) for t in seconds])
