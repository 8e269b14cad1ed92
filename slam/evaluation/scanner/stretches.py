# SPDX-License-Identifier: Apache-2.0
"""A log in stretches: where the robot stood still, and blocks of scans while it drove."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, LaserSpec, Stream

STILL_M = 1e-3  # m of odometry from scan to scan, up to which the robot stands
STILL_RAD = 1e-3  # rad, likewise
LEAST_STANDING = 8  # scans of a standing stretch; the first and the last are not used
CREPT_M = 0.01  # m between the mean ranges of its halves, median beam: odometry that came late
BLOCK = 10  # scans of a block while driving
MOST_BLOCKS = 150  # evenly spread over the log; more add little
MOST_SCANS = 100_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretch:
    """Scans of one place: (k, n) ``ranges`` m, NaN where nothing came back."""

    ranges: Float
    standing: bool

    def looked_at(self) -> Float:
        """(at most ``BLOCK``, n) scans, evenly: those of a standing robot are all alike."""
        every = max(1, len(self.ranges) // BLOCK)
        return self.ranges[::every][:BLOCK]


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretches:
    """Of one log; ``crept``: how many stood by odometry but not by the ranges, and are left out."""

    spec: LaserSpec
    parts: tuple[Stretch, ...]
    scans: int
    crept: int


def stretches_of(stream: Stream) -> Stretches:
    """Cut a log. Raises ``InvalidValueError`` for one without scans, or with too many."""
    spec, ranges, poses = _read(stream)
    still = _still(poses) if stream.metadata.odometry else np.zeros(len(poses) - 1, np.bool_)
    parts, blocks, crept = [], [], 0
    for first, last in _runs(still):
        if not still[first : last - 1].any():
            blocks += [
                Stretch(ranges=ranges[k : min(k + BLOCK, last)], standing=False)
                for k in range(first, last, BLOCK)
                if last - k >= BLOCK // 2
            ]
        elif last - first >= LEAST_STANDING:
            part = Stretch(ranges=ranges[first + 1 : last - 1], standing=True)
            settled = _settled(part.ranges)
            crept += not settled
            parts += [part] * settled
    every = max(1.0, len(blocks) / MOST_BLOCKS)
    parts += [blocks[int(k * every)] for k in range(min(len(blocks), MOST_BLOCKS))]
    return Stretches(spec=spec, parts=tuple(parts), scans=len(ranges), crept=crept)


def _read(stream: Stream) -> tuple[LaserSpec, Float, Float]:
    """The scanner, (k, n) ranges m and (k, 3) odometry."""
    rows, poses = list[Any](), list[Float]()
    spec = stream.metadata.laser
    for frame in stream:
        if frame.scan is None:
            continue
        if rows and frame.scan.spec.n_beams != len(rows[0]):
            raise InvalidValueError(
                f"the log must have scans of one number of beams, got {len(rows[0])} and "
                f"{frame.scan.spec.n_beams}"
            )
        spec = frame.scan.spec
        rows.append(np.where(frame.scan.valid, frame.scan.ranges, np.nan))
        poses.append(frame.odometry.T_odom_robot)
        if len(rows) > MOST_SCANS:
            raise InvalidValueError(f"the log must have at most {MOST_SCANS} scans, got more")
    if not rows or spec is None:
        raise InvalidValueError("the log must have laser scans, got none")
    return spec, np.array(rows, dtype=np.float64), np.array(poses)


def _still(poses: Float) -> NDArray[np.bool_]:
    """(k - 1,) whether the robot stood from one scan to the next."""
    step = np.diff(poses, axis=0)
    moved = np.sqrt(step[:, 0] ** 2 + step[:, 1] ** 2)
    return (moved <= STILL_M) & (np.abs(se2.wrap_array(step[:, 2])) <= STILL_RAD)


def _runs(still: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """(first, behind the last) scan of each run of standing, and of each between them."""
    first, last = np.flatnonzero(np.diff(np.r_[False, still, False])).reshape(-1, 2).T
    return pairwise(np.unique(np.r_[0, first, last + 1, len(still) + 1]).tolist())


def _settled(ranges: Float) -> bool:
    """Whether the ranges stayed, too: some odometry is reported late, or in coarse steps."""
    half = len(ranges) // 2
    whole = np.isfinite(ranges).all(axis=0)
    if not whole.any():
        return False
    ranges = ranges[:, whole]
    noise = np.median(np.abs(np.diff(ranges, axis=0)))
    between = np.abs(ranges[:half].mean(axis=0) - ranges[half:].mean(axis=0))
    return bool(np.median(between) <= max(CREPT_M, float(noise)))
