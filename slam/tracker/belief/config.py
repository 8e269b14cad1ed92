# SPDX-License-Identifier: Apache-2.0
"""The numbers of the belief: what evidence weighs, and how often a robot is carried or slips."""

from dataclasses import dataclass

from slam.settings import Settings, number

FITTED = "scripts.integrity.fit (docs/belief.md)"
LENIENT = 10.0  # times frozen_above, where more is asked or no more can be told; set by hand
READ_OFF = "quantiles at right poses and after kidnaps, scripts.integrity.fit"


@dataclass(frozen=True, kw_only=True)
class BeliefConfig(Settings):
    """Evidence in nats, priors as rates: docs/belief.md."""

    confirmed: float = number(
        3.6, "nats", "a: of long-known surface C that scans confirm from a place, a log(1 + C / c)",
        FITTED,
    )  # fmt: skip
    confirmed_m: float = number(0.47, "m", "c: less than it may be confirmed by chance", FITTED,
        low=1e-3)  # fmt: skip
    linear_m: float = number(
        6.0, "m", "of surface from which on it counts a metre alike: more than one view shows"
    )
    through: float = number(
        4.9, "nats", "b: of long-known surface D m that they see through, - b sqrt(D)", FITTED,
        low=1e-3,
    )  # fmt: skip
    outdated: float = number(
        5.0,
        "nats",
        "that it costs where the room has changed: the map is outdated here; a start in a known "
        "map pays it anyhow",
    )
    broken: float = number(
        8.5, "nats", "that it costs if hardly a return goes on from the scans before", low=1e-3
    )
    goes_on: float = number(
        0.5, "share", "of what all returns matched in the second before: a scan goes on", READ_OFF
    )
    breaks: float = number(
        0.3, "share", "the same: with so little it does not, and costs all of broken", READ_OFF
    )
    vanished: float = number(
        0.1, "share", "of what the scan before confirmed, seen through: costs all of broken",
        low=1e-6,
    )  # fmt: skip
    pulled_m: float = number(0.2, "m", "by which movers pull a match, unlike a slip", low=1e-6)
    pulled_rad: float = number(0.1, "rad", "the same of its turn", low=1e-6)
    nearby_per_m: float = number(
        7.9, "nats/m", "of trace that a scan confirms more from a place nearby than from where "
        "motion led", FITTED,
    )  # fmt: skip
    place: float = number(
        5.9, "nats", "a place found must explain: the best of all is better than any one", FITTED
    )
    searched: float = number(
        0.8, "nats/m", "of long-known surface that the best place confirms, up to linear_m, after "
        "a search: what shows so much is found where it is", FITTED,
    )  # fmt: skip
    unsearched: float = number(
        8.0, "nats", "that a place explains which a search not done may still find, after a break",
    )  # fmt: skip
    alike: float = number(
        8.0, "nats", "that it costs where motion led to look like a known place elsewhere: it may "
        "be new to the map",
    )  # fmt: skip
    slips_per_m: float = number(
        3e-4,
        "1/m",
        "how often a robot slips or is pushed, unknown to odometry",
        low=1e-300,
        high=1.0,
    )
    slip_m: float = number(0.25, "m", "deviation of such a slip", low=1e-6)
    slip_rad: float = number(0.2, "rad", "the same of its turn", low=1e-6)
    frozen_above: float = number(
        0.01, "probability", "that the pose is wrong: above, the map is not written", low=1e-9,
        high=0.05,
    )  # fmt: skip
    hopeless: float = number(20.0, "nats", "below the best: a place is followed no more")


@dataclass(frozen=True, kw_only=True)
class RelocaliseConfig(Settings):
    """Searches for places where a robot may be, and how they are followed."""

    most: int = number(6, "places", "most that are followed", low=1, high=1000)
    kept: int = number(6, "scans", "kept for places that are found later", low=1, high=1000)
    again_s: float = number(1.0, "s", "between two searches of the map")
    coarse_m: float = number(0.1, "m", "deviation of a position that it finds", low=1e-6)
    coarse_deg: float = number(1.5, "deg", "deviation of a heading that it finds", low=1e-6)
    same_m: float = number(0.3, "m", "places nearer than this are one")
    same_rad: float = number(0.2, "rad", "and turned by less than this")
    least_weight: float = number(
        40.0, "weight", "in view from which on a scan corrects odometry: 4 m of surface"
    )
    least_near: float = number(
        20.0, "weight", "in view from which on a slip is searched: 2 m of surface"
    )
    near_m: float = number(
        0.6, "m", "farthest that a slip is searched; after long doubt up to 1.5 m", high=20.0
    )
    near_rad: float = number(0.6, "rad", "farthest turn that is searched", low=1e-3, high=3.2)
    near_points: int = number(60, "points", "about so many are searched with", low=1, high=100_000)
    again_near_s: float = number(0.3, "s", "between two such searches")
