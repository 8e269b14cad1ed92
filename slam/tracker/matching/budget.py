# SPDX-License-Identifier: Apache-2.0
"""What one scan may spend on finding a lost robot: counted work, not time.

Every kind of work has a price in ns, measured once. So the same frames give the same poses on any
machine, however busy.
"""

from slam.tracker.matching.config import BudgetConfig

NS_PER_MS = 1e6


class Budget:
    """Work that is still allowed in this scan; ``spent_ns`` so far."""

    def __init__(self, config: BudgetConfig, share: float) -> None:
        """``share`` of ``budget_ms`` is for the work that is counted here."""
        self.prices = config
        self.spent_ns, self._most_ns = 0.0, share * config.budget_ms * NS_PER_MS

    @property
    def left_ns(self) -> float:
        """What may still be spent, 0 or less where nothing may."""
        return self._most_ns - self.spent_ns

    def times(self, ns: float) -> int:
        """How often work of this price may be done; once where only a part is left, 0 after."""
        return 0 if self.left_ns <= 0.0 else max(1, int(self.left_ns / max(ns, 1.0)))

    def spend(self, ns: float) -> None:
        """Work of this price was done."""
        self.spent_ns += ns
