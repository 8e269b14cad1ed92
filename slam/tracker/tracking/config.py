# SPDX-License-Identifier: Apache-2.0
"""The numbers of tracking: how a lost robot is searched, which loops close."""

from dataclasses import dataclass, field

from slam.settings import Settings, number, word
from slam.tracker.belief.config import RelocaliseConfig

MANY = 100_000


@dataclass(frozen=True, kw_only=True)
class TrackingConfig(Settings):
    """Following the robot, and finding it again."""

    give_up_s: float = number(
        60.0,
        "s",
        "of doubt: from then on 90 % are enough for who has left the map, and a session "
        "in a known map lies apart; of belief: then no other place is followed",
    )
    relocalise: RelocaliseConfig = field(default=RelocaliseConfig())


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
    again_m: float = number(3.0, "m", "second pass: farthest revisit constrained")
    passages: int = number(
        3, "passages", "second pass: most revisits constrained to a key frame", low=1, high=1000
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
    alias: float = number(0.9, "share", "of the best support: where another place has it, no loop")
    chain_m: float = number(0.02, "m", "added deviation of a step's match", low=1e-6)
    chain_rad: float = number(0.0015, "rad", "added deviation of a step's match", low=1e-6)
    loop_m: float = number(0.03, "m", "added deviation of a loop", low=1e-6)
    loop_rad: float = number(0.003, "rad", "added deviation of a loop", low=1e-6)
    early: float = number(0.5, "share", "of long_m from which on key frames are chained", high=1.0)
    corrects: int = number(1, "1", "1: map and pose follow the graph; 0: past poses alone", high=1)
    work: int = number(
        64, "units", "of work a scan; one: a key frame drawn, 0.2 ms of an EPYC core",
        "docs/loops.md", low=1, high=MANY,
    )  # fmt: skip
    agree_m: float = number(0.3, "m", "a closure farther off needs another that agrees", low=1e-6)
    agree_rad: float = number(0.05, "rad", "a closure farther off needs another that agrees")
    denying: int = number(
        2, "key frames", "found torn: from so many on the map is drawn again", low=1, high=MANY
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
