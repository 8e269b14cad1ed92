# SPDX-License-Identifier: Apache-2.0
"""What counts as hazardous, and what a number of failures in so many trials says at most.

The words are those of the Stanford diagram of aviation, for each scan:

  unavailable  the SLAM does not trust its pose (``converged`` is False)
  nominal      it does, and is right
  misleading   it does, the error is beyond 3 sigma of its covariance, 0.1 to 0.5 m
  hazardous    it does, and the error is beyond the alert limit of 0.5 m, whatever the covariance

Its protection level, 3 sigma of the covariance of position in the worst direction, is asked apart:
who drives only where that is within the alert limit, too, meets fewer of these.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # scipy.stats comes with its first use
from numpy.typing import NDArray

from scripts.integrity.kidnap import RIGHT_M, RIGHT_RAD
from scripts.metrics.judged import SILENT_M, Judged
from slam.evaluation.statistics import CONFIDENCE
from slam.frames import NS_PER_S, Float

Mask = NDArray[np.bool_]
ALERT_M = 0.5  # m of position error: the alert limit
ALERT_S = 0.5  # s after a robot was carried or pushed, in which it need not know yet
STAYS_S = 1.0  # s of being right and trusted, which make a recovery
PER_OCTAVE = 16  # bins of processor time: a quantile is off by 4.4 % at most


@dataclass(frozen=True, kw_only=True, eq=False)
class Moments:
    """A run scan by scan, each (n,).

    seconds  stamps, s
    off      position errors, m; ``turned`` heading errors, rad
    trusted  by the SLAM itself
    told     not trusted, or within 3 sigma of the covariance of position
    level    protection level, m
    """

    seconds: Float
    off: Float
    turned: Float
    trusted: Mask
    told: Mask
    level: Float

    @classmethod
    def of(cls, run: Judged) -> "Moments":
        """Of a run with truth and covariances."""
        return cls(
            seconds=run.pairs.stamps_ns / NS_PER_S,
            off=run.pairs.distances,
            turned=run.pairs.errors[:, 2],
            trusted=run.converged(),
            told=run.is_told(),
            level=run.protection_levels(),
        )

    def since(self, k: int) -> "Moments":
        """Scan ``k`` and those after it."""
        return Moments(**{name: values[k:] for name, values in vars(self).items()})

    def after_alert(self) -> "Moments":
        """Without the first ``ALERT_S``, and the first scan at least."""
        late = np.flatnonzero(self.seconds - self.seconds[0] >= ALERT_S)
        return self.since(max(int(late[0]), 1) if len(late) else len(self.seconds))

    def hazardous(self) -> Mask:
        """(n,) trusted and farther off than the alert limit."""
        return np.asarray(self.trusted & (self.off > ALERT_M))

    def protected(self) -> Mask:
        """(n,) trusted, and the protection level is within the alert limit."""
        return np.asarray(self.trusted & (self.level <= ALERT_M))

    def misleading(self) -> Mask:
        """(n,) trusted, not hazardous, off by more than ``SILENT_M`` and more than it admits."""
        return np.asarray(~self.told & (self.off > SILENT_M) & (self.off <= ALERT_M))

    def right(self, near_m: float = RIGHT_M, near_rad: float = RIGHT_RAD) -> Mask:
        """(n,) trusted and where the robot is."""
        near = (self.off <= near_m) & (np.abs(self.turned) <= near_rad)
        return np.asarray(self.trusted & near)

    def wrong_places(self, trusted_before: bool = True) -> int:
        """How often it came to trust a pose beyond the alert limit.

        ``trusted_before`` is False after a robot was carried: who never doubts then trusts a wrong
        place as well.
        """
        before = np.concatenate([[trusted_before], self.trusted[:-1]])
        return int((~before & self.hazardous()).sum())

    def recovered_s(
        self, since: int = 0, near_m: float = RIGHT_M, near_rad: float = RIGHT_RAD
    ) -> float:
        """Seconds from scan ``since`` until it is right and stays so for ``STAYS_S``; inf: never.

        A run that ends sooner than that has not recovered.
        """
        right, began = self.right(near_m, near_rad), math.inf
        for k in range(since, len(right)):
            second = float(self.seconds[k])
            began = min(began, second) if right[k] else math.inf
            if second - began >= STAYS_S:
                return began - float(self.seconds[since])
        return math.inf

    def outages(self) -> list[float]:
        """Of each stretch that begins with a scan unavailable or hazardous: s until recovered."""
        bad = ~self.trusted | self.hazardous()
        found, k = [], 0
        while bad[k:].any():
            k += int(np.argmax(bad[k:]))
            found.append(self.recovered_s(k))
            k = int(np.searchsorted(self.seconds, self.seconds[k] + found[-1] + 1e-9))
        return found


def stretches(mask: Mask) -> int:
    """How many runs of True are in it."""
    return int((mask[1:] & ~mask[:-1]).sum()) + int(len(mask) > 0 and mask[0])


def most_of_trials(hits: int, n: int) -> float:
    """Exact upper bound of a share at ``CONFIDENCE``, one-sided (Clopper-Pearson); nearly 3 / n of
    none. NaN of no trials; ``ValueError`` for more hits than trials.
    """
    if n == 0:
        return math.nan
    test = scipy.stats.binomtest(hits, n, alternative="less")
    return float(test.proportion_ci(CONFIDENCE, method="exact").high)


def most_of_time(events: int, hours: float) -> float:
    """Exact upper bound of a rate at ``CONFIDENCE``, one-sided (Poisson), per hour; NaN of none."""
    if hours <= 0.0:
        return math.nan
    return float(scipy.stats.chi2.ppf(CONFIDENCE, 2 * (events + 1))) / 2.0 / hours


def binned(milliseconds: Sequence[float] | Float) -> dict[str, int]:
    """How many of these lie in each bin; ``PER_OCTAVE`` bins for each doubling."""
    where = np.rint(PER_OCTAVE * np.log2(np.maximum(milliseconds, 1e-6))).astype(np.int64)
    return {str(at): count for at, count in sorted(Counter(where.tolist()).items())}


def bin_quantile(bins: Sequence[Mapping[str, int]], share: float) -> float:
    """The middle of the first bin up to which ``share`` of all of ``binned`` lie, ms; NaN of none.

    bins  several of ``binned``, which count together
    """
    counts = sum(map(Counter, bins), Counter[str]())
    wanted, seen = share * counts.total(), 0
    for at in sorted(counts, key=int):
        seen += counts[at]
        if seen >= wanted:
            return float(2.0 ** (int(at) / PER_OCTAVE))
    return math.nan
