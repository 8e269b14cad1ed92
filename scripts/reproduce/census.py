# SPDX-License-Identifier: Apache-2.0
"""Which landmarks a map holds, against the true ones: missed, spurious, deleted by mistake."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from scripts.reproduce.runs import statistics
from slam.ekf.slam import EkfSlam
from slam.frames import Float
from slam.shunting.featured import FeaturedShuntingSlam
from slam.shunting.peaks import peaks

GATE_M = 0.5  # an estimated landmark farther from every true one is spurious
PEAK = 0.3  # activity from which a neuron counts as a landmark


@dataclass(eq=False)
class Census:
    """Which true static points a map has had, and has in the end."""

    true: Float  # (n, 2) static points that were seen twice or more, in the first frame
    ever: set[int] = field(default_factory=set)
    now: set[int] = field(default_factory=set)
    errors: Float = field(default_factory=lambda: np.zeros((0, 2)))
    spurious: int = 0

    def take(self, found: Float, gate_m: float = GATE_M) -> None:
        """Match what a map holds now, one to one, nearest sums first."""
        self.now, self.errors, self.spurious = set(), np.zeros((0, 2)), len(found)
        if len(found) == 0 or len(self.true) == 0:
            return
        away = found[:, None, :] - self.true[None, :, :]
        distance = np.hypot(away[..., 0], away[..., 1])
        rows, columns = linear_sum_assignment(np.minimum(distance, gate_m))
        good = distance[rows, columns] < gate_m
        rows, columns = rows[good], columns[good]
        self.now = set(columns.tolist())
        self.ever |= self.now
        self.errors = away[rows, columns]
        self.spurious = len(found) - len(rows)

    def numbers(self) -> dict[str, Any]:
        """Counts, and the paper's statistics of landmark errors."""
        return {
            "misses": len(self.true) - len(self.now),
            "spurious": self.spurious,
            "deleted by mistake": len(self.ever - self.now),
            "true landmarks": len(self.true),
            **statistics(self.errors, ("landmark x", "landmark y")),
        }


def landmarks_of(system: object) -> Float:
    """(n, 2) what a map calls landmarks: confirmed ones, or peaks of activity."""
    if isinstance(system, EkfSlam):
        return system.landmarks().points_map
    assert isinstance(system, FeaturedShuntingSlam)
    return peaks(system.network, PEAK).points_map
