# SPDX-License-Identifier: Apache-2.0
"""Some of the observations, blurred by what a prior may be off: to approach an optimum by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.tracker.matching.score import Seen


class Widths(NamedTuple):
    """Sums of two variances, m^2.

    place  of the prior's position
    least  a blur of no more is none
    most   of the blur: it is shrunk to this
    """

    place: float
    least: float
    most: float


def room_for(n: int) -> Seen:
    """Arrays to be filled with ``n`` observations."""
    return Seen(
        points=np.empty((n, 2)),
        covariances=np.empty((n, 3)),
        weights=np.empty(n),
        tangents=np.empty((n, 2)),
        facings=np.empty(n, np.uint8),
        votes=np.empty(n),
    )


@njit
def blur(
    seen: Seen, covariance: NDArray[np.float64], widths: Widths, every: int, out: Seen
) -> bool:
    """Fill ``out`` with one of ``every`` so many, smeared by a pose's (3, 3) ``covariance``.

    That one is in the robot frame. False, and ``out`` is not to be used, where it smears none of
    them by more than ``widths.least``.
    """
    xx, xy, xt = covariance[0, 0], covariance[0, 1], covariance[0, 2]
    yy, yt, tt = covariance[1, 1], covariance[1, 2], covariance[2, 2]
    farthest = 0.0
    for k in range(len(seen.points)):
        x, y = seen.points[k, 0], seen.points[k, 1]
        farthest = max(farthest, x * x + y * y)
    if 2.0 * (widths.place + farthest * tt) < widths.least:  # (a + b)^2 <= 2 (a^2 + b^2)
        return False
    blurred = False
    for m in range(len(out.points)):
        k = m * every
        x, y = seen.points[k, 0], seen.points[k, 1]
        ttx, tty = tt * x, tt * y
        a = xx - 2.0 * xt * y + tty * y
        b = xy + xt * x - yt * y - ttx * y
        d = yy + 2.0 * yt * x + ttx * x
        blurred |= a + d > widths.least
        share = min(1.0, widths.most / max(a + d, 1e-12))
        out.points[m, 0], out.points[m, 1] = x, y
        out.covariances[m, 0] = seen.covariances[k, 0] + a * share
        out.covariances[m, 1] = seen.covariances[k, 1] + b * share
        out.covariances[m, 2] = seen.covariances[k, 2] + d * share
        out.weights[m] = seen.weights[k] * every
        out.tangents[m, 0], out.tangents[m, 1] = seen.tangents[k, 0], seen.tangents[k, 1]
        out.facings[m], out.votes[m] = seen.facings[k], seen.votes[k]
    return blurred
