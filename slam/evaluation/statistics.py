# SPDX-License-Identifier: Apache-2.0
"""Medians with intervals, and differences of pairs: two SLAMs on the same frames.

Runs without a number take no part, except that a failed SLAM's errors count as infinite.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy  # scipy.stats comes with its first use: a second that other verbs need not pay
from numpy.typing import NDArray

from slam.errors import InvalidValueError

RESAMPLES = 2000
SEED = 20070411  # of every bootstrap: the same table gives the same intervals
CONFIDENCE = 0.95


def quantile(values: Sequence[float], share: float) -> float:
    """As ``numpy.quantile`` with its default, but infinite values are allowed; NaN of nothing."""
    if not values:
        return math.nan
    ranked = sorted(values)
    at = share * (len(ranked) - 1)
    k = min(int(at), len(ranked) - 2) if len(ranked) > 1 else 0
    return _between(ranked[k], ranked[min(k + 1, len(ranked) - 1)], at - k)


def _between(low: float, high: float, share: float) -> float:
    if share == 0.0 or low == high:
        return low
    if share == 1.0:
        return high
    if math.isinf(low) or math.isinf(high):
        return 0.0 if math.isinf(low) and math.isinf(high) else low + high
    return low + share * (high - low)


def median_interval(values: Sequence[float]) -> tuple[float, float]:
    """Percentile-bootstrap 95 % interval of the median, infinite values allowed."""
    if not values:
        return math.nan, math.nan
    return central_interval(drawn_medians(values, bootstrap_draws(len(values))).tolist())


def ratio_interval(before: Sequence[float], after: Sequence[float]) -> tuple[float, float]:
    """Percentile-bootstrap 95 % interval of median(after) / median(before), pairs drawn together.

    Infinite values are allowed; a draw with two infinite medians, or two of 0, counts as 1. NaN of
    nothing. Raises ``InvalidValueError`` for lists of different lengths.
    """
    if len(before) != len(after):
        raise InvalidValueError(f"{len(before)} values before must have as many after, "
                                f"got {len(after)}")  # fmt: skip
    if not before:
        return math.nan, math.nan
    draws = bootstrap_draws(len(before))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = drawn_medians(after, draws) / drawn_medians(before, draws)
    ratios[np.isnan(ratios)] = 1.0
    return central_interval(ratios.tolist())


def bootstrap_draws(n: int) -> NDArray[np.int64]:
    """(RESAMPLES, n) indices of n values, drawn with replacement; always the same."""
    return np.random.default_rng(SEED).integers(0, n, (RESAMPLES, n))


def drawn_medians(
    values: Sequence[float], draws: NDArray[np.int64], owners: NDArray[np.intp] | None = None
) -> NDArray[np.float64]:
    """(RESAMPLES,) medians of the values drawn, as ``quantile`` gives them.

    owners  (n,) which of the things drawn each value is of; else each is one of its own
    """
    rows, n = draws.shape
    times = np.bincount((draws + n * np.arange(rows)[:, None]).ravel(), minlength=rows * n)
    order = np.argsort(values)
    ranked = np.asarray(values, dtype=np.float64)[order]
    owned = order if owners is None else owners[order]
    upto = np.cumsum(times.reshape(rows, n)[:, owned], axis=1)  # so many drawn, up to each value
    drawn = upto[:, -1:]
    low, high = (ranked[(upto <= at).sum(axis=1)] for at in ((drawn - 1) // 2, drawn // 2))
    with np.errstate(invalid="ignore"):
        both = low + high
        medians: NDArray[np.float64] = np.where(np.isinf(both), both, low + 0.5 * (high - low))
    medians[np.isnan(both)] = 0.0  # as in _between
    return medians


def central_interval(resampled: Sequence[float]) -> tuple[float, float]:
    """Percentiles between which the middle ``CONFIDENCE`` of the values lies."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    return quantile(resampled, tail), quantile(resampled, 1.0 - tail)


def share_interval(hits: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    if n == 0:
        return math.nan, math.nan
    interval = scipy.stats.binomtest(hits, n).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def paired(a: Sequence[float], b: Sequence[float], *, less_is_better: bool) -> dict[str, Any]:
    """``a`` against ``b``, run by run: median of a - b with its interval, who won, sign test.

    Two infinite values are a tie of difference 0.
    """
    differences = [0.0 if x == y else x - y for x, y in zip(a, b, strict=True)]
    below, above = sum(d < 0.0 for d in differences), sum(d > 0.0 for d in differences)
    wins, losses = (below, above) if less_is_better else (above, below)
    low, high = median_interval(differences)
    decided = wins + losses
    return {
        "n": len(differences),
        "median_difference": quantile(differences, 0.5),
        "low": low,
        "high": high,
        "wins": wins,
        "ties": len(differences) - decided,
        "losses": losses,
        "p_sign": float(scipy.stats.binomtest(wins, decided).pvalue) if decided else 1.0,
    }
