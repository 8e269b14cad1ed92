# SPDX-License-Identifier: Apache-2.0
"""The shunting SLAM: a short-term-memory map that forgets what moved, and scan matching on it."""

from dataclasses import dataclass
from typing import ClassVar

from slam.estimate import Changes, Raster
from slam.shunting.map import export
from slam.tracker.config import TrackerConfig
from slam.tracker.network import Network
from slam.tracker.tracker import Tracker


@dataclass(frozen=True, kw_only=True)
class ShuntingConfig(TrackerConfig):
    """As ``TrackerConfig``; ``robust()`` is the default, ``paper()`` the paper as printed."""


class ShuntingSlam(Tracker):
    """Localise on the network, then let the network see the frame (Eqs. 8 and 13).

    ``config`` is a ``ShuntingConfig``, the name of a preset, "robust" (default) or "paper", or
    numbers by their path in the tree, ``{"matching.reward": 7}``. Raises ``InvalidValueError`` for
    frames without observations or out of order.
    """

    config_class: ClassVar[type[ShuntingConfig]] = ShuntingConfig
    cells_hold = "activities"

    @staticmethod
    def _new_map(config: ShuntingConfig) -> Network:
        return Network(config)

    @property
    def network(self) -> Network:
        """The map: neurons of Eq. (8)."""
        assert isinstance(self.cell_map, Network)
        return self.cell_map

    def map(self) -> Raster | None:
        """What exists, from either memory; NaN where no neuron lives (never seen, or seen empty:
        the network does not distinguish these).
        """
        return export.existence(self.network)

    def changes(self) -> Changes | None:
        """What appeared and what is gone lately; None without a map or a long-term memory."""
        return export.changes(self.network)
