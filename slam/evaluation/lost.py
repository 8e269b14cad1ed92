# SPDX-License-Identifier: Apache-2.0
"""When a run counts as lost, in replay and in the closed loop, and when its estimate goes astray.

The error at a frame is the distance of the estimate from the truth plus ``LEVER_M`` times the
heading error, in the frame of the first pose, unaligned: one number in m. A **divergence** is a
rise by ``threshold_m`` within ``within_s`` that is still there over the ``stays_s`` that follow (by
the median), and that the motion since shows too: who drives on with a heading that has long been
wrong gets further off, but gathers no error. Slow drift never rises that fast, a glitch does not
stay, and a correction is a fall.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.frames import NS_PER_S, Float
from slam.shaped import Positive, check

LOST_M = 0.5  # m of position error
LOST_RAD = math.radians(20.0)  # of heading error
LOST_S = 1.0  # s on end of either
LEAP_M = 2.0  # m between two scans; more, and faster than the next, is no driving: it was carried
LEAP_MPS = 4.0  # m/s; robots here drive up to 0.75
EXCUSED_S = 10.0  # s after it was carried elsewhere, in which to find itself


@dataclass(frozen=True, kw_only=True)
class LostRule:
    """Lost: a position error > ``metres`` or heading error > ``radians`` for > ``seconds``.

    Found again: both below half of that for as long. Raises ``InvalidValueError`` for a number that
    is not > 0.
    """

    metres: Positive = LOST_M
    radians: Positive = LOST_RAD
    seconds: Positive = LOST_S

    def __post_init__(self) -> None:
        check(self)

    def __str__(self) -> str:
        degrees = f"{math.degrees(self.radians):g}"
        return (
            f"position error > {self.metres:g} m or heading error > {degrees} degrees "
            f"for more than {self.seconds:g} s on end"
        )


USUAL = LostRule()
LOST_RULE = str(USUAL)
FOUND_RULE = f"both errors below half of that for more than {LOST_S:g} s on end"


def excused(seconds: Float, places: Float) -> NDArray[np.bool_]:
    """(n,) scans that do not count for a loss: those of ``EXCUSED_S`` after the robot was carried.

    (n,) times s and (n, 2) true positions m; it was carried where these leap.
    """
    steps = places[1:] - places[:-1]
    ways, times = np.sqrt((steps * steps).sum(axis=1)), np.diff(seconds)
    out = np.zeros(len(seconds), dtype=np.bool_)
    for k in np.flatnonzero((ways > LEAP_M) & (ways > LEAP_MPS * times)).tolist():
        out |= (seconds >= seconds[k + 1]) & (seconds < seconds[k + 1] + EXCUSED_S)
    return out


def lost_at(
    seconds: Float, distances: Float, headings: Float, rule: LostRule = USUAL
) -> float | None:
    """The first moment of the first stretch by ``rule``; None where there is none.

    (n,) times s, position errors m and heading errors rad.
    """
    off = (distances > rule.metres) | (np.abs(headings) > rule.radians)
    return _first(seconds, off, -math.inf, rule)


def found_again_at(
    seconds: Float, distances: Float, headings: Float, lost_s: float, rule: LostRule = USUAL
) -> float | None:
    """The first moment after ``lost_s`` from which on both errors are small, by ``rule``."""
    near = (distances < 0.5 * rule.metres) & (np.abs(headings) < 0.5 * rule.radians)
    return _first(seconds, near, lost_s, rule)


def _first(seconds: Float, holds: NDArray[np.bool_], after: float, rule: LostRule) -> float | None:
    since: float | None = None
    for second, is_so in zip(seconds.tolist(), holds.tolist(), strict=True):
        if not is_so or second <= after:
            since = None
            continue
        since = second if since is None else since
        if second - since > rule.seconds:
            return since
    return None


LEVER_M = 1.0  # a heading off by 0.1 rad counts as 0.1 m
BEGUN = 0.2  # of the threshold: from there back to the beginning of the rise


@dataclass(frozen=True, kw_only=True)
class Rule:
    """What counts as a divergence.

    threshold_m  of the rise        within_s  in which it rises       stays_s  for how long
    """

    threshold_m: Positive = 0.25
    within_s: Positive = 2.0
    stays_s: Positive = 2.0

    def __post_init__(self) -> None:
        check(self)


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
