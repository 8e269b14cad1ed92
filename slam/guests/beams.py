# SPDX-License-Identifier: Apache-2.0
"""De-skewed end points as the scan of a scanner that stood still, for guests that take ranges."""

from __future__ import annotations

import math

import numpy as np

from slam import se2
from slam.frames import Float, LaserSpec


def ranges_of(points_robot: Float, spec: LaserSpec, nothing_m: float) -> Float:
    """(n_beams,) m: the nearest end point (n, 2) along each beam; ``nothing_m`` for none."""
    x, y = se2.transform(se2.inverse(spec.T_robot_laser), points_robot).T
    ranges = np.full(spec.n_beams, nothing_m)
    turned = np.array([math.atan2(b, a) for a, b in zip(x.tolist(), y.tolist(), strict=True)])
    beams = np.floor((turned - spec.angle_min) / spec.angle_increment + 0.5).astype(np.int64)
    inside = (beams >= 0) & (beams < spec.n_beams)
    np.minimum.at(ranges, beams[inside], np.sqrt(x * x + y * y)[inside])
    return ranges
