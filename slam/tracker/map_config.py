# SPDX-License-Identifier: Apache-2.0
"""The numbers of the map that no preset turns; decay and trace: ``slam.tracker.config``."""

from __future__ import annotations

from dataclasses import dataclass

from slam.settings import Settings, number


@dataclass(frozen=True, kw_only=True)
class MapConfig(Settings):
    """How measurements are rasterised, and how the map takes them in."""

    bell_ends: float = number(
        12.0, "σ²", "squared Mahalanobis distance of I = 0.0025, where an impression ends",
        low=1.0, high=15.0,
    )  # fmt: skip
    bell_steps: int = number(
        512, "1/σ²", "entries of the table of bells: 0.1 % of I", low=1, high=1 << 14, fixed=True
    )
    pace_looks: float = number(5.0, "looks", "the trace is never quicker than so many")
    oldest_paces: float = number(
        13.0, "paces", "age of the trace at which it stops growing stiffer", low=1e-3
    )
    faded: float = number(0.004, "activity", "a trace below this ends where nothing is seen")
    unseen: float = number(0.01, "input", "below this nothing is seen")
    first_look_s: float = number(1.0, "s", "the first frame acts this long: usable at once")
    resumed_look_s: float = number(0.2, "s", "the first frame with a loaded map", low=1e-3)
    longest_look_s: float = number(3.0, "s", "however long ago the frame before was", low=1e-3)
    beside_cells: int = number(
        2, "cells", "a wall seen this far aside is no change", low=0, high=64
    )
