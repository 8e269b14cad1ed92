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


def against_unchanged(changes: Sequence[float]) -> float:
    """E of these runs against "nothing changed"."""
    return mean(math.prod(_bet(bet, value) for value in changes) for bet in BETS)


def against_larger(changes: Sequence[float]) -> float:
    """E against "errors are larger by ``WORSE``"."""
    return against_unchanged([math.log1p(WORSE) - value for value in changes])


def against_lost(changes: Sequence[float]) -> float:
    """E against "of the runs held before a share of ``WORSE`` is newly lost"."""
    lost, newly_held = changes.count(math.inf), changes.count(-math.inf)
    held = len(changes) - lost - newly_held
    return mean((p / WORSE) ** lost * ((1.0 - p) / (1.0 - WORSE)) ** held for p in LOST_BETS)


def _bet(bet: float, value: float) -> float:
    return 1.0 + math.tanh(bet * max(-MOST, min(MOST, value)))


def verdict(changes: Sequence[float | None]) -> Verdict:
    """What is sure after these runs; None tells nothing."""
    told = [value for value in changes if value is not None]
    if against_unchanged(told) >= 1.0 / WRONG:
        return "worse"
    sure = min(against_larger(told), against_lost(told)) >= 1.0 / WRONG
    return "not worse" if sure else "undecided"


def verdict_of(changes: Sequence[float | None]) -> tuple[Verdict, int]:
    """Of runs in their order: the first verdict that is sure, and after how many."""
    for k in range(1, len(changes) + 1):
        if (sure := verdict(changes[:k])) != "undecided":
            return sure, k
    return "undecided", len(changes)
