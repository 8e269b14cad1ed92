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
TRUTH_M = 0.01  # of true poses: the lever of what they are of, and the clock


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


def beyond_odometry(run: Run) -> Float:
    """(n - 1, 3) what each step of the reported pose has more than that of odometry."""
    pairs = zip(steps(run.odometry), steps(run.online), strict=True)
    return np.array([se2.between(odometry, step) for odometry, step in pairs])


def large(off: Float) -> NDArray[np.bool_]:
    """(n,) which of (n, 3) are no place at which a robot that was carried counts as found."""
    return (np.hypot(off[:, 0], off[:, 1]) > FOUND_M) | (np.abs(off[:, 2]) > FOUND_RAD)


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


def found_at(wrong: NDArray[np.bool_], carried: int) -> int:
    """The first scan from the carrying on after which none is wrong; ``len(wrong)``: never."""
    last = np.flatnonzero(wrong[carried:])
    return carried + (int(last[-1]) + 1 if len(last) else 0)


def found(run: Run, found: int, carried: int) -> dict[str, float]:
    """s from the carrying until then, and the share of scans that were trusted meanwhile."""
    ever = found < len(run.online)
    return {
        "found_s": abs(float(run.seconds[found] - run.seconds[carried])) if ever else float("inf"),
        "hazard": float(run.converged[carried:found].sum() / len(run.online)),
    }


def nees(online: Float, covariance: Float, truth: Float) -> float:
    """Median over the scans of the position's e' P^-1 e; 1.39 where P is right.

    Laid on the truth by all scans, whose own frame is known to ``TRUTH_M``, which is part of P.
    """
    T = se2.fit(truth[:, :2], online[:, :2])
    off = online[:, :2] - se2.transform(T, truth[:, :2])
    P = covariance[:, :2, :2] + TRUTH_M**2 * np.eye(2)
    return float(np.median((off * np.linalg.solve(P, off[:, :, None])[:, :, 0]).sum(axis=1)))


def truth_of(path: Path, seconds: Float) -> Float:
    """(n, 3) true poses of a TUM file at those times; NaN outside."""
    rows = np.array([line.split() for line in relations.lines_of(path)], dtype=np.float64)
    poses = np.column_stack([rows[:, 1:3], 2.0 * np.arctan2(rows[:, 6], rows[:, 7])])
    at = relations.by_time(rows[:, 0], poses)
    return np.array([pose if (pose := at(t)) is not None else np.full(3, np.nan) for t in seconds])
