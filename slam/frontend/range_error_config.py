# SPDX-License-Identifier: Apache-2.0
"""The numbers of the scanner's systematic error that is learnt while driving."""

from __future__ import annotations

from dataclasses import dataclass

from slam.settings import Settings, number, word

SHEETS = "data sheets: typical systematic errors of 15 to 50 mm"


@dataclass(frozen=True, kw_only=True)
class RangeErrorConfig(Settings):
    """A smooth function of range and one of incidence, learnt from surfaces seen twice."""

    learn: str = word(
        "off", ("off", "on"), "learn the scanner's systematic error and take it off the ranges"
    )
    knot_m: float = number(0.75, "m", "between the knots of the function of range", low=0.05)
    range_m: float = number(15.0, "m", "last knot; constant beyond", low=1.0, high=200.0)
    sigma_m: float = number(0.02, "m", "of the function of range before any scan", SHEETS, low=1e-5)
    length_m: float = number(2.0, "m", "over which the function of range changes", low=0.05)
    sigma_tan2_m: float = number(
        0.002, "m", "of the error per squared tangent of the incidence before any scan", low=1e-7
    )
    most_tan2: float = number(
        9.0, "1", "squared tangent of the incidence beyond which its term grows no further: 72°"
    )
    pinned_m: float = number(
        1e-5, "m", "deviation of what is unobservable: none", "numerical guard", low=1e-7
    )
    steepest_deg: float = number(
        72.0, "deg", "incidence beyond which nothing is learnt", high=85.0, low=10.0
    )
    width_m: float = number(0.3, "m", "length of surface to which a line is fitted", low=0.02)
    flat_sigmas: float = number(2.5, "σ", "most deviation from that line, of the ranges' own")
    step_m: float = number(0.25, "m", "drive between two scans learnt from", low=0.01)
    step_rad: float = number(0.35, "rad", "or turn", low=0.01)
    fastest_radps: float = number(0.6, "rad/s", "turning faster, a scan is not learnt from")
    views: int = number(24, "scans", "kept to compare with", low=1, high=1000)
    pairs: int = number(4, "scans", "of them compared with a new one", low=1, high=100)
    gate_m: float = number(0.12, "m", "most distance between two sights of a surface", low=1e-3)
    outlier_sigmas: float = number(3.0, "σ", "a distance counts half from here on", low=0.1)
    independent: float = number(
        0.1, "share", "of the information of a comparison: its errors are shared", low=1e-4,
        high=1.0,
    )  # fmt: skip
    position_m: float = number(0.1, "m", "prior of the pose between two scans, 1 σ", low=1e-4)
    heading_rad: float = number(0.05, "rad", "the same of the heading", low=1e-5)
    evidence: float = number(
        5.0, "nat", "log of the odds for an error, from which on it is taken off", high=1e3
    )
    redraw_by_m: float = number(
        0.002, "m", "change of the error, r.m.s., for which the map is drawn again", low=1e-5
    )
    redraw_m: float = number(
        45.0, "m", "driven, up to which that is done; longer runs have loops", high=1e5
    )
    redrawn_keys: int = number(2, "key frames", "drawn with each scan", low=1, high=1000)
    drift_m: float = number(0.03, "m", "prior of a key frame from the one before, 1 σ", low=1e-4)
    drift_rad: float = number(0.02, "rad", "the same of its heading", low=1e-5)
    lasts_s: float = number(1200.0, "s", "memory: a scanner warms up", low=1.0)
