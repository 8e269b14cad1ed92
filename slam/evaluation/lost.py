# SPDX-License-Identifier: Apache-2.0
"""When a run counts as lost, in replay and in the closed loop: one rule for both."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam.frames import Float

LOST_M, LOST_RAD, LOST_S = 0.5, math.radians(20.0), 1.0
LOST_RULE = "position error > 0.5 m or heading error > 20 degrees for more than 1 s on end"
FOUND_RULE = "both errors below half of that for more than 1 s on end"


def lost_at(seconds: Float, distances: Float, headings: Float) -> float | None:
    """The first moment of the first stretch by ``LOST_RULE``; None where there is none.

    (n,) times s, position errors m and heading errors rad.
    """
    return _first(seconds, (distances > LOST_M) | (np.abs(headings) > LOST_RAD), -math.inf)


def found_again_at(
    seconds: Float, distances: Float, headings: Float, lost_s: float
) -> float | None:
    """The same after ``lost_s`` by ``FOUND_RULE``."""
    near = (distances < 0.5 * LOST_M) & (np.abs(headings) < 0.5 * LOST_RAD)
    return _first(seconds, near, lost_s)


def _first(seconds: Float, holds: NDArray[np.bool_], after: float) -> float | None:
    since: float | None = None
    for second, is_so in zip(seconds.tolist(), holds.tolist(), strict=True):
        if not is_so or second <= after:
            since = None
            continue
        since = second if since is None else since
        if second - since > LOST_S:
            return since
    return None
