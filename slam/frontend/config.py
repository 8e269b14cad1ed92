# SPDX-License-Identifier: Apache-2.0
"""The numbers of the front end: surfaces, view, odometry prior and odometry bias."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from slam.settings import Settings, number

UMBMARK = "Borenstein and Feng 1996 (UMBmark)"
SEEDS = "training seeds, docs/uncertainty.md"


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

    near_cells: float = number(3.0, "cells", "hits of neighbouring beams this near are joined")
    longest_m: float = number(1.0, "m", "longest stretch between two joined hits")
    line_hits: int = number(4, "hits", "evidence for a surface between distant hits", fixed=True)
    like_steps: float = number(4.0, "ratio", "of neighbouring steps along a surface, at most")
    slack_m: float = number(0.04, "m", "a hit may lie this far off its line, along the beam")
    slack: float = number(0.15, "share", "of a step, the same: the larger of both holds")
    face_m: float = number(0.1, "m", "stretch to either side that tells the way a surface faces")
    opposite_deg: float = number(
        135.0, "deg", "surfaces turned by more face away from each other", fixed=True
    )
    mixed_m: float = number(1.5, "m", "the receiver distinguishes surfaces farther apart than this")

    def joining(self, cell_m: float) -> Joining:
        """For the kernel."""
        return Joining(
            self.near_cells * cell_m, self.longest_m, self.like_steps, self.slack_m, self.slack
        )


@dataclass(frozen=True, kw_only=True)
class ViewConfig(Settings):
    """What a frame sees to be empty."""

    margin_cells: float = number(1.5, "cells", "a neuron seen empty is nearer than the beam's end")
    gate_cells: float = number(0.6, "cells", "and at most this far beside the beam")
    silent_m: float = number(
        30.0, "m", "a beam without return says nothing beyond: black or slanted surfaces", low=0.1
    )
    feature_bin_deg: float = number(1.0, "deg", "bins between point features", low=0.01, high=45.0)
    feature_gap_deg: float = number(
        60.0, "deg", "between features no wider apart nothing else was there", high=360.0
    )


@dataclass(frozen=True, kw_only=True)
class PriorConfig(Settings):
    """Where the robot should be by odometry, and how sure of that one may be."""

    floor_m: float = number(0.002, "m", "least standard deviation, per sqrt(floor_s)", low=1e-9)
    floor_rad: float = number(0.0015, "rad", "the same of the heading", low=1e-9)
    floor_s: float = number(0.2, "s", "time for which these floors hold", low=1e-3)
    floor_most_s: float = number(1.0, "s", "and beyond which they stay", low=1e-3)
    least_scale: float = number(
        2.25, "ratio", "of a stated variance: tighter, the map slips unnoticed"
    )
    least_m: float = number(0.004, "m", "least standard deviation the matcher is given")
    least_rad: float = number(0.003, "rad", "the same of the heading")
    assumed_share: float = number(
        0.10, "m/m", "without a stated covariance, a worn robot: deviation by the way"
    )
    assumed_turn_m: float = number(0.10, "m/rad", "deviation of the position by the turn")
    assumed_rad_per_sqrt_m: float = number(0.08, "rad/√m", "deviation of the heading by the way")
    assumed_turn: float = number(0.15, "rad/rad", "deviation of the heading by the turn")
    least_variance: float = number(1e-12, "m², rad²", "added to every increment's", low=1e-18)
    twist_s: float = number(0.5, "s", "odometry steps up to this long give a twist")


@dataclass(frozen=True, kw_only=True)
class BiasConfig(Settings):
    """What odometry adds to the heading by itself."""

    per_m: float = number(0.012, "rad/m", "standard deviation among robots, by the way", UMBMARK)
    per_rad: float = number(0.03, "rad/rad", "the same by the turn", UMBMARK)
    lasts_s: float = number(1000.0, "s", "time in which a robot may become another one", low=1e-3)
    independent: float = number(
        0.3, "share", "of a match's information that is, from frame to frame", low=1e-6
    )
    data_share: float = number(
        0.5, "share", "least part of the data in a match's heading", low=1e-6, high=1.0
    )
    matched: float = number(0.3, "share", "of the observations matched, at least", high=1.0)
    outlier: float = number(9.0, "σ²", "a wheel that slipped, or a wrong match")
    place_information: float = number(1e-3, "1/m²", "of a place unknown by 30 m", low=1e-12)


@dataclass(frozen=True, kw_only=True)
class FrontendConfig(Settings):
    """Observations as Gaussians, and what they are made from."""

    sigma_cells: float = number(
        0.8, "cells", "least Gaussian the lattice carries without ripple", "2 exp(-π²σ²) = 0.4 %",
        low=0.3, high=4.0,
    )  # fmt: skip
    sensor_sigma_m: float = number(
        0.010, "m", "sigma of a range, if the scanner states none", "data sheet of the LMS-221",
        low=1e-6,
    )  # fmt: skip
    spacing_m: float = number(
        0.1, "m", "beams closer than this share one observation's weight", low=1e-6
    )
    least_weight: float = number(0.3, "share", "of a full observation, of a near beam", high=1.0)
    surfaces: SurfaceConfig = field(default=SurfaceConfig())
    view: ViewConfig = field(default=ViewConfig())
    prior: PriorConfig = field(default=PriorConfig())
    bias: BiasConfig = field(default=BiasConfig())


FRONTEND = FrontendConfig()
