# SPDX-License-Identifier: Apache-2.0
"""Relations of a log by Kümmerle et al. (Autonomous Robots 27, 2009): motions checked by a human.

A line of such a file has two times and the motion ``x y z roll pitch yaw`` of the robot from the
first to the second. They need no common frame, so errors far away do not count again and again.
"""

import bisect
import lzma
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import LogFormatError
from slam.frames import NS_PER_S, Float

LATE_S = 0.6  # a relation's end is no farther from a line of the log
GAP_S = 2.0  # no pose is put between scans farther apart
At = Callable[[float], Float | None]


def lines_of(path: Path) -> list[str]:
    """Of a text file, also of a packed one."""
    with lzma.open(path, "rt") if path.suffix == ".xz" else path.open() as file:
        return file.read().splitlines()


def relations_of(path: Path) -> list[tuple[float, float, Float]]:
    """Times s and motion (3,) of each relation; ``LogFormatError`` for another kind of line."""
    found = []
    for number, line in enumerate(lines_of(path), start=1):
        words = line.split()
        if not words:
            continue
        try:
            start, end, x, y, _, _, _, yaw = map(float, words)
        except ValueError:
            raise LogFormatError(path, f"line {number}: 8 numbers expected, got {line!r}") from None
        found.append((start, end, np.array([x, y, yaw])))
    return found


def by_time(stamps_s: Float, poses: Float) -> At:
    """The pose at a time, on the arc between two scans: of a dense log."""
    order = np.argsort(stamps_s, kind="stable")  # of one that was taken backwards
    stamps_s, poses = stamps_s[order], poses[order]

    def at(time: float) -> Float | None:
        k = bisect.bisect_left(stamps_s, time)
        if k == 0 or k >= len(stamps_s) or stamps_s[k] - stamps_s[k - 1] > GAP_S:
            return None
        share = (time - stamps_s[k - 1]) / (stamps_s[k] - stamps_s[k - 1])
        return se2.interpolate(poses[k - 1], poses[k], share)

    return at


def by_odometry(log: Sequence[str], reference: Float, poses: Float) -> At:
    """The pose at a time: of the scan before, and the ODOM lines since; of a sparse CARMEN log.

    reference  (n, 3) corrected poses of the scans, by which those of the lines are told
    """
    scans = {tuple(np.round(pose[:2], 6)): k for k, pose in enumerate(reference)}
    times, entries = [], []
    scan: tuple[int, Float] | None = None
    for words in map(str.split, log):
        if not words or words[0] not in ("FLASER", "ODOM"):
            continue
        first = 2 + int(words[1]) if words[0] == "FLASER" else 1
        pose = np.array(words[first : first + 3], dtype=np.float64)
        if words[0] == "FLASER":
            index = scans.get(tuple(np.round(pose[:2], 6)))
            scan = None if index is None else (index, pose)
        if scan is not None:
            times.append(float(words[first + 6]))
            entries.append((scan[0], se2.between(scan[1], pose)))
    order = np.argsort(times, kind="stable")
    ordered = [times[k] for k in order]

    def at(time: float) -> Float | None:
        k = bisect.bisect_left(ordered, time)
        near = [j for j in (k - 1, k) if 0 <= j < len(ordered)]
        best = min(near, key=lambda j: abs(ordered[j] - time))
        if abs(ordered[best] - time) > LATE_S:
            return None
        index, since = entries[order[best]]
        return se2.compose(poses[index], since)

    return at


def seconds(stamps_ns: Sequence[int] | np.ndarray) -> Float:
    """Of whole nanoseconds."""
    return np.asarray(stamps_ns, dtype=np.float64) / NS_PER_S


def error_m(relations: Sequence[tuple[float, float, Float]], offset_s: float, at: At) -> float:
    """Mean translation error m, over the relations whose ends ``at`` knows; NaN for none.

    offset_s  relation time less time of the log
    """
    errors = []
    for start, end, motion in relations:
        a, b = at(start - offset_s), at(end - offset_s)
        if a is not None and b is not None:
            off = se2.between(motion, se2.between(a, b))
            errors.append(float(np.hypot(off[0], off[1])))
    return float(np.mean(errors)) if errors else float("nan")
