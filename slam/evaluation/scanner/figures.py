# SPDX-License-Identifier: Apache-2.0
"""One measured number with its interval, from tallies of stretches of a log.

Beams of one place are not independent: they hit the same wall, the same edge. So whole stretches
are drawn again, not beams.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from slam.evaluation.statistics import CONFIDENCE, bootstrap_draws, central_interval
from slam.frames import Float

Int = NDArray[np.int64]

FEW, MANY = 3, 8  # stretches: from FEW on an interval by the jackknife, from MANY on by bootstrap


@dataclass(frozen=True, kw_only=True)
class Figure:
    """``value`` with its 95 % interval, NaN where nothing was measured.

    n          how many beams, walls or edges it is of
    stretches  in how many stretches these are
    low, high  NaN for fewer than three stretches, and where every one has 0: that none was seen
               does not say how rare it is
    """

    value: float
    low: float
    high: float
    n: int
    stretches: int

    @property
    def has_interval(self) -> bool:
        """Whether there were stretches enough to draw from."""
        return math.isfinite(self.low) and math.isfinite(self.high)

    def if_of(self, least: int) -> "Figure":
        """Itself, where it is of so many beams, walls or edges; less says nothing."""
        return self if self.n >= least else NOTHING


NOTHING = Figure(value=math.nan, low=math.nan, high=math.nan, n=0, stretches=0)
Figures = dict[str, Figure]
"""By the keys of ``slam.evaluation.scanner.card.STATISTICS``."""


def key_of(key: str, low: float, high: float) -> str:
    """Of a statistic within a bin."""
    return f"{key}.{low:g}-{high:g}"


def ratio(
    sums: Sequence[float], counts: Sequence[float], told: Callable[[float], float] = float
) -> Figure:
    """``told`` of sum / count; one ``sums`` and one ``counts`` >= 0 a stretch.

    told  rising: what is printed of a mean, e.g. a root. Stretches with a count of 0 take no part.
    """
    total, count = np.asarray(sums, np.float64), np.asarray(counts, np.float64)
    total, count = total[count > 0.0], count[count > 0.0]

    def of(drawn: Int) -> float:
        return float(total[drawn].sum() / count[drawn].sum())

    return _figure(len(count), round(float(count.sum())), of, told)


def median(values: Sequence[Float], told: Callable[[float], float] = float) -> Figure:
    """``told`` of the median of all values; (k,) values >= 0 a stretch."""
    own = [np.asarray(v, np.float64) for v in values if len(v)]
    every = np.concatenate([np.zeros(0), *own])
    order = np.argsort(every, kind="stable")
    ranked = every[order]
    whose = np.repeat(np.arange(len(own)), [len(v) for v in own])[order]

    def of(drawn: Int) -> float:  # each value as often as its stretch was drawn
        upto = np.cumsum(np.bincount(drawn, minlength=len(own))[whose])
        return float(ranked[np.searchsorted(upto, 0.5 * upto[-1])])

    return _figure(len(own), len(every), of, told)


def _figure(
    stretches: int, n: int, of: Callable[[Int], float], told: Callable[[float], float]
) -> Figure:
    """``told`` of what ``of`` gives for the stretches drawn, by their numbers."""
    if not stretches:
        return NOTHING
    every = np.arange(stretches)
    value, low, high = told(of(every)), math.nan, math.nan
    some = of(every) > 0.0
    if stretches >= MANY and some:
        ends = central_interval([of(draw) for draw in bootstrap_draws(stretches)])
        low, high = (told(end) for end in ends)  # rising: the ends are those of all draws told
    elif stretches >= FEW and some:  # a bootstrap of so few is too narrow
        without = np.array([told(of(np.delete(every, k))) for k in range(stretches)])
        spread = math.sqrt((stretches - 1) * float(without.var()))
        reach = spread * float(scipy.stats.t.ppf(0.5 + 0.5 * CONFIDENCE, stretches - 1))
        low, high = max(value - reach, 0.0), value + reach
    return Figure(value=value, low=low, high=high, n=n, stretches=stretches)


def apart(a: Figure, b: Figure) -> bool | None:
    """Whether the intervals do not meet; None where one of them has none."""
    if not (a.has_interval and b.has_interval):
        return None
    return a.high < b.low or b.high < a.low
