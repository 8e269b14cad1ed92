# SPDX-License-Identifier: Apache-2.0
"""Which readings of a log mean "nothing came back", where the log does not say."""

from __future__ import annotations

import numpy as np

from slam.frames import Float


def saturated_from(ranges: Float) -> float | None:
    """The smallest range (m) that stands for "no return" in (k, n) ``ranges``, or None.

    Scanners write such a beam as one of a few fixed values at the end of their scale (SICK LMS
    81.83 to 81.91 m or 8.183 to 8.191 m, SICK PLS 51.05 and 51.10 m). They show as a cluster of
    equal readings above a gap: the top 0.5 % of the scale holds at least ten readings of at most
    ten values, on at least a tenth of the beams (the far wall of a robot at rest is on a few
    neighbours), against almost none in the 4.5 % of the scale below.
    """
    top = float(ranges.max())
    high = ranges >= 0.995 * top
    n_high = int(high.sum())
    below = int(((ranges >= 0.95 * top) & ~high).sum())
    if (
        n_high < 10
        or not 0.0005 * ranges.size <= n_high <= 0.9 * ranges.size
        or below > 0.01 * n_high
        or high.any(axis=0).sum() < 0.1 * ranges.shape[1]
        or len(np.unique(ranges[high])) > 10
    ):
        return None
    return float(ranges[high].min())
