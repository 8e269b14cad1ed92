# SPDX-License-Identifier: Apache-2.0
"""The numbers of the belief: what a scan says, and how a robot that is lost is searched."""

from dataclasses import dataclass

from slam.settings import Settings, number

TRACES = "by hand, on traces of Freiburg 079 and of robots carried in the plane"


@dataclass(frozen=True, kw_only=True)
class BeliefConfig(Settings):
    """What a scan says of where the robot is, in nats: docs/belief.md."""

    slope: float = number(
        3.3, "nats", "a: of a share s of the returns that are explained, a logit(s)"
    )
    known: float = number(
        0.0, "nats", "b: added for where motion led, s being the share of the second before",
        low=-100.0,
    )  # fmt: skip
    new: float = number(2.0, "nats", "less than that for a place that is found")
    best: float = number(
        1.6, "nats", "less for one found in the whole map: the best of all is better than any one"
    )
    slips: float = number(
        0.01, "probability", "of a slip that odometry does not know, in one scan", low=1e-9,
        high=0.5,
    )  # fmt: skip
    hidden: float = number(
        8.0, "nats/m", "most against where motion led, by the long-known surface that a scan sees "
        "through: what is hidden denies nothing",
    )  # fmt: skip
    hidden_m: float = number(0.3, "m", "of it that means nothing", TRACES)
    more_m: float = number(
        1.2, "m", "of long-known surface that a place taken explains more than where motion led",
        TRACES,
    )  # fmt: skip
    far_m: float = number(3.0, "m", "the same of one far away", TRACES)
    again: int = number(
        4, "scans", "that are asked of a place far away before it is taken", low=1, high=1000
    )
    frozen_above: float = number(
        0.01, "probability", "that the pose is wrong: above, the map is not written", low=1e-9,
        high=0.05,
    )  # fmt: skip
    hopeless: float = number(20.0, "nats", "below the best: a place is followed no more")


@dataclass(frozen=True, kw_only=True)
class RelocaliseConfig(Settings):
    """Searches for places where a robot may be, and how they are followed."""

    most: int = number(6, "places", "most that are followed", low=1, high=1000)
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
    goes_on: float = number(
        0.7, "share", "of what returns matched in the second before: below, a slip is searched"
    )
    near_m: float = number(0.6, "m", "farthest that a slip is searched", high=20.0)
    near_rad: float = number(0.6, "rad", "farthest turn that is searched", low=1e-3, high=3.2)
    near_rad_s: float = number(2.0, "rad/s", "the same by the time since the scan before")
    near_points: int = number(60, "points", "about so many are searched with", low=1, high=100_000)
    again_near_s: float = number(0.3, "s", "between two such searches")
