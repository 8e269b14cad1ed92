# SPDX-License-Identifier: Apache-2.0
"""When a run counts as lost, in replay and in the closed loop: one rule for both."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError
from slam.frames import Float

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

    metres: float = LOST_M
    radians: float = LOST_RAD
    seconds: float = LOST_S

    def __post_init__(self) -> None:
        for name in ("metres", "radians", "seconds"):
            if not getattr(self, name) > 0.0:
                raise InvalidValueError(f"LostRule.{name} must be > 0, got {getattr(self, name)}")

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
