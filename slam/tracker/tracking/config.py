# SPDX-License-Identifier: Apache-2.0
"""The numbers of tracking: when a frame is denied, how a lost robot is found, which loops close."""

from __future__ import annotations

from dataclasses import dataclass, field

from slam.settings import Settings, number

MANY = 100_000


@dataclass(frozen=True, kw_only=True)
class QualityConfig(Settings):
    """When a match is denied, and when the robot counts as lost."""

    remembered: int = number(50, "frames", "that say what is usual", low=1, high=MANY)
    lost_after: int = number(3, "frames", "denied in a row: then lost", low=1, high=MANY)
    patience: int = number(
        30, "frames", "denied in a row: then the map is written anew", low=1, high=MANY
    )
    give_up_s: float = number(60.0, "s", "of searching: then the map goes on from odometry")
    worth_searching: float = number(
        0.6, "share", "usual support from which on a lost robot searches its map", high=1.0
    )
    grown_s: float = number(10.0, "s", "of tracking until the map counts as grown")
    grown_scans: int = number(10, "frames", "the same; both must hold", low=0, high=MANY)
    known: float = number(0.5, "share", "of that time: from then on the map may be frozen")
    suspicious: float = number(0.70, "share", "of the usual match: below it the map is asked")
    denied: float = number(0.30, "share", "of the map in view contradicted: the frame is denied")
    still_denied: float = number(0.20, "share", "the same, while the frame before was denied")
    sudden: float = number(0.3, "share", "of the usual match at once, within a small step: carried")
    sudden_m: float = number(0.5, "m", "that step, at most")
    sudden_rad: float = number(0.5, "rad", "that step's turn, at most")


@dataclass(frozen=True, kw_only=True)
class RelocaliseConfig(Settings):
    """Hypotheses of a lost robot, and a robot that was pushed."""

    most: int = number(6, "hypotheses", "from one search of the map", low=1, high=1000)
    again_s: float = number(1.0, "s", "between two searches of the map")
    coarse_m: float = number(0.1, "m", "standard deviation of what that search finds", low=1e-6)
    coarse_deg: float = number(1.5, "deg", "the same of the heading", low=1e-6)
    enough: float = number(0.8, "share", "of the usual support: accepted")
    enough_later: float = number(0.65, "share", "the same, of a hypothesis followed for long")
    later: float = number(3.0, "ratio", "of the least evidence: then it was followed for long")
    hopeless: float = number(0.6, "share", "of the usual, or of the best one's, support: dropped")
    alias: float = number(0.9, "share", "of the best one's support: a rival, so wait")
    scans: int = number(5, "frames", "least evidence, and one of the three below", low=1, high=MANY)
    on_m: float = number(0.3, "m", "driven", low=1e-6)
    on_rad: float = number(0.35, "rad", "turned", low=1e-6)
    on_s: float = number(1.0, "s", "of time", low=1e-6)
    same_m: float = number(0.3, "m", "nearer hypotheses are one")
    same_rad: float = number(0.2, "rad", "and turned by less")
    least_weight: float = number(
        40.0, "weight",
        "in view from which on a frame can deny the map or identify a place: 4 m of surface",
    )  # fmt: skip
    slipped_m: float = number(0.2, "m", "deviation of a motion that odometry missed", low=1e-6)
    slipped_rad: float = number(0.2, "rad", "the same of the heading", low=1e-6)
    pushed_mps: float = number(2.0, "m/s", "speed of that motion, at most")
    pushed_radps: float = number(3.5, "rad/s", "its turn rate, at most")
    farthest_m: float = number(0.6, "m", "that is searched", high=20.0)
    farthest_rad: float = number(0.5, "rad", "the same in heading", high=3.2)
    sure: float = number(0.9, "share", "of the usual support at the place found")


@dataclass(frozen=True, kw_only=True)
class TrackingConfig(Settings):
    """Following the robot, and finding it again."""

    quality: QualityConfig = field(default=QualityConfig())
    relocalise: RelocaliseConfig = field(default=RelocaliseConfig())


@dataclass(frozen=True, kw_only=True)
class LoopsConfig(Settings):
    """Key frames, submaps and loops of long runs."""

    key_m: float = number(1.0, "m", "between key frames, or", low=1e-3)
    key_rad: float = number(0.6, "rad", "between key frames", low=1e-3)
    long_m: float = number(100.0, "m", "way from which on loops are looked for")
    after_m: float = number(15.0, "m", "way between the ends of a loop")
    gate_m: float = number(1.5, "m", "a loop may be this far off,")
    gate_share: float = number(0.02, "m/m", "and so much more by the way,")
    widest_m: float = number(6.0, "m", "and this far at most")
    gate_rad: float = number(0.5, "rad", "and turned by this")
    near_m: float = number(1.0, "m", "beyond the gate at which a submap is still tried")
    most: int = number(4, "places", "looked at for one loop", low=1, high=1000)
    again_m: float = number(3.0, "m", "second look: how far off a passage may be")
    passages: int = number(3, "passages", "second look: at most", low=1, high=1000)
    recent: int = number(6, "key frames", "that a step is measured against", low=1, high=1000)
    slack_m: float = number(0.05, "m", "by which a step may be better than online", low=1e-6)
    slack_rad: float = number(0.01, "rad", "the same of the heading", low=1e-6)
    submap: int = number(4, "key frames", "on either side of a submap's middle", low=1, high=1000)
    every: int = number(4, "key frames", "between two middles", low=1, high=1000)
    look_s: float = number(1.0, "s", "a key frame acts on its submap", low=1e-3)
    good_step: float = number(0.5, "share", "matched: a step is taken from the match")
    good_match: float = number(0.6, "share", "matched: a loop")
    good_support: float = number(0.5, "share", "support: a loop")
    alias: float = number(0.9, "share", "of the best one's support: a rival, so no loop")
    chain_m: float = number(0.02, "m", "deviation of a step beside its match's", low=1e-6)
    chain_rad: float = number(0.0015, "rad", "the same of the heading", low=1e-6)
    loop_m: float = number(0.03, "m", "deviation of a loop beside its match's", low=1e-6)
    loop_rad: float = number(0.003, "rad", "the same of the heading", low=1e-6)
    loose: float = number(1.0, "m², rad²", "prior variance of a loop's match", low=1e-6)
    information_share: float = number(0.3, "share", "of a match's information that is believed")
