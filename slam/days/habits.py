# SPDX-License-Identifier: Apache-2.0
"""Habits of places: each relaxes towards what is usual there at that hour.

A place is a chain of two states, taken and empty, whose rates of emergence and of going depend on
the hour and add up to a constant r. The expectation of such a chain is

    p(t) = u(t) + (x - u(s)) exp(-r (t - s))

where x is what was seen at s, and u the usual share at an hour. The usual share of a place at an
hour is the weighted mean of its sightings at about that hour, drawn to the place's overall share
(moved by what the hour does to the whole building), as by some sightings more.

Which r, and how much of an hour, is a matter of the place: each of a few ``Tempo``s predicts every
sighting from those before it. How well it does is its weight at that place, and how common a tempo
is in the building is learnt along with it (expectation maximisation).
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from slam.arrays import Float
from slam.days.history import History, dense, hour_of
from slam.errors import InvalidValueError
from slam.estimate import Raster

HOUR_S = 3600.0
LEAST = 0.01  # no probability is nearer to 0 or 1; set by hand
BINS = 8  # of the hours of a day; set by hand
PRIOR = 2.0  # looks, that a place's share is drawn to the building's by; set by hand
_ROUNDS = 20  # of expectation maximisation
_NEVER = 1e9  # sightings: the hour counts for nothing


@dataclass(frozen=True, kw_only=True)
class Tempo:
    """A way in which places change.

    rate       r, 1/s; 0: what was last seen counts for ever, infinite: not at all
    hourly     sightings that an hour's share is drawn to the overall share by
    building   share of the building's own rhythm that the overall share is moved by
    """

    rate: float
    hourly: float
    building: float


HOURS = (3.0, 8.0, 20.0, 60.0, 200.0, 0.0)  # of relaxing; 0: at once
TEMPOS = tuple(
    Tempo(rate=math.inf if h == 0.0 else 1.0 / (h * HOUR_S), hourly=hourly, building=building)
    for h, (hourly, building) in product(HOURS, ((1.0, 0.0), (4.0, 0.0), (4.0, 1.0), (_NEVER, 0.0)))
)


def relaxed(
    usual_then: Float, usual_now: Float, seen: Float, rate: float, elapsed_s: Float
) -> Float:
    """The chain's expectation ``elapsed_s`` after ``seen``; ``usual_then``: at that time."""
    if math.isinf(rate):
        return usual_then
    left = np.exp(-rate * elapsed_s)
    return np.clip(usual_then + (seen - usual_now) * left, 0.0, 1.0)


def near_hours(hours: Float, hour: float, width: float) -> Float:
    """Weights in [0, 1] of sightings at ``hours`` for what is usual at ``hour``."""
    off = np.abs((hours - hour + 12.0) % 24.0 - 12.0)
    return np.asarray(np.maximum(1.0 - off / width, 0.0))


def log_score(probabilities: Float, taken: Float) -> Float:
    """-log of the probability of what came, nats, none nearer to 0 or 1 than ``LEAST``."""
    p = np.clip(probabilities, LEAST, 1.0 - LEAST)
    return np.asarray(-np.log(np.where(taken > 0.5, p, 1.0 - p)))


class Habits:
    """Two-state chains with hours, a tempo for each of n places.

    A sighting is 1 taken, 0 empty, between for what stood there part of the session, NaN for not
    seen.
    """

    def __init__(self, n: int) -> None:
        if n < 0:
            raise InvalidValueError(f"n must be >= 0 places, got {n}")
        self.n = n
        self.times_s: list[float] = []
        self.rows: list[Float] = []
        self.last = np.full(n, np.nan)
        self.last_s = np.full(n, np.nan)
        self.scores = np.zeros((len(TEMPOS), n))  # log likelihood of the sightings so far
        self._before: dict[float, tuple[Float, ...]] = {}

    def see(self, time_s: float, values: Float) -> None:
        """Score every tempo by the (n,) sightings of a session, then take them in.

        Raises ``InvalidValueError`` for a session out of order or out of [0, 1].
        """
        values = self._checked(time_s, values)
        if self.times_s:
            expected = self._by_tempo(time_s)
            known = ~np.isnan(values)
            lost = values * log_score(expected, np.ones(self.n))
            lost = lost + (1.0 - values) * log_score(expected, np.zeros(self.n))
            self.scores[:, known] -= lost[:, known]
        self.rows.append(values)
        self.times_s.append(float(time_s))
        known = ~np.isnan(values)
        self.last = np.where(known, values, self.last)
        self.last_s = np.where(known, time_s, self.last_s)
        self._before.clear()

    def _checked(self, time_s: float, values: Float) -> Float:
        values = np.asarray(values, dtype=np.float64)
        if values.shape != (self.n,):
            raise InvalidValueError(f"values must be ({self.n},), got {values.shape}")
        known = values[~np.isnan(values)]
        if known.size and not 0.0 <= known.min() <= known.max() <= 1.0:
            raise InvalidValueError("values must lie in [0, 1] or be NaN")
        if not math.isfinite(time_s) or (self.times_s and time_s <= self.times_s[-1]):
            raise InvalidValueError(f"time_s must come after {self.times_s[-1:]}, got {time_s}")
        return values

    def _table(self) -> Float:
        """(sessions, n)."""
        return np.array(self.rows).reshape(len(self.rows), self.n)

    def weights(self) -> Float:
        """(tempos, n) of each tempo at each place; they add up to 1."""
        common = np.full(len(TEMPOS), 1.0 / len(TEMPOS))
        likely = np.exp(self.scores - self.scores.max(axis=0, initial=-math.inf))
        for _ in range(_ROUNDS):
            each = common[:, None] * likely
            each /= each.sum(axis=0)
            if self.n:
                common = (each.sum(axis=1) + 1.0) / (self.n + len(TEMPOS))
        return np.asarray(each)

    def probability(self, time_s: float) -> Float:
        """Mean over the tempos by their weights."""
        expected = (self.weights() * self._by_tempo(time_s)).sum(axis=0)
        return np.asarray(np.clip(expected, LEAST, 1.0 - LEAST))

    def usual(self, hour: float) -> Float:
        """(n,) what is usual at that hour, whatever was last seen."""
        weights = self.weights()
        return np.asarray(
            sum(w * self._usual(hour, t) for w, t in zip(weights, TEMPOS, strict=True))
        )

    def stays_s(self) -> Float:
        """(n,) mean time for which a place stays as it is, s, by its tempos; up to 1e9."""
        rates = np.array([min(t.rate, 1.0 / HOUR_S) for t in TEMPOS])
        return np.asarray(1.0 / np.maximum((self.weights() * rates[:, None]).sum(axis=0), 1e-9))

    def _by_tempo(self, time_s: float) -> Float:
        """(tempos, n)."""
        hour, unseen = float(hour_of(time_s)), np.isnan(self.last)
        rows = []
        for tempo in TEMPOS:
            then = self._usual(hour, tempo)
            now = self._usual_when_seen(tempo)
            elapsed = np.where(unseen, math.inf, time_s - self.last_s)
            seen = np.where(unseen, now, self.last)
            rows.append(relaxed(then, now, seen, tempo.rate, elapsed))
        return np.array(rows)

    def _usual_when_seen(self, tempo: Tempo) -> Float:
        """At each place's last sighting, what was usual at that hour."""
        found = self._overall()
        for time_s in np.unique(self.last_s[~np.isnan(self.last_s)]):
            at = self.last_s == time_s
            found = np.where(at, self._usual(float(hour_of(time_s)), tempo), found)
        return found

    def _overall(self) -> Float:
        """Share of each place, drawn to that of all."""
        table = self._table()
        known = ~np.isnan(table)
        everywhere = (np.nansum(table) + 1.0) / (known.sum() + 2.0)
        return np.asarray(
            (np.nansum(table, axis=0) + PRIOR * everywhere) / (known.sum(axis=0) + PRIOR)
        )

    def _about(self, hour: float) -> tuple[Float, ...]:
        """Overall share, that moved by the hour, and sightings about that hour: sum and number."""
        key = round(hour, 6)
        if key not in self._before:
            table = self._table()
            overall = self._overall()
            near = near_hours(hour_of(np.array(self.times_s)), hour, 24.0 / BINS)
            known = ~np.isnan(table)
            count = near @ known
            taken = near @ np.nan_to_num(table)
            pull = 4.0 * float(overall.mean()) if self.n else 0.0
            came = (taken.sum() + pull) / (count.sum() + 4.0)
            habitual = ((count * overall).sum() + pull) / (count.sum() + 4.0)
            shift = _logit(np.array(came)) - _logit(np.array(habitual))
            moved = 1.0 / (1.0 + np.exp(-(_logit(overall) + shift)))
            self._before[key] = (overall, moved, taken, count)
        return self._before[key]

    def _usual(self, hour: float, tempo: Tempo) -> Float:
        if not self.times_s:
            return np.full(self.n, 0.5)
        overall, moved, taken, count = self._about(hour)
        base = overall + tempo.building * (moved - overall)
        return np.asarray((taken + tempo.hourly * base) / (count + tempo.hourly))


def _logit(p: Float) -> Float:
    p = np.clip(p, 1e-6, 1.0 - 1e-6)
    return np.asarray(np.log(p / (1.0 - p)))


class MobilityMap:
    """What a history says of its places. Rasters are NaN where no session saw anything."""

    def __init__(self, history: History) -> None:
        self.history = history

    @cached_property
    def _habits(self) -> Habits:
        cells, values = self.history.table()
        habits = Habits(len(cells))
        for time_s, row in zip(self.history.times_s.tolist(), values, strict=True):
            habits.see(time_s, row.astype(np.float64))
        return habits

    def probability(self, time_s: float) -> Raster | None:
        """That something stands in each place then; None without any place."""
        _finite(time_s)
        return self._raster(self._habits.probability(time_s))

    @cached_property
    def standing(self) -> Raster | None:
        """Share of the sessions that found something there."""
        _, values = self.history.table()
        with np.errstate(invalid="ignore", divide="ignore"):
            looks = (~np.isnan(values)).sum(axis=0)
            return self._raster(np.nansum(values, axis=0) / looks)

    @cached_property
    def mobility(self) -> Raster | None:
        """How much each place differs from one sighting to the next, on average.

        0: always so, wall or free floor; 1: never twice the same. NaN where it was seen once only.
        """
        _, values = self.history.table()
        last = np.full(values.shape[1:], np.nan)
        steps, pairs = np.zeros(len(last)), np.zeros(len(last))
        for row in values.astype(np.float64):
            both = ~np.isnan(row) & ~np.isnan(last)
            steps[both] += np.abs(row - last)[both]
            pairs += both
            last = np.where(np.isnan(row), last, row)
        return self._raster(np.where(pairs > 0, steps / np.maximum(pairs, 1.0), np.nan))

    @cached_property
    def stays_h(self) -> Float:
        """(n,) hours for which each place of ``history.table()`` stays as it is, on average."""
        return self._habits.stays_s() / 3600.0

    def at(self, point: tuple[float, float], time_s: float, reach_m: float = 0.0) -> float | None:
        """Probability that something stands at ``point`` (m, map frame) then, or, with ``reach_m``,
        in the likeliest place within that; None where no session saw it.
        """
        _finite(time_s)
        cells, _ = self.history.table()
        if not len(cells):
            return None
        cell = self.history.cell_m
        off = np.hypot(*((cells + 0.5) * cell - np.asarray(point)).T)
        near = off <= max(reach_m, 0.7072 * cell)
        if not near.any():
            return None
        expected = self._habits.probability(time_s)
        return float(expected[near].max() if reach_m > 0.0 else expected[int(np.argmin(off))])

    def _raster(self, values: Float) -> Raster | None:
        cells, _ = self.history.table()
        if not len(cells):
            return None
        low, images = dense(cells, values[None].astype(np.float32))
        origin = np.array([*(low * self.history.cell_m).tolist(), 0.0])
        return Raster(values=images[0], resolution_m=self.history.cell_m, T_map_origin=origin)


def _finite(time_s: float) -> None:
    if not math.isfinite(time_s):
        raise InvalidValueError(f"time_s must be finite, got {time_s}")


@dataclass(frozen=True, kw_only=True, eq=False)
class DaysRaster(Raster):
    """A map, and what is known of its places over days."""

    mobility: MobilityMap

    @classmethod
    def of(cls, raster: Raster, mobility: MobilityMap) -> "DaysRaster":
        """``raster`` with that beside it."""
        return cls(
            values=raster.values,
            resolution_m=raster.resolution_m,
            T_map_origin=raster.T_map_origin,
            mobility=mobility,
        )
