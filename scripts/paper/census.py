# SPDX-License-Identifier: Apache-2.0
"""Which landmarks a map holds, against the true ones: missed, spurious, deleted by mistake."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from scripts.paper.runs import statistics
from slam.frames import Float
from slam.shunting.featured import FeaturedShuntingSlam
from slam.shunting.map.peaks import peaks
from slam.system import HasLandmarks

GATE_M = 0.5  # an estimated landmark farther from every true one is spurious
PEAK = 0.3  # activity from which a neuron counts as a landmark
NAMELESS = -1
Pairs = tuple[NDArray[np.int64], NDArray[np.int64]]
NONE = np.zeros(0, dtype=np.int64)


@dataclass(eq=False)
class Census:
    """Which true static points a map has had, and has in the end."""

    true: Float  # (n, 2) static points that were seen twice or more, in the first frame
    had: dict[int, set[int]] = field(default_factory=dict)  # true ones ever matched, by what names
    now: set[int] = field(default_factory=set)
    left: set[int] = field(default_factory=set)  # names in the map
    pairs: Pairs = field(default_factory=lambda: (NONE, NONE))  # found ones and true ones
    errors: Float = field(default_factory=lambda: np.zeros((0, 2)))
    spurious: int = 0

    def take(self, found: Float, names: NDArray[np.int64], gate_m: float = GATE_M) -> None:
        """Match what a map holds now."""
        rows, columns = self.pairs = paired(found, self.true, gate_m)
        self.now, self.left = set(columns.tolist()), set(names.tolist()) - {NAMELESS}
        for name, column in zip(names[rows].tolist(), columns.tolist(), strict=True):
            self.had.setdefault(column, set()).add(name)
        self.errors = found[rows] - self.true[columns]
        self.spurious = len(found) - len(rows)

    def deleted(self) -> set[int]:
        """True points that were in the map and are not: none is near, and no landmark is left that
        once was this one, wherever it may have moved since."""
        return {k for k, names in self.had.items() if k not in self.now and not names & self.left}

    def numbers(self) -> dict[str, Any]:
        """Counts, and the paper's statistics of landmark errors."""
        return {
            "misses": len(self.true) - len(self.now),
            "spurious": self.spurious,
            "gone": len(self.had.keys() - self.now),
            "deleted by mistake": len(self.deleted()),
            "true landmarks": len(self.true),
            **statistics(self.errors, ("landmark x", "landmark y")),
        }


def paired(found: Float, true: Float, gate_m: float) -> Pairs:
    """Rows of ``found`` and of ``true`` that are within the gate, one to one, least sum first."""
    if len(found) == 0 or len(true) == 0:
        return NONE, NONE
    away = found[:, None, :] - true[None, :, :]
    distance = np.hypot(away[..., 0], away[..., 1])
    rows, columns = linear_sum_assignment(np.minimum(distance, gate_m))
    good = distance[rows, columns] < gate_m
    return rows[good], columns[good]


def landmarks_of(system: object) -> tuple[Float, NDArray[np.int64]]:
    """(n, 2) what a map calls landmarks, confirmed ones or peaks of activity, and (n,) their names:
    never used twice by the EKF, ``NAMELESS`` in a shunting map."""
    if isinstance(system, HasLandmarks):
        landmarks = system.landmarks()
        return landmarks.points_map, landmarks.keys
    assert isinstance(system, FeaturedShuntingSlam)
    points = peaks(system.network, PEAK).points_map
    return points, np.full(len(points), NAMELESS)
