# SPDX-License-Identifier: Apache-2.0
"""Will something stand there at that time? What predictors are given, how they are scored, others.

A ``Predictor`` sees n places session by session and gives the probability that each is taken at a
later time. A sighting is 1 taken, 0 empty, between for what stood there part of the session, NaN
for not seen. Ours is ``slam.days.habits``. Those of the literature, here, are small:

- ``LastSeen``     as when last seen, trusted as far as it held before in this building
- ``Mean``         share of the sightings (rule of succession)
- ``PersistenceFilter``  Rosen, Mason, Leonard, "Towards lifelong feature-based mapping in
                   semi-static environments", ICRA 2016
- ``FreMEn``       Krajnik, Fentanes, Santos, Duckett, "FreMEn: frequency map enhancement for
                   long-term mobile robot autonomy in changing environments", T-RO 33(4), 2017
"""

from __future__ import annotations

import math
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import exp1

from slam.days.history import DAY_S
from slam.errors import InvalidValueError
from slam.frames import Float

HOUR_S = 3600.0
LEAST = 0.01  # no probability is nearer to 0 or 1; set by hand


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


def log_score(probabilities: Float, taken: Float) -> Float:
    """-log of the probability of what came, nats, none nearer to 0 or 1 than ``LEAST``."""
    p = np.clip(probabilities, LEAST, 1.0 - LEAST)
    return np.asarray(-np.log(np.where(taken > 0.5, p, 1.0 - p)))


class Mean(Sightings):
    """Share of the sightings, by the rule of succession."""

    def probability(self, time_s: float) -> Float:
        """The same at all times."""
        table = self.table()
        looks = (~np.isnan(table)).sum(axis=0)
        return np.asarray((np.nansum(table, axis=0) + 1.0) / (looks + 2.0))


class LastSeen(Sightings):
    """As when last seen.

    It is trusted as far as two sightings in a row of one place agreed so far, in the whole
    building: as 0 and 1 it would have an infinite log score.
    """

    def __init__(self, n: int) -> None:
        super().__init__(n)
        self.last = np.full(n, np.nan)
        self.held, self.pairs = 1.0, 2.0

    def see(self, time_s: float, values: Float) -> None:
        """Take a session in."""
        super().see(time_s, values)
        both = ~np.isnan(values) & ~np.isnan(self.last)
        self.pairs += float(both.sum())
        self.held += float((1.0 - np.abs(values[both] - self.last[both])).sum())
        self.last = np.where(np.isnan(values), self.last, values)

    def probability(self, time_s: float) -> Float:
        """The same at all times."""
        trust = self.held / self.pairs
        told = trust * self.last + (1.0 - trust) * (1.0 - self.last)
        return np.where(np.isnan(told), 0.5, told)


def lasting(seconds: Float, shortest_s: float, longest_s: float) -> Float:
    """Share of things that stand so long: the general-purpose prior of the persistence filter.

    Rates are spread evenly in their logarithm between 1 / ``longest_s`` and 1 / ``shortest_s``.
    """
    t = np.maximum(np.asarray(seconds, dtype=np.float64), 1e-6)
    spread = math.log(longest_s / shortest_s)
    return np.asarray(np.clip((exp1(t / longest_s) - exp1(t / shortest_s)) / spread, 0.0, 1.0))


class PersistenceFilter(Sightings):
    """The exact posterior that what stood there has not gone, once for each thing that came.

    missed, false  probabilities of not seeing what stands there, and of seeing what does not
    by the prior a place stands from an hour to 30 days

    What has gone does not come back in the filter. So a place where it says "gone" and something
    is seen again begins again; one where nothing was seen so far has the share of such places.
    """

    def __init__(
        self,
        n: int,
        *,
        missed: float = 0.05,
        false: float = 0.05,
    ) -> None:
        super().__init__(n)
        self.missed, self.false = missed, false
        self.born = np.full(n, np.nan)
        self.standing, self.gone = np.ones(n), np.zeros(n)  # likelihoods of the sightings
        self.survived = np.ones(n)  # prior at the last sighting

    def see(self, time_s: float, values: Float) -> None:
        """Algorithm 1 of the paper."""
        super().see(time_s, values)
        values = self.rows[-1]
        known, taken = ~np.isnan(values), values > 0.5
        posterior = self.probability(time_s)
        anew = known & taken & (np.isnan(self.born) | (posterior < 0.5 * self.false))
        self.born[anew] = time_s
        self.standing[anew], self.gone[anew], self.survived[anew] = 1.0, 0.0, 1.0
        alive = known & ~np.isnan(self.born)
        now = np.where(alive, lasting(time_s - self.born, HOUR_S, 30.0 * DAY_S), self.survived)
        now = np.where(anew, 1.0, now)
        if_gone = np.where(taken, self.false, 1.0 - self.false)
        if_standing = np.where(taken, 1.0 - self.missed, self.missed)
        gone = if_gone * (self.gone + self.standing * (self.survived - now))
        standing = if_standing * self.standing
        scale = np.maximum(gone + standing, 1e-300)  # only their ratio counts
        self.gone = np.where(alive, gone / scale, self.gone)
        self.standing = np.where(alive, standing / scale, self.standing)
        self.survived = np.where(alive, now, self.survived)

    def probability(self, time_s: float) -> Float:
        """Of standing still, for what stood there last."""
        born = ~np.isnan(self.born)
        later = np.where(
            born, lasting(time_s - np.where(born, self.born, 0.0), HOUR_S, 30.0 * DAY_S), 1.0
        )
        later = np.minimum(later, self.survived)
        evidence = self.gone + self.standing * self.survived
        found = self.standing * later / np.maximum(evidence, 1e-300)
        table = self.table()
        never = (np.nansum(table[:, ~born]) + 1.0) / ((~np.isnan(table[:, ~born])).sum() + 2.0)
        return np.where(born, found, never)


class FreMEn(Sightings):
    """A mean and a few periodic terms, those of the largest amplitude.

    A place has up to three: as many as predict the last third of its sightings best from the
    others.
    """

    PERIODS_S: ClassVar[tuple[float, ...]] = (
        *(DAY_S / k for k in (1, 2, 3, 4)), 7.0 * DAY_S, 3.5 * DAY_S, 2.0 * DAY_S,
    )  # fmt: skip

    def __init__(self, n: int) -> None:
        super().__init__(n)
        self.omegas = math.tau / np.array(self.PERIODS_S)
        self._terms_of: list[tuple[float, NDArray[np.complex128], int]] = []

    def see(self, time_s: float, values: Float) -> None:
        """Take a session in."""
        super().see(time_s, values)
        self._terms_of = []

    def spectrum(self, values: Float, times_s: Float) -> tuple[float, NDArray[np.complex128]]:
        """Mean and (periods,) complex amplitudes of one place's sightings, none of them NaN."""
        mean = float(values.mean())
        turns = np.exp(-1j * self.omegas[:, None] * times_s[None, :])
        return mean, (turns * (values - mean)[None, :]).mean(axis=1)

    def told(
        self, mean: float, gammas: NDArray[np.complex128], terms: int, times_s: Float
    ) -> Float:
        """Probability at ``times_s`` from the ``terms`` largest amplitudes."""
        largest = np.argsort(-np.abs(gammas), kind="stable")[:terms]
        angles = self.omegas[largest][:, None] * times_s[None, :]
        waves = 2.0 * np.real(gammas[largest][:, None] * np.exp(1j * angles))
        return np.asarray(np.clip(mean + waves.sum(axis=0), 0.0, 1.0))

    def _terms(self, values: Float, times_s: Float) -> int:
        cut = max(2, (2 * len(values)) // 3)
        if len(values) - cut < 2:
            return 0
        mean, gammas = self.spectrum(values[:cut], times_s[:cut])
        errors = [
            float(((self.told(mean, gammas, k, times_s[cut:]) - values[cut:]) ** 2).mean())
            for k in range(4)
        ]
        return int(np.argmin(errors))

    def _fitted(self) -> list[tuple[float, NDArray[np.complex128], int]]:
        """Mean, amplitudes and number of terms of each place."""
        if len(self._terms_of) != self.n:
            table, times = self.table(), np.array(self.times_s)
            for place in range(self.n):
                known = ~np.isnan(table[:, place])
                values, at = table[known, place], times[known]
                mean, gammas = 0.5, np.zeros(len(self.omegas), np.complex128)
                if len(values):
                    mean, gammas = self.spectrum(values, at)
                self._terms_of.append((mean, gammas, self._terms(values, at)))
        return self._terms_of

    def probability(self, time_s: float) -> Float:
        """Clipped to [0, 1], as in the paper; 0.5 where nothing was seen."""
        at = np.array([time_s])
        told = [self.told(mean, gammas, terms, at)[0] for mean, gammas, terms in self._fitted()]
        return np.array(told, dtype=np.float64)
