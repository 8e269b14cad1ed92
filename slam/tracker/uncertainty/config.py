# SPDX-License-Identifier: Apache-2.0
"""The numbers of the pose covariance, its residuals, and the odometry noise."""

from dataclasses import dataclass, field

from slam.settings import Settings, number

SEEDS = "training seeds 0-7 at 4.7 Hz, 0-5 at 37.5 Hz (docs/uncertainty.md)"


@dataclass(frozen=True, kw_only=True)
class PoseConfig(Settings):
    """The errors of the map, of surfaces and of odometry in the pose covariance."""

    lattice_cells: float = number(
        0.055, "cells", "deviation by which the lattice displaces surfaces", SEEDS
    )
    shared_times: float = number(
        2.6, "ratio", "deviation of the pose over that of the shared residual", SEEDS
    )
    new_times: float = number(0.25, "ratio", "pose error that stays in a map all new", SEEDS)
    turn_times: float = number(
        0.7, "ratio", "heading error if surfaces err alike, times this", SEEDS
    )
    shared_s: float = number(20.0, "s", "memory of shared residuals", SEEDS, low=1e-3)
    view_s: float = number(1.0, "s", "memory of directions of surfaces", SEEDS, low=1e-3)
    at_first: float = number(200.0, "pairs", "what usual_m counts as at the start", SEEDS)
    usual_m: float = number(0.002, "m", "usual shared residual of a scanner", SEEDS, low=1e-9)
    room_weight: float = number(75.0, "weight", "surfaces of a whole room, 0.1 m each", SEEDS)
    least_share: float = number(
        0.005, "share", "least share of room_weight in view", SEEDS, low=1e-6
    )
    written: float = number(
        2.4, "ratio", "error of odometry kept by the map, over its new share", SEEDS
    )
    forgotten: float = number(
        1e-6,
        "weight",
        "a sum of weights that faded to less counts as nothing",
        "numerical guard",
        low=1e-15,
    )
    correlated_s: float = number(1.0, "s", "a scan's shared error stays the same so long", SEEDS)
    noisy: float = number(2.0, "ratio", "of what beam noise feigns: less is unobservable", SEEDS)


@dataclass(frozen=True, kw_only=True)
class ResidualConfig(Settings):
    """Pairs of points that measure what surfaces share."""

    apart_cells: float = number(
        3.5, "cells", "between the points of a pair, across the beams", SEEDS
    )
    longest_cells: float = number(35.0, "cells", "between the points of a pair, at most", SEEDS)
    samples: int = number(
        16, "points", "compared with the map in one frame, about", low=1, high=100_000
    )
    faint_overlap: float = number(0.15, "overlap", "least overlap of a point that is compared")
    bent: float = number(0.2, "share", "of a pair's chord: the surface may leave it so far")


@dataclass(frozen=True, kw_only=True)
class OdometryNoiseConfig(Settings):
    """How the stated or assumed covariance of odometry is scaled to explain its corrections."""

    stated: float = number(2.0, "ratio", "first factor on a stated variance: logs are optimistic")
    assumed: float = number(1.0, "ratio", "first factor on an assumed variance")
    least_stated: float = number(0.25, "ratio", "least factor on a stated variance", low=1e-6)
    least_assumed: float = number(0.01, "ratio", "least factor on an assumed variance", low=1e-6)
    most: float = number(100.0, "ratio", "largest factor on either variance", low=1e-3)
    at_first: float = number(20.0, "frames", "frames that the first factor counts as", low=1e-3)
    memory: float = number(
        100.0, "frames", "innovations are averaged over these, or memory_s", low=1e-3
    )
    memory_s: float = number(20.0, "s", "innovations are averaged over it, or memory")
    wild: float = number(16.0, "ratio", "most of a squared innovation over its expectation", "4 σ")


@dataclass(frozen=True, kw_only=True)
class UncertaintyConfig(Settings):
    """How sure the SLAM is."""

    pose: PoseConfig = field(default=PoseConfig())
    residuals: ResidualConfig = field(default=ResidualConfig())
    odometry: OdometryNoiseConfig = field(default=OdometryNoiseConfig())
