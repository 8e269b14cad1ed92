# SPDX-License-Identifier: Apache-2.0
"""The numbers of tracking: when a frame is denied, how a lost robot is found, which loops close."""

from __future__ import annotations

from dataclasses import dataclass, field

from slam.settings import Settings, number, word

MANY = 100_000
SEEDS = "scripts/experiments/verdict.py, training seeds"


@dataclass(frozen=True, kw_only=True)
class QualityConfig(Settings):
    """When a match is denied, and when the robot counts as lost."""

    remembered: int = number(
        50, "frames", "whose median match and support are usual", low=1, high=MANY
    )
    lost_after: int = number(3, "frames", "denied in a row: the robot is lost", low=1, high=MANY)
    patience: int = number(
        30, "frames", "denied in a row: the map is written again", low=1, high=MANY
    )
    give_up_s: float = number(60.0, "s", "of relocalising; then go on from odometry")
    worth_searching: float = number(
        0.35, "share", "least usual support of a map to search in", high=1.0
    )
    grown_s: float = number(10.0, "s", "of tracking: a grown map, with grown_scans")
    grown_scans: int = number(10, "frames", "tracked: a grown map, with grown_s", low=0, high=MANY)
    known: float = number(0.5, "share", "of grown_s: then the map may be frozen")
    suspicious: float = number(0.70, "share", "of the usual match: below, the map is checked")
    denied: float = number(0.30, "share", "of the map in view contradicted: denied")
    still_denied: float = number(0.20, "share", "the same, if the frame before was denied")
    excused: float = number(
        0.5, "share", "of the support of a place found: as much does not deny it at first"
    )
    sudden: float = number(0.3, "share", "of the usual match, after a small step: carried")
    continuous: float = number(
        0.5, "share", "of the usual match with the scans before: less, and it was carried", SEEDS
    )
    outdated_scans: int = number(10, "frames", "least, with outdated_s", SEEDS, low=1, high=MANY)
    outdated_s: float = number(
        2.0, "s", "scans agree with those before: the map is outdated, not the pose", SEEDS
    )
    sudden_m: float = number(0.5, "m", "largest such step")
    sudden_rad: float = number(0.5, "rad", "largest turn of such a step")


@dataclass(frozen=True, kw_only=True)
class RelocaliseConfig(Settings):
    """Hypotheses of a lost robot, and a robot that was pushed."""

    most: int = number(6, "hypotheses", "most from one search of the map", low=1, high=1000)
    again_s: float = number(1.0, "s", "between two searches of the map")
    coarse_m: float = number(0.1, "m", "deviation of a position that it finds", low=1e-6)
    coarse_deg: float = number(1.5, "deg", "deviation of a heading that it finds", low=1e-6)
    enough: float = number(0.8, "share", "of the usual support: accepts a hypothesis")
    enough_later: float = number(0.65, "share", "the same, for one followed for long (later)")
    later: float = number(3.0, "ratio", "of the least evidence: then followed for long")
    enough_last: float = number(
        0.45, "share", "the same, for one alone that was followed for longer still (last)", SEEDS
    )
    last: float = number(5.0, "ratio", "of the least evidence: then for longer still", SEEDS)
    alone: float = number(0.7, "share", "of the best support: no other has more", SEEDS)
    hopeless: float = number(0.4, "share", "of the usual, or the best, support: less is dropped")
    alias: float = number(0.9, "share", "of the best support: another is a rival, wait")
    scans: int = number(5, "frames", "least, with one of on_m, on_rad, on_s", low=1, high=MANY)
    on_m: float = number(0.3, "m", "least distance driven with a hypothesis", low=1e-6)
    on_rad: float = number(0.35, "rad", "least turn made with a hypothesis", low=1e-6)
    on_s: float = number(1.0, "s", "least time passed with a hypothesis", low=1e-6)
    same_m: float = number(0.3, "m", "hypotheses nearer than this are one")
    same_rad: float = number(0.2, "rad", "and turned by less than this")
    drift_m: float = number(2.0, "m", "a robot that was not carried may be off by", SEEDS)
    drift_rad: float = number(0.5, "rad", "and turned by")
    least_weight: float = number(
        40.0, "weight",
        "in view from which on a frame can deny the map or identify a place: 4 m of surface",
    )  # fmt: skip
    least_near: float = number(
        20.0, "weight", "the same around the place of dead reckoning: 2 m of surface", SEEDS
    )
    few_vote: float = number(
        0.3, "vote", "mean vote: below, a place around where all agree is looked for", SEEDS
    )
    slipped_m: float = number(0.2, "m", "deviation of a motion that odometry missed", low=1e-6)
    slipped_rad: float = number(0.2, "rad", "the same of its turn", low=1e-6)
    pushed_mps: float = number(2.0, "m/s", "largest speed of a motion that odometry missed")
    pushed_radps: float = number(3.5, "rad/s", "largest turn rate of a motion that odometry missed")
    farthest_m: float = number(0.6, "m", "farthest that such a motion is searched", high=20.0)
    farthest_rad: float = number(1.0, "rad", "farthest turn that is searched", high=3.2)
    sure: float = number(0.65, "share", "of the usual support at the place then found", SEEDS)
    denied_here: float = number(
        0.5, "share", "of that place's support: most that the place of dead reckoning has", SEEDS
    )


@dataclass(frozen=True, kw_only=True)
class VerdictConfig(Settings):
    """Lost, or the map outdated: see ``tracker.tracking.verdict``."""

    outdated: float = number(
        0.85, "share", "of the usual support: below, the map is outdated here", SEEDS
    )
    even: float = number(0.45, "share", "of the usual support: lost is as likely as not", SEEDS)
    steep: float = number(20.0, "1", "log odds of being lost, by that share", SEEDS)
    agreed: float = number(
        4.0, "ratio", "of corrections over what odometry may be off: more is evidence", SEEDS
    )
    most: float = number(8.0, "1", "log odds, most that those corrections add", SEEDS)
    rival: float = number(
        20.0, "1", "the same, by what a known other place has more of the usual support", SEEDS
    )


@dataclass(frozen=True, kw_only=True)
class TrackingConfig(Settings):
    """Following the robot, and finding it again."""

    quality: QualityConfig = field(default=QualityConfig())
    relocalise: RelocaliseConfig = field(default=RelocaliseConfig())
    verdict: VerdictConfig = field(default=VerdictConfig())


@dataclass(frozen=True, kw_only=True)
class LoopsConfig(Settings):
    """Key frames, submaps and loops of long runs."""

    key_m: float = number(1.0, "m", "between key frames, or key_rad", low=1e-3)
    key_rad: float = number(0.6, "rad", "between key frames, or key_m", low=1e-3)
    long_m: float = number(100.0, "m", "driven before loops are searched")
    after_m: float = number(15.0, "m", "least way between the ends of a loop")
    gate_m: float = number(1.5, "m", "position error at which loops are searched")
    gate_share: float = number(0.02, "m/m", "growth of gate_m with the distance driven")
    widest_m: float = number(6.0, "m", "largest gate_m with that growth")
    gate_rad: float = number(0.5, "rad", "heading error at which loops are searched")
    near_m: float = number(1.0, "m", "a submap this far beyond the gate is tried")
    most: int = number(4, "places", "most that are examined for one loop", low=1, high=1000)
    again_m: float = number(3.0, "m", "second pass: farthest passage that is tied")
    passages: int = number(
        3, "passages", "second pass: most passages tied to a key frame", low=1, high=1000
    )
    recent: int = number(
        6, "key frames", "before it that a step is matched against", low=1, high=1000
    )
    alike_m: float = number(
        0.05, "m", "from the place by the graph to that online: farther, both are tried"
    )
    alike_rad: float = number(0.01, "rad", "the same of the turn")
    slack_m: float = number(0.05, "m", "added deviation of an online step", low=1e-6)
    slack_rad: float = number(0.01, "rad", "added deviation of an online step", low=1e-6)
    submap: int = number(4, "key frames", "on either side of a submap's middle", low=1, high=1000)
    every: int = number(4, "key frames", "between the middles of two submaps", low=1, high=1000)
    look_s: float = number(1.0, "s", "a key frame acts so long on its submap", low=1e-3)
    good_step: float = number(0.5, "share", "least matched share to take a step's match")
    good_match: float = number(0.6, "share", "least matched share of a loop")
    good_support: float = number(0.5, "share", "least support of a loop")
    alias: float = number(0.9, "share", "of the best support: another is a rival, no loop")
    chain_m: float = number(0.02, "m", "added deviation of a step's match", low=1e-6)
    chain_rad: float = number(0.0015, "rad", "added deviation of a step's match", low=1e-6)
    loop_m: float = number(0.03, "m", "added deviation of a loop", low=1e-6)
    loop_rad: float = number(0.003, "rad", "added deviation of a loop", low=1e-6)
    early: float = number(0.5, "share", "of long_m from which on key frames are chained", high=1.0)
    corrects: int = number(1, "1", "1: map and pose follow the graph; 0: past poses alone", high=1)
    work: int = number(
        60, "units", "of work a scan; one: a key frame drawn, a third of a match",
        "docs/loops.md", low=1, high=MANY,
    )  # fmt: skip
    agree_m: float = number(0.3, "m", "a closure farther off needs another that agrees", low=1e-6)
    agree_rad: float = number(0.05, "rad", "a closure farther off needs another that agrees")
    denying: int = number(
        2, "key frames", "at which the map is torn: it is drawn anew", low=1, high=MANY
    )
    datum: str = word(
        "all", ("all", "first"), "what a correction moves least: all key frames, or the first"
    )
    batch: int = number(8, "loops", "found since: the graph is solved again", low=1, high=MANY)
    apply_m: float = number(
        0.1, "m", "between neighbours, map against graph: the map is torn", low=1e-6
    )
    apply_rad: float = number(0.02, "rad", "the same of the turn between them", low=1e-6)
    loose: float = number(1.0, "1/m², 1/rad²", "prior information of a loop's match", low=1e-6)
    information_share: float = number(0.3, "share", "of a match's information, used in the graph")
