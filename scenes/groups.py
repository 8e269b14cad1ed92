# SPDX-License-Identifier: Apache-2.0
"""Movers by group: those of a crowd that belong together, and all chairs, people, doors.

A mover of a crowd is called after its part in it and a number, ``escort3``, ``board_pusher0``;
the words of ``scenes.crowd`` name all of a kind: ``escorts``, ``boards`` with those who push them.
"""

import re
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from slam.errors import UnknownNameError

if TYPE_CHECKING:  # it loads MuJoCo, and words are checked before that
    from scenes.scene import Hold, Mover

_CROWD = {
    "escort": "escorts", "stream": "streams", "group": "groups", "queue": "queue",
    "board": "boards", "board_pusher": "boards", "bed": "beds", "bed_pusher": "beds",
    "wagon": "trains", "train_puller": "trains", "couch": "couches", "carrier": "couches",
    "cleaner": "cleaners",
}  # fmt: skip
CROWDS = tuple(dict.fromkeys(_CROWD.values()))
_ROOM = {
    "chair": "chairs", "bin": "bins", "load": "loads", "person": "people", "door": "doors",
    "robot": "robot",
}  # fmt: skip


def group_of(mover: "Mover") -> str:
    """The word for those it belongs to; "robot" for the robot."""
    part = re.sub(r"\d+$", "", mover.name)
    return _CROWD.get(part, _ROOM[mover.group])


def groups_of(movers: "Iterable[Mover]") -> dict[str, tuple[str, ...]]:
    """Names by group, in the order of the movers; without the robot."""
    found: dict[str, list[str]] = {}
    for mover in movers:
        if mover.group != "robot":
            found.setdefault(group_of(mover), []).append(mover.name)
    return {group: tuple(names) for group, names in found.items()}


def named(movers: "Sequence[Mover]", word: str) -> tuple[str, ...]:
    """Who is meant: a mover's name, a group or a pattern of names, ``group[0-3]``, ``escort*``.

    Raises ``UnknownNameError`` where it is nobody.
    """
    names = [mover.name for mover in movers if mover.group != "robot"]
    groups = groups_of(movers)
    if word in names:
        return (word,)
    found = groups.get(word) or tuple(name for name in names if fnmatchcase(name, word))
    if not found:
        raise UnknownNameError(
            f"no mover and no group is called '{word}'. Groups: {', '.join(groups)}. "
            f"Movers: {', '.join(names)}."
        )
    return found


def with_held(holds: "Sequence[Hold]", names: Sequence[str]) -> tuple[str, ...]:
    """These, and whatever they hold, and what that draws after it."""
    found = list(names)
    for name in found:  # grows while it is gone through
        found += [h.held for h in holds if h.holder == name and h.held not in found]
    return tuple(found)
