# SPDX-License-Identifier: Apache-2.0
"""Order in the time stamps of a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from slam.errors import LogFormatError
from slam.frames import NS_PER_S, to_s

MAX_STEP_BACK_NS = NS_PER_S
MAX_SPREAD_NS = NS_PER_S
MAX_EQUAL = 100


@dataclass(frozen=True, kw_only=True)
class Ordered:
    """``order``: indices by time (stable). ``stamps_ns``: those times, strictly increasing.

    ``stepped_back``: how many stamps were smaller than the one before them in the log.
    ``spread``: how many were moved because they equalled another.
    """

    order: list[int]
    stamps_ns: list[int]
    stepped_back: int
    spread: int


def put_in_order(path: Path, stamps_ns: Sequence[int], lines: Sequence[int]) -> Ordered:
    """Sort stamps that step back a little, separate equal ones.

    Clocks that were read by several processes step back by fractions of a second; 1 s or more
    means that the log is not one recording. Logs printed with six significant digits give
    neighbours the same stamp; m equal stamps are spread evenly over the time to the next later one
    (at most 1 s), because filters divide by the time between frames.
    Raises ``LogFormatError`` for a step of 1 s or more and for more than 100 equal stamps.
    """
    stepped_back = 0
    latest = stamps_ns[0] if stamps_ns else 0
    for k in range(1, len(stamps_ns)):
        stepped_back += stamps_ns[k] < stamps_ns[k - 1]
        if latest - stamps_ns[k] >= MAX_STEP_BACK_NS:
            raise LogFormatError(
                path,
                f"time steps back by {to_s(latest - stamps_ns[k]):g} s (less than 1 s is sorted)",
                lines[k],
            )
        latest = max(latest, stamps_ns[k])
    order = sorted(range(len(stamps_ns)), key=stamps_ns.__getitem__)
    strict, spread = _spread(path, [stamps_ns[k] for k in order], [lines[k] for k in order])
    return Ordered(order=order, stamps_ns=strict, stepped_back=stepped_back, spread=spread)


def _spread(path: Path, stamps: list[int], lines: list[int]) -> tuple[list[int], int]:
    gaps = sorted(b - a for a, b in pairwise(stamps) if b > a)
    usual = gaps[len(gaps) // 2] if gaps else NS_PER_S // 1000
    out: list[int] = []
    moved = first = 0
    while first < len(stamps):
        last = first
        while last + 1 < len(stamps) and stamps[last + 1] == stamps[first]:
            last += 1
        m = last - first + 1
        if m > MAX_EQUAL:
            raise LogFormatError(
                path, f"{m} scans have the same time: it was printed too coarsely", lines[first]
            )
        gap = stamps[last + 1] - stamps[first] if last + 1 < len(stamps) else usual * m
        gap = min(gap, MAX_SPREAD_NS)
        for i in range(m):
            earliest = out[-1] + 1 if out else stamps[first]
            out.append(max(stamps[first] + i * gap // m, earliest))
        moved += m - 1
        first = last + 1
    return out, moved
