# SPDX-License-Identifier: Apache-2.0
"""The numbers of the front end: surfaces, view, odometry prior and odometry bias."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from slam.settings import Settings, number

UMBMARK = "Borenstein and Feng 1996 (UMBmark)"


class Joining(NamedTuple):
    """What ``surfaces.join`` needs of ``SurfaceConfig``."""

    near_m: float
    longest_m: float
    like_steps: float
    slack_m: float
    slack: float


@dataclass(frozen=True, kw_only=True)
class SurfaceConfig(Settings):
    """Which hits lie on one surface, and which way it faces."""

    near_cells: float = number(3.0, "cells", "neighbouring hits this near are of one surface")
    longest_m: float = number(1.0, "m", "longest stretch between two joined hits")
    line_hits: int = number(4, "hits", "on one line: a surface between distant hits", fixed=True)
    like_steps: float = number(4.0, "ratio", "of neighbouring steps along a surface, at most")
    slack_m: float = number(0.04, "m", "a hit may lie this far off its line, along the beam")
    slack: float = number(0.15, "share", "the same by the step: the larger of both holds")
    face_m: float = number(0.1, "m", "a surface's facing is averaged over it, each way")
    opposite_deg: float = number(
        135.0, "deg", "surfaces turned by more than this face away from each other", fixed=True
    )
    mixed_m: float = number(1.5, "m", "surfaces farther apart are ranged apart")

    def joining(self, cell_m: float) -> Joining:
        """For the kernel."""
        return Joining(
            self.near_cells * cell_m, self.longest_m, self.like_steps, self.slack_m, self.slack
        )


@dataclass(frozen=True, kw_only=True)
class ViewConfig(Settings):
    """What a frame sees to be empty."""

    margin_cells: float = number(1.5, "cells", "a cell seen empty is before a beam's end by this")
    gate_cells: float = number(0.6, "cells", "a cell seen empty is this near to a beam, sideways")
    silent_m: float = number(
        30.0,
        "m",
        "a beam without return shows so much free space",
        "data sheet of the LMS-221: range at 10 % reflectivity",
        low=0.1,
    )
    feature_bin_deg: float = number(
        1.0, "deg", "step of the view between point features", low=0.01, high=45.0
    )
    feature_gap_deg: float = number(
        60.0, "deg", "widest gap between features that is seen empty", high=360.0
    )


@dataclass(frozen=True, kw_only=True)
class PriorConfig(Settings):
    """Where the robot should be by odometry, and how sure of that one may be."""

    floor_m: float = number(0.002, "m", "least deviation after floor_s; grows with √time", low=1e-9)
    floor_rad: float = number(
        0.0015, "rad", "least deviation after floor_s; grows with √time", low=1e-9
    )
    floor_s: float = number(0.2, "s", "the floors and least_m, least_rad hold for it", low=1e-3)
    floor_most_s: float = number(1.0, "s", "the floors grow no further", low=1e-3)
    least_scale: float = number(
        2.25, "ratio", "least factor on a stated variance: else the map slips unnoticed"
    )
    least_m: float = number(0.004, "m", "least deviation for the matcher, after floor_s")
    least_rad: float = number(0.003, "rad", "least deviation for the matcher, after floor_s")
    assumed_share: float = number(0.10, "m/m", "deviation by distance, if none stated")
    assumed_turn_m: float = number(0.10, "m/rad", "deviation of position by turn, if none stated")
    assumed_rad_per_sqrt_m: float = number(0.08, "rad/√m", "the same of heading")
    assumed_turn: float = number(0.15, "rad/rad", "deviation of heading by turn, if none stated")
    least_variance: float = number(
        1e-12,
        "m², rad²",
        "added to every increment's variances, so that none is zero",
        "numerical guard: (1 µm)², (1 µrad)²",
        low=1e-18,
    )
    twist_s: float = number(0.5, "s", "longest odometry step that gives a twist")


@dataclass(frozen=True, kw_only=True)
class BiasConfig(Settings):
    """What odometry adds to the heading by itself."""

    per_m: float = number(0.012, "rad/m", "heading bias among robots, 1 σ, by distance", UMBMARK)
    per_rad: float = number(0.03, "rad/rad", "heading bias among robots, 1 σ, by turn", UMBMARK)
    lasts_s: float = number(1000.0, "s", "a robot's bias may change by 1 σ in it", low=1e-3)
    independent: float = number(
        0.3, "share", "of a match's information, from frame to frame", low=1e-6
    )
    data_share: float = number(
        0.5, "share", "least share of the data in a match's heading", low=1e-6, high=1.0
    )
    matched: float = number(0.3, "share", "least matched share of observations", high=1.0)
    outlier: float = number(
        9.0,
        "σ²",
        "squared innovation above which a match is left out: a slip, or a wrong match",
        "3 σ: 99.7 % of a normal variable",
    )
    place_information: float = number(
        1e-3,
        "1/m²",
        "information on the position when it is unknown: 30 m",
        "1 / (30 m)²",
        low=1e-12,
    )


@dataclass(frozen=True, kw_only=True)
class FrontendConfig(Settings):
    """Observations as Gaussians, and what they are made from."""

    sigma_cells: float = number(
        0.8, "cells", "least Gaussian that the lattice carries", "ripple 2 exp(-π²σ²) = 0.4 %",
        low=0.3, high=4.0,
    )  # fmt: skip
    sensor_sigma_m: float = number(
        0.010, "m", "deviation of a range, if the scanner states none", "data sheet of the LMS-221",
        low=1e-6,
    )  # fmt: skip
    spacing_m: float = number(0.1, "m", "beams closer than this share one weight", low=1e-6)
    least_weight: float = number(0.3, "share", "of a full observation, of a near beam", high=1.0)
    surfaces: SurfaceConfig = field(default=SurfaceConfig())
    view: ViewConfig = field(default=ViewConfig())
    prior: PriorConfig = field(default=PriorConfig())
    bias: BiasConfig = field(default=BiasConfig())


FRONTEND = FrontendConfig()
