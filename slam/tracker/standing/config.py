# SPDX-License-Identifier: Apache-2.0
"""The numbers of trust in returns."""

from __future__ import annotations

from dataclasses import dataclass

from slam.settings import Settings, number

SEEDS = "training seeds of crowds, and real logs (docs/trust_in_returns.md)"


@dataclass(frozen=True, kw_only=True)
class StandingConfig(Settings):
    """For how long the place of a return was not seen empty, and what vote it has by that."""

    settled_s: float = number(
        5.0, "s", "a return whose place was empty so long ago has half a vote; 0: all vote"
    )
    young_trace: float = number(
        1.0, "share", "of a faint trace (1 - y) that is closed to who has no vote", high=1.0
    )
    views: int = number(7, "views", "earlier scans that are asked", low=1, high=64)
    spacing_s: float = number(0.2, "s", "least time between two kept scans", low=1e-3)
    ages_grow: float = number(1.8, "ratio", "of the ages of the scans asked", low=1.0)
    margin_m: float = number(0.05, "m", "an earlier beam went on by so much more: seen empty")
    spread_deg: float = number(1.0, "deg", "to either side of it, all beams did")
    left_s: float = number(2.0, "s", "things that left a place within it are looked for")
    left_m: float = number(0.25, "m", "returns this near to such a place belong to what left")
    along_m: float = number(0.3, "m", "votes are averaged along a surface so far each way")
    thin_m: float = number(
        0.1, "m", "narrower things vote: earlier beams may have missed them", SEEDS
    )
    vague_m: float = number(
        0.05, "m", "deviation of the prediction at which emptiness counts half", SEEDS, low=1e-4
    )
    sigmas: float = number(1.0, "σ", "of the prediction, added to margin_m and spread_deg", SEEDS)
    disagreed: float = number(
        6.0, "ratio", "corrections beyond what odometry may be off, squared: half believed; 0: all",
        SEEDS,
    )  # fmt: skip
    window_s: float = number(2.0, "s", "corrections are summed over it", SEEDS, low=1e-3)
    long_window_s: float = number(8.0, "s", "and over it", SEEDS, low=1e-3)
    match_m: float = number(0.005, "m", "what a match itself may be off", SEEDS, low=1e-6)
    match_deg: float = number(0.2, "deg", "the same of its heading", SEEDS, low=1e-6)
    doubtful_m: float = number(0.15, "m", "off by so much: not converged; 0: never", SEEDS)


ALL_VOTE = StandingConfig(settled_s=0.0, disagreed=0.0)  # every return, and odometry is not asked
