# SPDX-License-Identifier: Apache-2.0
"""Crowds: people who agree with each other, and what they push, pull and carry, for any scene.

``scenes.build(name, seed, crowd="escorts:6,boards:2")`` puts them on the free floor of the finished
scene (``scenes.crowd_kinds``). Here is how many of each kind there are: as a text says, or as is
usual for a scene at a level of motion.
"""

import math
from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np
from msgspec import Meta

from slam.errors import InvalidValueError
from slam.shaped import check

MOST = 80  # of each kind
Number = Annotated[int, Meta(ge=0, le=MOST)]
GROUP = 4  # people in one


@dataclass(frozen=True, kw_only=True)
class Crowd:
    """How many of each kind.

    escorts   people who accompany the robot, and stop when it stops
    streams   people who walk to and fro between the far ends of the scene
    groups    people who walk in groups of four, stop and talk
    queue     people who stand in line; now and then the first one leaves and joins at the end
    boards    partitions on castors, each pushed about by somebody
    beds      hospital beds, each pushed by somebody
    trains    trains of two trolleys, each pulled by somebody
    couches   each carried by two people
    cleaners  people who put chairs in a tight row at a wall, and later bring them back; chairs are
              rolled, not lifted on each other
    """

    escorts: Number = 0
    streams: Number = 0
    groups: Number = 0
    queue: Number = 0
    boards: Number = 0
    beds: Number = 0
    trains: Number = 0
    couches: Number = 0
    cleaners: Number = 0

    def __post_init__(self) -> None:
        check(self)

    def __str__(self) -> str:
        named = [f"{f.name}:{getattr(self, f.name)}" for f in fields(self) if getattr(self, f.name)]
        return ",".join(named) or "none"

    def __bool__(self) -> bool:
        return str(self) != "none"


def crowd_of(text: object) -> Crowd:
    """``"escorts:6,boards:2"`` or ``"none"``; ``InvalidValueError`` for anything else."""
    if isinstance(text, Crowd):
        return text
    known = [f.name for f in fields(Crowd)]
    wanted = f'"none" or like "escorts:6,boards:2" with {", ".join(known)}'
    if not isinstance(text, str):
        raise InvalidValueError(f"crowd must be {wanted}, got {text!r:.80}")
    counts: dict[str, int] = {}
    for word in text.split(",") if text not in ("none", "") else ():
        name, _, number = word.strip().partition(":")
        if name not in known or name in counts or not number.isdecimal() or len(number) > 4:
            raise InvalidValueError(f"crowd must be {wanted}, got {text!r:.80}")
        counts[name] = int(number)
    return Crowd(**counts)


LEVELS = (0.25, 0.5, 0.75, 1.0)
"""Of motion, at which the crowds below are calibrated."""


def _mixes(**counts: tuple[int, int, int, int]) -> tuple[Crowd, ...]:
    """A crowd for each of ``LEVELS``, from the numbers of each kind at these."""
    return tuple(
        Crowd(**dict(zip(counts, each, strict=True))) for each in zip(*counts.values(), strict=True)
    )


BY_LEVEL = {
    "apartment": _mixes(escorts=(1, 2, 4, 6)),
    "arena": _mixes(escorts=(2, 4, 7, 14), boards=(0, 0, 1, 2)),
    "classroom": _mixes(escorts=(1, 1, 3, 9), groups=(0, 0, 0, 4)),
    "corridor": _mixes(escorts=(1, 2, 3, 7), streams=(0, 0, 2, 4)),
    "gallery": _mixes(escorts=(1, 3, 6, 14), groups=(4, 4, 8, 12), boards=(0, 0, 1, 2)),
    "office": _mixes(
        escorts=(1, 3, 6, 12), streams=(0, 2, 2, 2), groups=(0, 0, 0, 4), cleaners=(0, 0, 0, 1)
    ),
    "random-rooms": _mixes(escorts=(1, 3, 5, 8)),
    "station": _mixes(
        escorts=(1, 3, 8, 14), streams=(2, 9, 20, 36), queue=(0, 2, 3, 6), trains=(0, 0, 1, 2)
    ),
    "warehouse": _mixes(escorts=(1, 2, 4, 9), streams=(0, 0, 2, 6), trains=(0, 0, 1, 2)),
}
"""The crowds of each scene at ``LEVELS``: so many that the share of returns from what moves grows
about in a line with the motion (column ``moving_share_of_returns`` of a comparison)."""
OTHERS_BY_LEVEL = _mixes(escorts=(1, 3, 5, 10))
"""Those of a scene that has no row."""


def mix(scene: str, level: float) -> Crowd:
    """The crowd of a scene at a motion in [0, 1]; of each kind a whole number.

    People in groups are whole groups, and nobody queues alone.
    """
    mixes = (Crowd(), *BY_LEVEL.get(scene, OTHERS_BY_LEVEL))
    counts = {}
    for each in fields(Crowd):
        own = [getattr(crowd, each.name) for crowd in mixes]
        step = GROUP if each.name == "groups" else 1
        n = float(np.interp(level, (0.0, *LEVELS), own))
        counts[each.name] = step * math.floor(n / step + 0.5)
    if counts["queue"] == 1:
        counts["queue"] = 0
    return Crowd(**counts)
