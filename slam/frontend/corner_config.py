# SPDX-License-Identifier: Apache-2.0
"""The numbers of the corner extractor."""

from __future__ import annotations

from dataclasses import dataclass

from slam.settings import Settings, number

BREAKPOINT = "adaptive breakpoint, Borges and Aldon 2004"


@dataclass(frozen=True, kw_only=True)
class CornerConfig(Settings):
    """What is a corner."""

    cell_m: float = number(0.04, "m", "edge of a pixel", low=0.005, high=1.0)
    range_m: float = number(12.0, "m", "farther returns are not drawn", low=0.5, high=50.0)
    response: float = number(
        0.25, "share", "least response, of that to a lone thin post", low=1e-3, high=10.0
    )
    noise_m: float = number(0.01, "m", "standard deviation of a range", low=1e-4, high=1.0)
    floor_m: float = number(
        0.015, "m", "least deviation of a feature: round things shift with the point of view",
        low=1e-4, high=1.0,
    )  # fmt: skip
    grazing_deg: float = number(
        10.0, "deg", "flattest view of a surface still taken as one", BREAKPOINT, low=0.1, high=89.0
    )
    flat_deg: float = number(
        12.0, "deg", "flattest view at which the end of a surface is believed", high=89.0
    )
    failed: int = number(
        2, "beams", "in a row that may have failed; with more, nothing is there", low=0
    )
    block: int = number(
        5, "pixels", "over which gradients are summed", "Kanade and Tomasi", low=3, high=15
    )
    ideal: float = number(
        0.14, "response", "to one dot of 1.2 cells", "measured, block of 5", low=1e-3
    )
    min_sigma_cells: float = number(1.2, "cells", "least width of a dot", low=0.3, high=10.0)
    window: int = number(4, "cells", "each way in which the position is refined", low=2, high=8)
    peak_cells: int = number(4, "cells", "two corners are not nearer", low=1, high=32)
    margin_cells: int = number(12, "cells", "round the drawing", low=12, high=64)
    steps: int = number(12, "steps", "of following a corner", low=1, fixed=True)
    cut: float = number(3.5, "σ", "to which a dot is drawn", fixed=True)
    faint: float = number(0.01, "grey", "pixels below say nothing of a line", fixed=True)
