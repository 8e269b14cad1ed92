# SPDX-License-Identifier: Apache-2.0
"""The numbers of scan matching: score, climb, local and global search."""

from __future__ import annotations

from dataclasses import dataclass, field

from slam.settings import Settings, number

MANY = 100_000


@dataclass(frozen=True, kw_only=True)
class ClimbConfig(Settings):
    """Newton's method with Levenberg damping."""

    steps: int = number(20, "steps", "at most", low=1, high=MANY)
    enough: float = number(3e-3, "score", "expected rise below which a step is the last")
    damping: float = number(1e-3, "ratio", "at first")
    damping_falls: float = number(0.2, "ratio", "after a step that rose")
    damping_grows: float = number(10.0, "ratio", "after one that did not", low=1.0)
    damping_least: float = number(1e-6, "ratio", "after steps that rose")
    damping_again: float = number(0.1, "ratio", "at least, after a step that did not rise")
    damping_most: float = number(1e6, "ratio", "beyond it the climb ends", high=1e12)
    few: int = number(90, "points", "are enough to approach the optimum", low=1, high=MANY)
    widest_cells: float = number(3.0, "cells", "blur of an observation in approach, at most")
    moved_cells: float = number(
        0.5, "cells", "a prior that moves no observation by more needs no approach"
    )
    tempered: float = number(
        0.9, "ratio", "a weight that falls by less is not climbed with again", high=1.0
    )
    least_weight: float = number(1e-6, "reward", "however little matched", low=1e-12)


@dataclass(frozen=True, kw_only=True)
class LocalConfig(Settings):
    """Branch and bound in a window around the prediction."""

    vague_cells: float = number(1.0, "cells", "a wider prior may miss the optimum: search")
    good_share: float = number(0.85, "share", "of the usual match: below it, search")
    widest_share: float = number(0.7, "share", "of that: below it, search the widest window")
    sigmas: float = number(3.0, "σ", "half width of the window, in deviations of the prior")
    least_m: float = number(0.1, "m", "half width of the window, at least")
    least_rad: float = number(0.05, "rad", "the same in heading")
    reach_m: float = number(0.6, "m", "half width of the widest window", low=1e-3, high=20.0)
    turn_rad: float = number(0.5, "rad", "the same in heading", low=1e-3, high=3.2)
    points: int = number(180, "points", "more add cost, not certainty", low=1, high=MANY)
    heading_cells: float = number(
        1.5, "cells", "a far point moves so far between two headings", low=1e-3
    )
    finest_rad: float = number(0.003, "rad", "between two headings, at least", low=1e-4)
    coarsest_rad: float = number(0.03, "rad", "between two headings, at most", low=1e-4)


@dataclass(frozen=True, kw_only=True)
class GlobalConfig(Settings):
    """Branch and bound over the whole map, for relocalisation."""

    pitch_m: float = number(0.12, "m", "neurons are pooled up to this edge", low=1e-3)
    beside: float = number(
        0.7, "share", "worth of a place beside structure: poses are tried every pitch", high=1.0
    )
    far_m: float = number(20.0, "m", "returns beyond turn too fast with the heading", low=0.1)
    points: int = number(120, "points", "are enough", low=1, high=MANY)
    apart_m: float = number(1.0, "m", "between two answers, or")
    apart_rad: float = number(0.5, "rad", "between two answers: one of the two")
    worth: float = number(0.6, "share", "answers worse than this of the best are dropped", high=1.0)
    finest_rad: float = number(0.01, "rad", "between two headings, at least", low=1e-3)
    coarsest_rad: float = number(0.1, "rad", "between two headings, at most", low=1e-3, high=0.5)


@dataclass(frozen=True, kw_only=True)
class MatchingConfig(Settings):
    """Eq. (13), and the searches for its optimum."""

    matched_overlap: float = number(0.15, "overlap", "an observation with less is not matched")
    log_floor: float = number(
        0.1, "overlap", "added before the logarithm is taken, preset paper", low=1e-6
    )
    tail: float = number(3.3, "σ", "where the Gaussian of an observation ends", low=1.0, high=6.0)
    tail_cells: float = number(3.0, "cells", "and not nearer than this", low=1.0, high=16.0)
    climb: ClimbConfig = field(default=ClimbConfig())
    local: LocalConfig = field(default=LocalConfig())
    whole: GlobalConfig = field(default=GlobalConfig())
