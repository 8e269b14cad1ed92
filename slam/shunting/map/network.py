# SPDX-License-Identifier: Apache-2.0
"""The shunting network, Eq. (8): a map whose cells are neurons.

Blocks of neurons are born under an observation and die when every neuron in them is silent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slam.frontend.visibility import View
from slam.shunting.config import ShuntingConfig
from slam.shunting.map.update import Law, integrate, lateral_mu
from slam.tracker.cell_map import CellMap


class Network(CellMap):
    """The plane of neurons, and the constants of its update."""

    config: ShuntingConfig

    def __init__(self, config: ShuntingConfig) -> None:
        super().__init__(config)
        self.mu = lateral_mu(config.lateral_sum, config.lateral_reach_cells)

    def law(self, step: float) -> Law:
        """Constants of an update whose input acts for ``step`` s (the time since the last scan)."""
        numbers = self.config.map
        pace = self.pace(step)
        return Law(
            step=step,
            look=step,
            pace=pace,
            oldest=numbers.oldest_paces * pace,
            decay=self.config.decay_per_s,
            threshold=self.config.threshold,
            mu=self.mu,
            reach=self.config.lateral_reach_cells,
            trace=self.config.trace_s > 0.0,
            faded=numbers.faded,
            unseen=numbers.unseen,
        )

    def integrate(
        self, view: View, T_map_laser: NDArray[np.float64], step: float, *, write: bool
    ) -> tuple[float, float, int]:
        """Take the present impressions in for ``step`` s; see the kernel of the same name."""
        result = integrate(self.cells, view, T_map_laser, self.cell, self.law(step), write)
        if write:
            self.release()
        return result
