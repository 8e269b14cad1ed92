# SPDX-License-Identifier: Apache-2.0
"""What a scan says of a place, in nats, and the probabilities that follow: docs/belief.md."""

import math
from collections.abc import Sequence

from slam.tracker.belief.config import BeliefConfig

S_PER_H = 3600.0
LEAST_S = 1e-3
ENDS = 0.02  # share at either end: no scan says more than a logit(ENDS / (1 + ENDS))
MOST_NATS = 700.0  # exp of less is no zero


def evidence(config: BeliefConfig, share: float) -> float:
    """Nats for where so large a share of the returns is explained: a logit(s) + b, bounded."""
    s = min(max(share, 0.0), 1.0)
    return config.slope * math.log((s + ENDS) / (1.0 + ENDS - s)) + config.known


def carried(per_h: float, elapsed_s: float) -> float:
    """Log prior of having been carried in that time."""
    return math.log(per_h * max(elapsed_s, LEAST_S) / S_PER_H) if per_h > 0.0 else -MOST_NATS


def sum_of(nats: Sequence[float]) -> float:
    """Log of the sum of weights."""
    most = max(nats)
    return most + math.log(sum(math.exp(max(n - most, -MOST_NATS)) for n in nats))


def probabilities(nats: Sequence[float]) -> list[float]:
    """Of weights that are given by their logarithms."""
    total = sum_of(nats)
    return [math.exp(max(n - total, -MOST_NATS)) for n in nats]
