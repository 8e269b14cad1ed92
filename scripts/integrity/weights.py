# SPDX-License-Identifier: Apache-2.0
"""Evidence weights that make labelled scans likeliest: the model of ``slam.tracker.belief``.

Of each scan one place of those that a search found is right, or none is: a conditional logit with
``place`` nats for none. A true place against one beside it: a logistic regression. Both have the
same evidence, and each kind of scan counts alike. Intervals are of fits to resampled streams.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # scipy.optimize comes with its first use
from numpy.typing import NDArray

from scripts.integrity.labelled import Labelled
from slam.errors import InvalidValueError
from slam.evaluation.statistics import central_interval
from slam.frames import Float
from slam.tracker.belief.config import BeliefConfig

JOINT = ("confirmed", "confirmed_m", "through", "place")
FIXED = ("linear_m",)  # of the evidence, too; set by hand
ALONE = ("nearby_per_m", "searched", "broken")
SCANS = 500.0  # that all labels together count, against the prior of ``SPREAD``
SPREAD = 3.0  # deviation of the logarithm of a weight about its start: keeps what no scan tells
LOW, HIGH = 1e-3, 1e3  # of a weight
RESAMPLED = 100
STARTS = (1.0, 0.5, 2.0)  # times the first
Values = dict[str, float]


@dataclass(frozen=True, eq=False)
class Places:
    """Scans with the places of each; the last axis is padded.

    known, through  (n, places) C and D, m; ``there`` (n, places) where there is a place
    right           (n, places) the true ones
    stream          (n,) of which stream, counted
    """

    known: Float
    through: Float
    there: NDArray[np.bool_]
    right: NDArray[np.bool_]
    stream: NDArray[np.int64]

    @classmethod
    def of(cls, scans: Sequence[tuple[int, Sequence[tuple[float, float, bool]]]]) -> "Places":
        """Of (stream, places) of each scan."""
        width = max((len(places) for _, places in scans), default=0)
        table = np.full((len(scans), width, 3), np.nan)
        for row, (_, places) in zip(table, scans, strict=True):
            row[: len(places)] = np.array(places, dtype=np.float64).reshape(-1, 3)
        there = ~np.isnan(table[..., 0])
        known, through, right = np.moveaxis(np.nan_to_num(table), 2, 0)
        streams = np.array([stream for stream, _ in scans], dtype=np.int64)
        return cls(known, through, there, right > 0.5, streams)


@dataclass(frozen=True, eq=False)
class Scans:
    """All labelled scans of some streams.

    found, none  groups of places, one of them right, or none
    pairs        one place each
    """

    found: Places
    none: Places
    pairs: Places
    streams: int

    @classmethod
    def of(cls, many: Sequence[Labelled]) -> "Scans":
        """Raises ``InvalidValueError`` where a kind of label is missing."""
        found = [(k, g) for k, one in enumerate(many) for g in one.found if any(p[2] for p in g)]
        none = [(k, group) for k, one in enumerate(many) for group in one.none]
        pairs = [(k, [pair]) for k, one in enumerate(many) for pair in one.pairs]
        if not found or not none or not pairs:
            raise InvalidValueError(
                f"a fit needs scans that are found, scans of elsewhere and pairs, got {len(found)},"
                f" {len(none)} and {len(pairs)}"
            )
        return cls(Places.of(found), Places.of(none), Places.of(pairs), len(many))


def evidence(values: Values, known: Float, through: Float) -> Float:
    """Nats for places, as ``slam.tracker.belief.posterior.Odds.evidence`` (a test holds that)."""
    chance, one_view = values["confirmed_m"], np.minimum(known, values["linear_m"])
    more = np.log1p(one_view / chance) + (known - one_view) / (chance + one_view)
    denied = values["through"] * np.sqrt(through)
    return np.asarray(values["confirmed"] * more - denied)


def likelihood(values: Values, scans: Scans, counts: Float) -> float:
    """Mean log-likelihood of the four kinds of scans, added; ``counts`` (streams,) of each."""
    total = 0.0
    for places in (scans.found, scans.none):
        nats = np.where(places.there, evidence(values, places.known, places.through), -np.inf)
        none = np.full((len(nats), 1), values["place"])
        every = np.logaddexp.reduce(np.concatenate([nats, none], axis=1), axis=1)
        of = np.where(places.right, nats, -np.inf) if places is scans.found else none
        right = np.logaddexp.reduce(of, axis=1)
        total += _mean(right - every, counts[places.stream])
    nats = evidence(values, scans.pairs.known, scans.pairs.through)[:, 0]
    right = scans.pairs.right[:, 0]
    said = -np.logaddexp(0.0, np.where(right, -nats, nats))
    weights = counts[scans.pairs.stream]
    return total + _mean(said[right], weights[right]) + _mean(said[~right], weights[~right])


def _mean(values: Float, weights: Float) -> float:
    return float((values * weights).sum() / max(weights.sum(), 1e-9))


def fit(
    scans: Scans, start: Values, counts: Float | None = None, tries: Sequence[float] = STARTS
) -> Values:
    """The likeliest values of the settings ``JOINT``; the others stay as in ``start``.

    counts  (streams,) how often each stream counts; once where there are none
    tries   begin at so many times ``start``
    """
    often = np.ones(scans.streams) if counts is None else counts
    first = np.array([start[name] for name in JOINT])

    def values(logs: Float) -> Values:
        return start | dict(zip(JOINT, np.exp(logs).tolist(), strict=True))

    return values(_least(lambda logs: -likelihood(values(logs), scans, often), first, tries))


def _least(loss: Callable[[Float], float], start: Float, tries: Sequence[float]) -> Float:
    """Logarithms of weights at the least mean loss, with the prior of ``SPREAD``."""
    centre = np.log(start)

    def shy(logs: Float) -> float:
        return 0.5 * float((((logs - centre) / SPREAD) ** 2).sum()) + SCANS * loss(logs)

    bounds = [(math.log(LOW), math.log(HIGH))] * len(start)
    ends = [
        scipy.optimize.minimize(shy, centre + math.log(k), method="L-BFGS-B", bounds=bounds)
        for k in tries
    ]
    return np.asarray(min(ends, key=lambda end: float(end.fun)).x)


def nearby(slips: Sequence[tuple[float, float, bool]], start: float) -> float:
    """Nats a metre of trace by which a place nearby is right: a logistic regression.

    Right and wrong places count alike; ``start`` where one of the two is missing.
    """
    gains, priors, is_right = np.array(slips, dtype=np.float64).reshape(-1, 3).T
    right = is_right > 0.5
    if right.all() or not right.any():
        return start
    weights = np.where(right, 0.5 / right.sum(), 0.5 / (~right).sum())

    def loss(logs: Float) -> float:
        nats = math.exp(float(logs[0])) * gains + priors
        return 2.0 * float((weights * np.logaddexp(0.0, np.where(right, -nats, nats))).sum())

    return math.exp(float(_least(loss, np.array([start]), (1.0,))[0]))


def searched(best_m: Float, found: NDArray[np.bool_], start: float) -> float:
    """Log odds that a search finds the true place, a metre that the best one found confirms."""
    if not len(best_m):
        return start

    def loss(logs: Float) -> float:
        nats = math.exp(float(logs[0])) * best_m
        return float(np.logaddexp(0.0, np.where(found, -nats, nats)).mean())

    return math.exp(float(_least(loss, np.array([start]), (1.0,))[0]))


def alone(many: Sequence[Labelled], start: BeliefConfig) -> Values:
    """The settings that each have labels of their own: ``ALONE``."""
    reached = np.array([row for one in many for row in one.reached], np.float64).reshape(-1, 2)
    most, found = np.minimum(reached[:, 0], start.linear_m), reached[:, 1] > 0.5
    going = [share for one in many for share in one.going]
    gone = sum(share < start.breaks for share in going)
    return {
        "nearby_per_m": nearby([slip for one in many for slip in one.slips], start.nearby_per_m),
        "searched": searched(most, found, start.searched),
        "broken": -math.log((gone + 0.5) / (len(going) + 1.0)),
    }


def fitted(
    many: Sequence[Labelled], start: BeliefConfig, resampled: int = RESAMPLED
) -> dict[str, tuple[float, float, float]]:
    """Value and interval of every setting that is fitted, by its name."""
    scans, first = Scans.of(many), {name: float(getattr(start, name)) for name in JOINT + FIXED}
    best, rng, again = fit(scans, first), np.random.default_rng(0), []
    for _ in range(resampled):
        streams = rng.integers(len(many), size=len(many))
        counts = np.bincount(streams, minlength=len(many)).astype(np.float64)
        again.append(fit(scans, best, counts, (1.0,)) | alone([many[k] for k in streams], start))
    values = {name: best[name] for name in JOINT} | alone(many, start)
    return {
        name: (value, *central_interval([one[name] for one in again]))
        for name, value in values.items()
    }
