# SPDX-License-Identifier: Apache-2.0
"""The numbers of trust in returns: the weight of a return, and when odometry contradicts."""

from dataclasses import dataclass

from slam.settings import Settings, number

SEEDS = "training seeds of crowds, and real logs (docs/trust_in_returns.md)"


@dataclass(frozen=True, kw_only=True)
class StandingConfig(Settings):
    """For how long the place of a return was not seen empty, and what weight it has by that."""

    settled_s: float = number(
        5.0, "s", "a return whose place was seen empty so long ago has half its weight; 0: off",
        SEEDS,
    )  # fmt: skip
    young_trace: float = number(
        1.0, "share", "of a faint trace (1 - y), closed to returns without weight while scans come "
        "often", SEEDS, high=1.0,
    )  # fmt: skip
    views: int = number(5, "scans", "earlier scans that are asked", SEEDS, low=1, high=64)
    spacing_s: float = number(
        0.2, "s", "least time between two kept scans; age of the second one asked", SEEDS, low=1e-3
    )
    ages_grow: float = number(2.5, "ratio", "of the ages of the scans asked", SEEDS, low=1.01)
    margin_m: float = number(
        0.05, "m", "an earlier beam went on by so much more: the place was seen empty", SEEDS
    )
    spread_deg: float = number(1.0, "deg", "to either side of it, all beams did", SEEDS, high=90.0)
    sigmas: float = number(1.0, "σ", "of the prediction, added to margin_m and spread_deg", SEEDS)
    vague_m: float = number(
        0.05, "m", "deviation of the prediction at which emptiness counts half", SEEDS, low=1e-4
    )
    came_s: float = number(
        12.0, "s", "places that were seen empty within it are looked for; 12: in all scans asked",
        SEEDS,
    )  # fmt: skip
    left_s: float = number(1.5, "s", "things that left a place within it are looked for", SEEDS)
    left_m: float = number(
        0.25, "m", "returns this near to such a place belong to what left it", SEEDS
    )
    along_m: float = number(
        0.3, "m", "weights are averaged along a surface so far each way", SEEDS, low=1e-3
    )
    thin_m: float = number(
        0.1, "m", "narrower things keep their weight: earlier beams may have missed them", SEEDS
    )
    window_s: float = number(
        2.0,
        "s",
        "corrections are summed over it; old surface takes as long to hold",
        SEEDS,
        low=1e-3,
    )
    disagreed: float = number(
        3.0, "ratio", "of corrections over what odometry may be off, squared: above, a match must "
        "explain clearly more of the map than where odometry leads; 0: never asked", SEEDS,
    )  # fmt: skip
    scale: float = number(0.1, "share", "of way and turn that odometry may be off by in a window")
    match_m: float = number(0.005, "m", "what a match itself may be off", SEEDS, low=1e-6)
    match_deg: float = number(0.2, "deg", "the same of its heading", SEEDS, low=1e-6)


FULL_WEIGHT = StandingConfig(settled_s=0.0, disagreed=0.0)  # every return
