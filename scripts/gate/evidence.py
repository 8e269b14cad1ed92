# SPDX-License-Identifier: Apache-2.0
"""A sequential test: is a SLAM worse than it was, told run by run, with stated errors.

Each run is a pair on one recording: the error before and now. Where nothing changed, before and now
are two draws of one thing, so the sign of ln(now / before) is a fair coin whatever its size. So

    E = product over runs of (1 + tanh(bet * ln(now / before)))

has mean 1 at every run, and exceeds 1 / ``WRONG`` at any time with probability ``WRONG`` at most
(Ville's inequality): one may look after every run, and stop. The mean of several such E, by bet, is
one as well. The same holds for the opposite claim, with ln(1 + ``WORSE``) taken off.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import mean
from typing import Any, Literal

Verdict = Literal["worse", "not worse", "undecided"]
WRONG = 0.01  # probability of a wrong verdict, at most, of either kind
WORSE = 0.2  # what is to be excluded: errors so much larger, or such a share of runs newly lost
BETS = (2.0, 5.0)  # for changes that scatter by 0.3 and by less than 0.2 of a logarithm
LOST_BETS = (0.0, 0.05)  # shares of newly lost runs that are bet on, below ``WORSE``
MOST = math.log(1.5)  # a run counts as half as much again at most: newly lost, too
LEAST = 1e-3  # m, and m/s: smaller errors are as good; the resolution of a scanner's ranges
ERRORS = ("ate_se2_m", "rpe_m_per_s")  # of the path's shape, and of each second of it


def change(before: Mapping[str, Any], now: Mapping[str, Any]) -> float | None:
    """ln(now / before) of two runs on one recording, the mean of that of ``ERRORS``.

    Infinite where it is newly lost, minus infinite where it is newly held; None where both are
    lost, which tells nothing.
    """
    if before["lost"] or now["lost"]:
        return None if before["lost"] == now["lost"] else math.inf if now["lost"] else -math.inf
    both = [(before[key], now[key]) for key in ERRORS]
    logs = [math.log(max(b, LEAST) / max(a, LEAST)) for a, b in both if None not in (a, b)]
    return mean(logs) if logs else None


def _bet(bet: float, value: float) -> float:
    return 1.0 + math.tanh(bet * max(-MOST, min(MOST, value)))


@dataclass(eq=False)
class Evidence:
    """What the runs so far say; each list has an E for each bet.

    changes  as of ``change``, those that are None left out
    worse    against "nothing changed"
    alike    against "errors are larger by ``WORSE``"
    held     against "a share of ``WORSE`` of the runs is newly lost"
    """

    changes: list[float] = field(default_factory=list)
    worse: list[float] = field(default_factory=lambda: [1.0] * len(BETS))
    alike: list[float] = field(default_factory=lambda: [1.0] * len(BETS))
    held: list[float] = field(default_factory=lambda: [1.0] * len(LOST_BETS))

    def add(self, value: float | None) -> None:
        """One more run."""
        if value is None:
            return
        self.changes.append(value)
        for k, bet in enumerate(BETS):
            self.worse[k] *= _bet(bet, value)
            self.alike[k] *= _bet(bet, math.log1p(WORSE) - value)
        for k, share in enumerate(LOST_BETS if value > -math.inf else ()):
            self.held[k] *= share / WORSE if value == math.inf else (1.0 - share) / (1.0 - WORSE)

    @property
    def verdict(self) -> Verdict:
        """What is sure by now."""
        if mean(self.worse) >= 1.0 / WRONG:
            return "worse"
        sure = min(mean(self.alike), mean(self.held)) >= 1.0 / WRONG
        return "not worse" if sure else "undecided"

    @property
    def newly(self) -> tuple[int, int]:
        """Runs newly lost, and newly held."""
        return self.changes.count(math.inf), self.changes.count(-math.inf)


def verdict_of(changes: Sequence[float | None]) -> tuple[Verdict, int]:
    """Of runs in their order: the first verdict that is sure, and after how many."""
    evidence = Evidence()
    for k, value in enumerate(changes, 1):
        evidence.add(value)
        if evidence.verdict != "undecided":
            return evidence.verdict, k
    return "undecided", len(changes)
