# SPDX-License-Identifier: Apache-2.0
"""What one scan may spend on finding a lost robot: counted work, not time.

Every kind of work has a price in ns, measured once. So the same frames give the same poses on any
machine, however busy.
"""

from slam.tracker.matching.config import BudgetConfig

NS_PER_MS = 1e6


class Budget:
    """Work that is still allowed in this scan.

    spent_ns  so far; of that ``near_ns`` on a search nearby, which nothing limits
    """

    def __init__(self, config: BudgetConfig, share: float | None = None) -> None:
        """``share`` of ``budget_ms`` is for the work that is counted here; by default what is left
        to finding a robot (``counted_share``)."""
        share = config.counted_share if share is None else share
        self.prices = config
        self.spent_ns = self.near_ns = 0.0
        self._most_ns = share * config.budget_ms * NS_PER_MS

    @property
    def left_ns(self) -> float:
        """What may still be spent, 0 or less where nothing may."""
        return self._most_ns - self.spent_ns

    def times(self, ns: float) -> int:
        """How often work of this price may be done; once where only a part is left, 0 after."""
        return 0 if self.left_ns <= 0.0 else max(1, int(self.left_ns / max(ns, 1.0)))

    def spend_search(self, evaluations: int, points: int, climbed: int) -> None:
        """A search by so many points scored so many candidates, and all points climbed."""
        ns = self.prices.bound_ns * evaluations * points + self.prices.climb_ns * climbed
        self.near_ns += ns
        self.spend(ns)

    def spend(self, ns: float) -> None:
        """Work of this price was done."""
        self.spent_ns += ns
