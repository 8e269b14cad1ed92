# SPDX-License-Identifier: Apache-2.0
"""The numbers of scan matching: score, climb, local and global search."""

from dataclasses import dataclass, field

from slam.settings import Settings, number

MANY = 100_000


@dataclass(frozen=True, kw_only=True)
class ClimbConfig(Settings):
    """Newton's method with Levenberg damping."""

    steps: int = number(20, "steps", "Newton steps of one climb, at most", low=1, high=MANY)
    enough: float = number(3e-3, "score", "a step whose expected rise is smaller is the last")
    damping: float = number(1e-3, "ratio", "Levenberg damping of the first step")
    damping_falls: float = number(0.2, "ratio", "factor after a step that raised the score")
    damping_grows: float = number(10.0, "ratio", "factor after a step that did not", low=1.0)
    damping_least: float = number(1e-6, "ratio", "least damping after one that did")
    damping_again: float = number(0.1, "ratio", "least damping after one that did not")
    damping_most: float = number(1e6, "ratio", "damping at which the climb ends", high=1e12)
    few: int = number(90, "points", "most that approach the optimum", low=1, high=MANY)
    widest_cells: float = number(3.0, "cells", "widest blur of an observation while approaching")
    moved_cells: float = number(0.5, "cells", "a prior that moves less needs no approach")
    tempered: float = number(
        0.9, "ratio", "the climb is repeated where the weight falls below this share", high=1.0
    )
    least_weight: float = number(
        1e-6,
        "reward",
        "least weight of the reward, however little is matched",
        "numerical guard",
        low=1e-12,
    )


@dataclass(frozen=True, kw_only=True)
class UsualConfig(Settings):
    """What matches were like."""

    remembered: int = number(50, "scans", "whose median matched share is usual", low=1, high=MANY)
    fallen_s: float = number(1.0, "s", "memory of what returns matched of late", low=1e-3)


@dataclass(frozen=True, kw_only=True)
class LocalConfig(Settings):
    """Branch and bound in a window around the prediction."""

    vague_cells: float = number(1.0, "cells", "deviation of the prediction: above, a search runs")
    good_share: float = number(0.85, "share", "of the usual match: below, a search runs")
    widest_share: float = number(0.7, "share", "of good_share: below, the widest window")
    sigmas: float = number(3.0, "σ", "half width of the window, in deviations of prior")
    least_m: float = number(0.1, "m", "least half width of the window")
    least_rad: float = number(0.05, "rad", "least half width of the window")
    reach_m: float = number(0.6, "m", "half width of the widest window", low=1e-3, high=20.0)
    turn_rad: float = number(0.5, "rad", "half width of the widest window", low=1e-3, high=3.2)
    points: int = number(
        180,
        "points",
        "points used in a search, at most: more add cost, not certainty",
        low=1,
        high=MANY,
    )
    heading_cells: float = number(
        1.5, "cells", "a far point moves so far between two headings", low=1e-3
    )
    finest_rad: float = number(0.003, "rad", "least step of heading", low=1e-4)
    coarsest_rad: float = number(0.03, "rad", "largest step of heading", low=1e-4)


@dataclass(frozen=True, kw_only=True)
class GlobalConfig(Settings):
    """Branch and bound over the whole map, for relocalisation."""

    pitch_m: float = number(0.12, "m", "edge up to which cells are pooled for the search", low=1e-3)
    beside: float = number(0.7, "share", "worth of a place one pitch beside structure", high=1.0)
    far_m: float = number(20.0, "m", "returns beyond move too far with the heading", low=0.1)
    points: int = number(120, "points", "points used in a search, at most", low=1, high=MANY)
    apart_m: float = number(1.0, "m", "answers differ by this, or by apart_rad")
    apart_rad: float = number(0.5, "rad", "answers differ by this, or by apart_m")
    worth: float = number(0.6, "share", "of the best score: worse answers are dropped", high=1.0)
    finest_rad: float = number(0.01, "rad", "least step of heading", low=1e-3)
    coarsest_rad: float = number(0.1, "rad", "largest step of heading", low=1e-3, high=0.5)


PRICE = "measured on one core of a Xeon that others use too"
NEWER = "measured on one core of an EPYC"


@dataclass(frozen=True, kw_only=True)
class BudgetConfig(Settings):
    """What a scan may spend on finding a lost robot, and what the work is taken to cost."""

    budget_ms: float = number(
        20.0, "ms", "that no scan takes longer than; less: a lost robot is found later", low=1.0
    )
    cell_ns: float = number(9.0, "ns", "to lay out one cell of the map", PRICE, low=1e-2)
    bound_ns: float = number(0.3, "ns", "to look a point up in one coarse block", PRICE, low=1e-3)
    node_ns: float = number(12.0, "ns", "to look a point up in the 64 of a node", PRICE, low=1e-2)
    order_ns: float = number(3.0, "ns", "to put a coarse block in order", PRICE, low=1e-3)
    place_ns: float = number(10.0, "ns", "to place a point at one heading", PRICE, low=1e-2)
    climb_ns: float = number(1500.0, "ns", "to match a point at one hypothesis", NEWER, low=1.0)
    approach_ns: float = number(
        20_000.0, "ns", "to approach a place just found, by each of climb.few points", PRICE,
        low=1.0,
    )  # fmt: skip
    known_share: float = number(
        0.5, "share", "of what is counted: most that is spent on hypotheses that are followed",
        high=1.0,
    )  # fmt: skip
    lost_share: float = number(0.5, "share", "of budget_ms that is counted while lost", high=1.0)
    frozen_share: float = number(
        0.1, "share", "the same while frozen: three searches around it run", high=1.0
    )


@dataclass(frozen=True, kw_only=True)
class MatchingConfig(Settings):
    """Eq. (13), and the searches for its optimum."""

    matched_overlap: float = number(0.15, "overlap", "an observation with less is not matched")
    log_floor: float = number(
        0.1,
        "overlap",
        "added to the overlap before its logarithm is taken (preset paper)",
        low=1e-6,
    )
    tail: float = number(
        3.3,
        "σ",
        "distance at which the Gaussian of an observation ends",
        "exp(-3.3² / 2) = 0.4 % of its peak",
        low=1.0,
        high=6.0,
    )
    tail_cells: float = number(3.0, "cells", "least distance at which it ends", low=1.0, high=16.0)
    climb: ClimbConfig = field(default=ClimbConfig())
    usual: UsualConfig = field(default=UsualConfig())
    local: LocalConfig = field(default=LocalConfig())
    whole: GlobalConfig = field(default=GlobalConfig())
    budget: BudgetConfig = field(default=BudgetConfig())
