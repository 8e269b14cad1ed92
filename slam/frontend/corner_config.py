# SPDX-License-Identifier: Apache-2.0
"""The numbers of the corner extractor."""

from __future__ import annotations

from dataclasses import dataclass

from slam.settings import Settings, number

BREAKPOINT = "adaptive breakpoint, Borges and Aldon 2004"


@dataclass(frozen=True, kw_only=True)
class CornerConfig(Settings):
    """What is a corner."""

    cell_m: float = number(
        0.04, "m", "edge of a pixel of the image into which a scan is drawn", low=0.005, high=1.0
    )
    range_m: float = number(12.0, "m", "returns beyond are not drawn", low=0.5, high=50.0)
    response: float = number(
        0.25, "share", "least corner response, over that of a lone thin post", low=1e-3, high=10.0
    )
    noise_m: float = number(0.01, "m", "deviation of a range", low=1e-4, high=1.0)
    floor_m: float = number(
        0.015, "m", "least deviation: round things shift with the viewpoint",
        low=1e-4, high=1.0,
    )  # fmt: skip
    grazing_deg: float = number(
        10.0,
        "deg",
        "flattest angle of view at which hits count as one surface",
        BREAKPOINT,
        low=0.1,
        high=89.0,
    )
    flat_deg: float = number(
        12.0, "deg", "flattest angle of view at which the end of a surface is a corner", high=89.0
    )
    failed: int = number(2, "beams", "beams in a row that may have failed inside a surface", low=0)
    block: int = number(
        5,
        "pixels",
        "edge of the window over which gradients are summed",
        "Kanade and Tomasi",
        low=3,
        high=15,
    )
    ideal: float = number(
        0.14,
        "response",
        "corner response to one dot of 1.2 cells",
        "measured, block of 5",
        low=1e-3,
    )
    min_sigma_cells: float = number(1.2, "cells", "least width of a drawn dot", low=0.3, high=10.0)
    window: int = number(
        4, "cells", "half width of the window that refines a corner", low=2, high=8
    )
    peak_cells: int = number(4, "cells", "least distance between two corners", low=1, high=32)
    margin_cells: int = number(12, "cells", "empty margin round the drawn scan", low=12, high=64)
    steps: int = number(12, "steps", "most steps that refine a corner", low=1, fixed=True)
    cut: float = number(3.5, "σ", "distance at which a drawn dot ends", fixed=True)
    faint: float = number(0.01, "grey", "pixels below say nothing of a line", fixed=True)
