# SPDX-License-Identifier: Apache-2.0
"""Log-weights of the places where the robot may be, and their probabilities: docs/belief.md."""

import math
from collections.abc import Sequence

import numpy as np

from slam.frames import Float
from slam.frontend.odometry_prior import Prediction, squared
from slam.tracker.belief.config import BeliefConfig
from slam.tracker.belief.evidence import Evidence
from slam.tracker.cells import Look

S_PER_H = 3600.0
LEAST_M = 0.01  # m of way that a scan counts at least: who stands can be pushed, too
LEAST_S = 1e-3
MOST_NATS = 700.0  # exp of less is no zero


class Odds:
    """The equations, with their numbers.

    carried_per_h  how often the robot is carried elsewhere; 0: never
    changed        the room has: all places have paid ``outdated``, and D counts from there on
    """

    def __init__(
        self, config: BeliefConfig, carried_per_h: float, *, changed: bool = False
    ) -> None:
        self.config, self._carried_per_h = config, carried_per_h
        self._changed_m = (config.outdated / config.through) ** 2 if changed else 0.0
        self._pulled = np.diag([config.pulled_m**2, config.pulled_m**2, config.pulled_rad**2])

    @property
    def asked(self) -> bool:
        """Whether a pose may be doubted at all."""
        return self._carried_per_h > 0.0

    def evidence(self, of: Evidence | Look) -> float:
        """Nats for a place: a log(1 + C / c) - b sqrt(D)."""
        known, through = (of.known, of.through) if isinstance(of, Look) else (
            of.known_m, of.through_m
        )  # fmt: skip
        return self.confirmed(known) - self.denied(through)

    def confirmed(self, known_m: float) -> float:
        """Nats for a place: the logarithm of so much surface; a further view adds in proportion."""
        config = self.config
        one_view, chance = min(known_m, config.linear_m), config.confirmed_m
        more = math.log1p(one_view / chance) + (known_m - one_view) / (chance + one_view)
        return config.confirmed * more

    def denied(self, through_m: float) -> float:
        """Nats against a place: a metre more says less than the one before."""
        before_m = self._changed_m
        return self.config.through * (math.sqrt(before_m + through_m) - math.sqrt(before_m))

    def broken(self, share: float, vanished: float = 0.0) -> float:
        """Nats against a place where so much of the usual match goes on from the scans before, and
        that share of what the scan before confirmed is seen through.
        """
        config = self.config
        least, enough = config.breaks, max(config.goes_on, config.breaks + 1e-6)
        lost = min(max((enough - share) / (enough - least), 0.0), 1.0)
        gone = vanished / config.vanished
        return config.broken * min(lost + gone, 1.0)

    def corrected(self, prediction: Prediction, T_map_robot: Float) -> float:
        """Nats against a match that corrects odometry: its innovation, or a slip.

        Movers pull matches by ``pulled_m`` and ``pulled_rad``, which is neither.
        """
        off = prediction.off(T_map_robot)
        x, y, turn = off.tolist()
        way_m = math.hypot(*prediction.increment[:2].tolist())
        slip = -self.slipped(way_m, math.hypot(x, y), turn)
        return min(0.5 * squared(off, prediction.prior + self._pulled), slip)

    def carried(self, elapsed_s: float) -> float:
        """Log prior of having been carried in that time."""
        if self._carried_per_h == 0.0:
            return -MOST_NATS
        return math.log(self._carried_per_h * max(elapsed_s, LEAST_S) / S_PER_H)

    def slipped(self, way_m: float, off_m: float, off_rad: float) -> float:
        """Log prior of a slip by so much on that way."""
        config = self.config
        rate = math.log(config.slips_per_m * max(way_m, LEAST_M))
        return rate - 0.5 * ((off_m / config.slip_m) ** 2 + (off_rad / config.slip_rad) ** 2)

    @staticmethod
    def drifted(off: Float, drift: Float, found: Float) -> float:
        """Log prior of being ``off`` (3,) by what odometry may have drifted, (3, 3).

        The place is the best of all that a search tells apart by ``found`` (3, 3).
        """
        best_of = max(_determinant(drift + found) / _determinant(found), 1.0)
        return -0.5 * (squared(off, drift) + math.log(best_of))


def _determinant(covariance: Float) -> float:
    """Of a (3, 3) covariance, in a fixed order of operations."""
    (a, b, c), (_, d, e), (_, _, f) = covariance.tolist()
    return float(a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d))


def sum_of(nats: Sequence[float]) -> float:
    """Log of the sum of weights."""
    most = max(nats)
    return most + math.log(sum(math.exp(max(n - most, -MOST_NATS)) for n in nats))


def probabilities(nats: Sequence[float]) -> list[float]:
    """Of weights that are given by their logarithms."""
    total = sum_of(nats)
    return [math.exp(max(n - total, -MOST_NATS)) for n in nats]
