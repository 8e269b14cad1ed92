# SPDX-License-Identifier: Apache-2.0
"""The numbers of the map that no preset turns; decay and trace: ``slam.tracker.config``."""

from dataclasses import dataclass

from slam.settings import Settings, number


@dataclass(frozen=True, kw_only=True)
class MapConfig(Settings):
    """How measurements are rasterised, and how the map takes them in."""

    bell_ends: float = number(
        12.0, "σ²", "squared Mahalanobis distance at which an impression ends",
        "I = exp(-12 / 2) = 0.0025",
        low=1.0, high=15.0,
    )  # fmt: skip
    bell_steps: int = number(
        512,
        "1/σ²",
        "table entries per unit of squared Mahalanobis distance",
        "1 / (2 * 512) = 0.1 % of I",
        low=1,
        high=1 << 14,
        fixed=True,
    )
    pace_looks: float = number(5.0, "looks", "least prior age of the long-term trace, in looks")
    oldest_paces: float = number(
        13.0, "paces", "age of the trace at which it stiffens no more", low=1e-3
    )
    faded: float = number(0.004, "activity", "a trace below ends if the input is below unseen")
    unseen: float = number(0.01, "input", "input below which a cell is not seen occupied")
    first_look_s: float = number(1.0, "s", "the first frame acts so long: usable at once")
    resumed_look_s: float = number(
        0.2, "s", "the first frame on a loaded map acts so long", low=1e-3
    )
    longest_look_s: float = number(3.0, "s", "longest that one frame acts", low=1e-3)
    known_s: float = number(
        5.0, "s", "of looking after which half of a trace is long known: evidence of where one is",
        low=1e-3,
    )  # fmt: skip
    beside_cells: int = number(
        2, "cells", "a surface displaced by less is no change", low=0, high=64
    )
