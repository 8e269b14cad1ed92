# SPDX-License-Identifier: Apache-2.0
"""The shunting network, Eq. (8): a map whose cells are neurons.

Blocks of neurons are born under an observation and die when every neuron in them is silent.
"""

from __future__ import annotations

import math

from slam.shunting.config import ShuntingConfig
from slam.tracker.two_memories import TwoMemories


class Network(TwoMemories):
    """The plane of neurons, with the lateral weights of its config."""

    config: ShuntingConfig

    def __init__(self, config: ShuntingConfig) -> None:
        super().__init__(config)
        self.mu = lateral_mu(config.lateral_sum, config.lateral_reach_cells)


def lateral_mu(total: float, reach: float) -> float:
    """mu such that the weights mu / d over 0 < d < reach sum to ``total``."""
    inverse_distances = 0.0
    edge = math.ceil(reach)
    for dj in range(-edge, edge + 1):
        for di in range(-edge, edge + 1):
            d = math.sqrt(di * di + dj * dj)
            if 0.0 < d < reach:
                inverse_distances += 1.0 / d
    return total / inverse_distances if inverse_distances else 0.0
