# SPDX-License-Identifier: Apache-2.0
"""The numbers of the pose covariance, its residuals, and the odometry noise."""

from __future__ import annotations

from dataclasses import dataclass, field

from slam.settings import Settings, number

SEEDS = "training seeds 0-7 at 4.7 Hz, 0-5 at 37.5 Hz (docs/uncertainty.md)"


@dataclass(frozen=True, kw_only=True)
class PoseConfig(Settings):
    """The errors of the map, of surfaces and of odometry in the pose covariance."""

    lattice_cells: float = number(
        0.055, "cells", "surfaces are off by, without any shared residual, 1 σ", SEEDS
    )
    shared_times: float = number(2.6, "ratio", "pose error over the shared residual", SEEDS)
    new_times: float = number(0.25, "ratio", "share of it that stays in a map all new", SEEDS)
    turn_times: float = number(
        0.7, "ratio", "share of it that turns: surfaces do not all err the same way", SEEDS
    )
    shared_s: float = number(20.0, "s", "over which shared residuals are averaged", SEEDS, low=1e-3)
    view_s: float = number(1.0, "s", "over which directions of surfaces are", SEEDS, low=1e-3)
    at_first: float = number(200.0, "pairs", "that the usual residual counts as", SEEDS)
    usual_m: float = number(0.002, "m", "residual of the scanner, usually", SEEDS, low=1e-9)
    room_weight: float = number(
        75.0, "weight", "of surfaces in view for which these hold: a room; 0.1 m a beam", SEEDS
    )
    least_share: float = number(0.005, "share", "of it that is reckoned with", SEEDS, low=1e-6)
    written: float = number(
        2.4, "ratio", "error of odometry that the map keeps, over the share newly written", SEEDS
    )
    forgotten: float = number(1e-6, "weight", "a sum that faded to less holds nothing", low=1e-15)
    correlated_s: float = number(1.0, "s", "the shared error of a scan stays the same", SEEDS)
    noisy: float = number(
        2.0, "ratio", "of the noise of beams: less information along an axis is none", SEEDS
    )


@dataclass(frozen=True, kw_only=True)
class ResidualConfig(Settings):
    """Pairs of points that measure what surfaces share."""

    apart_cells: float = number(3.5, "cells", "between the two of a pair, across the beams", SEEDS)
    longest_cells: float = number(35.0, "cells", "between the two, at most", SEEDS)
    samples: int = number(16, "points", "looked at in one frame", low=1, high=100_000)
    faint_overlap: float = number(0.15, "overlap", "a point with less is off the map")
    bent: float = number(0.2, "share", "of a chord by which a surface may leave it")


@dataclass(frozen=True, kw_only=True)
class OdometryNoiseConfig(Settings):
    """How the stated or assumed covariance of odometry is scaled to explain its corrections."""

    stated: float = number(2.0, "ratio", "of a stated variance at first: they are optimistic")
    assumed: float = number(1.0, "ratio", "of an assumed variance at first")
    least_stated: float = number(0.25, "ratio", "of a stated variance", low=1e-6)
    least_assumed: float = number(0.01, "ratio", "of an assumed variance", low=1e-6)
    most: float = number(100.0, "ratio", "of either", low=1e-3)
    at_first: float = number(20.0, "frames", "that the first ratio counts as", low=1e-3)
    memory: float = number(100.0, "frames", "that are averaged, or", low=1e-3)
    memory_s: float = number(20.0, "s", "that are, if longer")
    wild: float = number(16.0, "ratio", "a squared innovation over its expectation, at most")


@dataclass(frozen=True, kw_only=True)
class UncertaintyConfig(Settings):
    """How sure the SLAM is."""

    pose: PoseConfig = field(default=PoseConfig())
    residuals: ResidualConfig = field(default=ResidualConfig())
    odometry: OdometryNoiseConfig = field(default=OdometryNoiseConfig())
