# SPDX-License-Identifier: Apache-2.0
"""How often a robot slips or is pushed, unknown to odometry, and by how much.

The belief asks it for a place nearby against where motion led, and for a correction of odometry
that no noise explains.
"""

from __future__ import annotations

import math

from slam.tracker.belief.config import BeliefConfig

LEAST_M = 0.01  # m of way that a scan counts at least: who stands can be pushed, too


def slip_nats(
    config: BeliefConfig, way_m: float, off_m: float = 0.0, off_rad: float = 0.0
) -> float:
    """Log prior of a slip by so much on that way.

    A rate a metre of way, times a Gaussian without its normalisation: docs/belief.md.
    """
    rate = math.log(config.slips_per_m * max(way_m, LEAST_M))
    return rate - 0.5 * ((off_m / config.slip_m) ** 2 + (off_rad / config.slip_rad) ** 2)
