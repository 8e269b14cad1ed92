# SPDX-License-Identifier: Apache-2.0
"""When a SLAM goes astray: the first time its error jumps up and stays there.

The error at a frame is the distance of the estimate from the truth plus ``LEVER_M`` times the
heading error, in the frame of the first pose, unaligned: one number in m. A **divergence** is a
rise by ``threshold_m`` within ``within_s`` that is still there over the ``stays_s`` that follow (by
the median), and that the motion since shows too: who drives on with a heading that has long been
wrong gets further off, but gathers no error. Slow drift never rises that fast, a glitch does not
stay, and a correction is a fall.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.checked import is_number
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Float

LEVER_M = 1.0  # a heading off by 0.1 rad counts as 0.1 m
BEGUN = 0.2  # of the threshold: from there back to the beginning of the rise


@dataclass(frozen=True, kw_only=True)
class Rule:
    """What counts as a divergence.

    threshold_m  of the rise        within_s  in which it rises       stays_s  for how long
    """

    threshold_m: float = 0.25
    within_s: float = 2.0
    stays_s: float = 2.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not is_number(value):
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
    """Error of one pose (3,) against the truth (3,), both in the same frame."""
    dx, dy = float(estimate[0] - truth[0]), float(estimate[1] - truth[1])
    return math.hypot(dx, dy) + LEVER_M * abs(se2.wrap(float(estimate[2] - truth[2])))


def errors_since_m(
    then: tuple[Float, Float], truth: Sequence[Float], estimate: Sequence[Float]
) -> Float:
    """(n,) errors gathered since a moment whose true and estimated pose are ``then``.

    Each motion since is compared in the frame of its own pose then, so what was wrong by then does
    not count. With (the first true pose, zeros) these are the errors in the map frame.
    """
    pairs = zip(truth, estimate, strict=True)
    return np.array([error_m(se2.between(then[0], t), se2.between(then[1], e)) for t, e in pairs])


def first_divergence(
    stamps_ns: NDArray[np.int64],
    truth: Sequence[Float],
    estimate: Sequence[Float],
    rule: Rule | None = None,
) -> Divergence | None:
    """The first one of a run of n frames; None where there is none.

    truth     n poses (3,) in the world       estimate  n in the map, the frame of the first
    """
    rule = Rule() if rule is None else rule
    errors_m, lows, rises = _rises(stamps_ns, truth, estimate, rule)
    for k in np.flatnonzero(rises >= rule.threshold_m).tolist():
        low, stays_ns = int(lows[k]), round(rule.stays_s * NS_PER_S)
        last = int(np.searchsorted(stamps_ns, stamps_ns[k] + stays_ns, side="right"))
        rise = float(np.median(errors_m[k:last])) - float(errors_m[low])
        if rise >= rule.threshold_m:
            return Divergence(begins=_beginning(errors_m, low, k, rule), found=k, rise_m=rise)
    return None


def largest_rise_m(
    stamps_ns: NDArray[np.int64],
    truth: Sequence[Float],
    estimate: Sequence[Float],
    rule: Rule | None = None,
) -> float:
    """m, the most that the error rises within ``rule.within_s``, whether it stays or not."""
    rises = _rises(stamps_ns, truth, estimate, Rule() if rule is None else rule)[2]
    return float(rises.max()) if len(rises) else 0.0


def _rises(
    stamps_ns: NDArray[np.int64], truth: Sequence[Float], estimate: Sequence[Float], rule: Rule
) -> tuple[Float, NDArray[np.int64], Float]:
    """(n,) errors, row of the least in the time before each, and the rise since that.

    The rise is the lesser of two: of the error itself, and of what was gathered since that row.
    """
    n = len(stamps_ns)
    lows, rises = np.zeros(n, dtype=np.int64), np.zeros(n)
    if n == 0:
        return np.zeros(0), lows, rises
    errors_m = errors_since_m((truth[0], np.zeros(3)), truth, estimate)
    befores = np.searchsorted(stamps_ns, stamps_ns - round(rule.within_s * NS_PER_S))
    for k in range(n):
        low = lows[k] = befores[k] + np.argmin(errors_m[befores[k] : k + 1])
        then = (truth[low], estimate[low])
        gathered = errors_since_m(then, truth[k : k + 1], estimate[k : k + 1])[0]
        rises[k] = min(errors_m[k] - errors_m[low], gathered)
    return errors_m, lows, rises


def _beginning(errors_m: Float, low: int, found: int, rule: Rule) -> int:
    """The last row before ``found`` at which the error had hardly risen."""
    calm = errors_m[low:found] <= errors_m[low] + BEGUN * rule.threshold_m
    return low + int(np.flatnonzero(calm)[-1])
