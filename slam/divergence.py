# SPDX-License-Identifier: Apache-2.0
"""When a SLAM goes astray: the first time its error jumps up and stays there.

The error at a frame is the distance of the estimate from the truth plus ``LEVER_M`` times the
heading error, in the frame of the first pose, unaligned: one number in m. A **divergence** is a
rise by ``threshold_m`` within ``within_s`` that is still there over the ``stays_s`` that follow (by
the median). Slow drift never rises that fast, a glitch does not stay, and a correction is a fall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Float

LEVER_M = 1.0  # a heading off by 0.1 rad counts as 0.1 m
BEGUN = 0.2  # of the threshold: from there back to the beginning of the rise


@dataclass(frozen=True, kw_only=True)
class Rule:
    """threshold_m  of the rise        within_s  in which it rises       stays_s  for how long"""

    threshold_m: float = 0.25
    within_s: float = 2.0
    stays_s: float = 2.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise InvalidValueError(f"Rule.{name} must be a number, got {value!r}")
            if not 0.0 < value < math.inf:
                raise InvalidValueError(f"Rule.{name} must be > 0 and finite, got {value}")


@dataclass(frozen=True, kw_only=True)
class Divergence:
    """Where it begins and where the rise reaches the threshold, as rows of the error series.

    rise_m  how far it is up after it has stayed (median)
    """

    begins: int
    found: int
    rise_m: float


def error_m(truth: Float, estimate: Float) -> float:
    """Error of one pose (3,) against the truth (3,), both in the frame of the first pose."""
    dx, dy = float(estimate[0] - truth[0]), float(estimate[1] - truth[1])
    return math.hypot(dx, dy) + LEVER_M * abs(se2.wrap(float(estimate[2] - truth[2])))


def first_divergence(
    stamps_ns: NDArray[np.int64], errors_m: Float, rule: Rule | None = None
) -> Divergence | None:
    """The first one in a series of errors (n,) at stamps (n,); None where there is none."""
    rule = Rule() if rule is None else rule
    times = (np.asarray(stamps_ns) - stamps_ns[0]) / NS_PER_S if len(stamps_ns) else np.zeros(0)
    befores = np.searchsorted(times, times - rule.within_s)
    for k in range(1, len(times)):
        window = errors_m[befores[k] : k + 1]
        low = int(befores[k]) + int(np.argmin(window))
        if errors_m[k] - errors_m[low] < rule.threshold_m:
            continue
        last = int(np.searchsorted(times, times[k] + rule.stays_s, side="right"))
        rise = float(np.median(errors_m[k:last])) - float(errors_m[low])
        if rise >= rule.threshold_m:
            return Divergence(begins=_beginning(errors_m, low, k, rule), found=k, rise_m=rise)
    return None


def _beginning(errors_m: Float, low: int, found: int, rule: Rule) -> int:
    """The last row before ``found`` at which the error had hardly risen."""
    calm = errors_m[low:found] <= errors_m[low] + BEGUN * rule.threshold_m
    return low + int(np.flatnonzero(calm)[-1])


def largest_rise_m(
    stamps_ns: NDArray[np.int64], errors_m: Float, rule: Rule | None = None
) -> float:
    """m, the most that the error rises within ``rule.within_s``, whether it stays or not."""
    rule = Rule() if rule is None else rule
    times = (np.asarray(stamps_ns) - stamps_ns[0]) / NS_PER_S if len(stamps_ns) else np.zeros(0)
    befores = np.searchsorted(times, times - rule.within_s)
    rises = [float(errors_m[k] - errors_m[befores[k] : k + 1].min()) for k in range(len(times))]
    return max(rises, default=0.0)
