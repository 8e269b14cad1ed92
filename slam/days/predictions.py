# SPDX-License-Identifier: Apache-2.0
"""Will something stand there at that time? What each predictor is given, and how it is scored.

A ``Predictor`` sees n places session by session and gives the probability that each is taken at a
later time. A sighting is 1 taken, 0 empty, between for what stood there part of the session, NaN
for not seen. Ours is ``slam.days.habits``, those of the literature are ``slam.days.rivals``.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from slam.days.config import DaysConfig
from slam.errors import InvalidValueError
from slam.frames import Float

HOUR_S = 3600.0
LEAST = DaysConfig().habit.least


class Predictor(Protocol):
    """What all of them do."""

    def see(self, time_s: float, values: Float) -> None:
        """A session at ``time_s``, later than the one before: (n,) sightings."""

    def probability(self, time_s: float) -> Float:
        """(n,) that each place is taken then."""


class Sightings:
    """All sessions so far of n places; what the simple predictors need of them."""

    def __init__(self, n: int) -> None:
        if n < 0:
            raise InvalidValueError(f"n must be >= 0 places, got {n}")
        self.n = n
        self.times_s: list[float] = []
        self.rows: list[Float] = []

    def see(self, time_s: float, values: Float) -> None:
        """Take a session in; raises ``InvalidValueError`` for one out of order or out of [0, 1]."""
        self.rows.append(self.checked(time_s, values))
        self.times_s.append(float(time_s))

    def checked(self, time_s: float, values: Float) -> Float:
        """(n,) the sightings of a session that may follow; raises as ``see`` does."""
        values = np.asarray(values, dtype=np.float64)
        if values.shape != (self.n,):
            raise InvalidValueError(f"values must be ({self.n},), got {values.shape}")
        known = values[~np.isnan(values)]
        if known.size and not 0.0 <= known.min() <= known.max() <= 1.0:
            raise InvalidValueError("values must lie in [0, 1] or be NaN")
        if not math.isfinite(time_s) or (self.times_s and time_s <= self.times_s[-1]):
            raise InvalidValueError(f"time_s must come after {self.times_s[-1:]}, got {time_s}")
        return values

    def table(self) -> Float:
        """(sessions, n)."""
        return np.array(self.rows).reshape(len(self.rows), self.n)


def brier(probabilities: Float, taken: Float) -> Float:
    """(p - x)^2, least 0."""
    return np.asarray((probabilities - taken) ** 2)


def log_score(probabilities: Float, taken: Float, least: float = LEAST) -> Float:
    """-log of the probability of what came, nats, none nearer to 0 or 1 than ``least``."""
    p = np.clip(probabilities, least, 1.0 - least)
    return np.asarray(-np.log(np.where(taken > 0.5, p, 1.0 - p)))
