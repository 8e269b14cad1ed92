# SPDX-License-Identifier: Apache-2.0
"""What a run along a log is judged by: errors, jumps, when a carried robot is found, NEES."""

import argparse
import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.experiments import along_log, relations, revisits
from slam import se2
from slam.evaluation.consistency import KeptScans
from slam.frames import Float
from slam.trajectory import read_tum

Row = dict[str, Any]
HEAD, HEAD_M = 50, 2.0  # scans at the beginning on which a run is laid on its reference, at least
FOUND_M, FOUND_RAD = 0.5, 0.2  # the pose of a carried robot stands right
TRUTH_M, CORRECTED_M = 0.01, 0.1  # what the frame of true poses is off by; another SLAM's poses
HAZARD_M, JUMP_M = 1.0, 0.5  # trusted and farther off; a step is a jump
FIRST = 40  # scans of which the time is not counted
LEAST_REVISITS, SAME_CM = 3, 20.0  # of scans after a carrying and before: the robot is found


@dataclass(frozen=True, kw_only=True)
class Log:
    """One log and what is known of it.

    relations  file, and its clock less the log's, s; ``dense``: scans are near enough in time
    carried    the first scan after the robot was carried
    truth      TUM file of true poses; else the reference is what the log holds, if anything
    laser      pose on the robot, where the log does not say it; ``scan``: topics, of several
    """

    file: str
    relations: tuple[str, float] | None = None
    dense: bool = False
    carried: int | None = None
    truth: str | None = None
    laser: tuple[float, float, float] | None = None
    scan: tuple[str, ...] = ()


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


def nees(online: Float, covariance: Float, reference: Float, sigma_m: float) -> float:
    """Median over the scans of the position's e' P^-1 e; 1.39 where P is right.

    Laid on the reference by all scans, which has an error of its own: ``sigma_m`` each way.
    """
    off = -errors(reference, online, slice(None))[:, :2]
    P = covariance[:, :2, :2] + sigma_m**2 * np.eye(2)
    return float(np.median((off * np.linalg.solve(P, off[:, :, None])[:, :, 0]).sum(axis=1)))


def truth_of(path: Path, seconds: Float) -> Float:
    """(n, 3) true poses of a TUM file at those times; NaN outside."""
    truth = read_tum(path)
    at = relations.by_time(relations.seconds(truth.stamps_ns), truth.poses)
    return np.array([pose if (pose := at(t)) is not None else np.full(3, np.nan) for t in seconds])


def against(run: Run, reference: Float, log: Log) -> Row:
    """The columns of a log with a reference."""
    known = np.isfinite(reference).all(axis=1)
    truth = reference[known]
    row: Row = {}
    for name, poses in (("online_m", run.online), ("final_m", run.final)):
        squares = errors(poses[known], truth, slice(None))[:, :2] ** 2
        row[name] = math.sqrt(float(squares.sum(axis=1).mean()))
    off = errors(run.online[known], truth, head_of(truth, log.carried))
    far = np.hypot(off[:, 0], off[:, 1]) > HAZARD_M
    row["hazard"] = float((run.converged[known] & far).mean())
    if log.carried is not None:
        row["found_s"] = found(run, found_at(large(off), log.carried), log.carried)["found_s"]
    sigma_m = CORRECTED_M if log.truth is None else TRUTH_M
    row["nees"] = nees(run.online[known], run.covariance[known], truth, sigma_m)
    return row


def by_itself(run: Run, log: Log, given: argparse.Namespace) -> Row:
    """The columns of a log without a reference: by its own scans where the robot is back."""
    frames = list(along_log.frames_of(given))
    told = revisits.judged(frames, run.seconds, run.final, log.carried)
    kept = KeptScans()
    for frame in frames:
        kept.note(frame, frame.odometry.T_odom_robot)  # the same scans for every SLAM
    sharp = kept.judged(run.final)
    row: Row = {"revisits": told.count, "revisits_cm": told.apart_cm}
    row["sharp_nats"] = None if sharp is None else sharp.sharper_nats
    if log.carried is not None:
        sure = told.count >= LEAST_REVISITS and (told.apart_cm or 0.0) < SAME_CM
        wrong = np.append(large(beyond_odometry(run)), not sure)  # until the last jump, or always
        row |= found(run, found_at(wrong, log.carried), log.carried)
    return row


def by_relations(run: Run, log: Log, data: Path) -> Row:
    """Their columns; none for a log without."""
    if log.relations is None:
        return {}
    known, row = relations.relations_of(data / log.relations[0]), {}
    lines = [] if log.dense else relations.lines_of(data / log.file)
    for which, poses in (("online", run.online), ("final", run.final)):
        dense = relations.by_time(run.seconds, poses)
        at = dense if log.dense else relations.by_odometry(lines, run.reference, poses)
        row[f"relations_{which}_m"] = relations.error_m(known, log.relations[1], at)
    return row


def judged(run: Run, log: Log, data: Path, given: argparse.Namespace) -> Row:
    """All columns of a run; ``given``: the options of ``along_log``."""
    if log.carried is not None:
        carried = -(-log.carried // given.every)
        log = replace(log, carried=len(run.online) - carried if given.backwards else carried)
    reference = run.reference if log.truth is None else truth_of(data / log.truth, run.seconds)
    referred = bool(np.isfinite(reference).any())
    row = against(run, reference, log) if referred else by_itself(run, log, given)
    row |= {"scans": len(run.online), "trusted": float(run.converged.mean())}
    if np.isfinite(run.odometry).all():
        jumps = np.hypot(*beyond_odometry(run)[:, :2].T)
        row |= {"jump_m": float(jumps.max()), "jumps": int((jumps > JUMP_M).sum())}
    spent = run.spent_ms[FIRST:][np.isfinite(run.spent_ms[FIRST:])]
    if len(spent):
        row |= {"p50_ms": float(np.median(spent)), "p999_ms": float(np.quantile(spent, 0.999))}
    return row | by_relations(run, log, data)
