# SPDX-License-Identifier: Apache-2.0
"""The version of the world: when one seed comes to give another world, the number goes up.

A world is all that a seed gives: the layout, what moves when, the scans and the wheels' ticks.
Environment ids end in the number (``mobilia/Office-v2``), recipes hold it as ``world``; a recipe
without was written before that, by world ``UNSAID``. What was made in another version cannot be
made again in this one: that is refused with a ``WorldVersionError``, never silently other.

To change the world: raise ``WORLD``, say in ``CHANGES`` what became of the old one, and give
``tests/sim/core/test_versions.py`` the new digest.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from slam.errors import LogFormatError, MobiliaError

WORLD = 2
UNSAID = 1
CHANGES: Mapping[int, str] = {
    0: (
        "v0 was the world before the table of dynamism was set again: the same seed gives another "
        "one now. At dynamism d of v0 chairs, bins and loads were pushed as at d / 3 now, doors "
        "moved as at d / 2, and people stayed as long as at 3 d / (1 + 2 d)"
    ),
    1: (
        "v1 had no crowds and no change out of sight: dynamism d of v1 is "
        "Dynamism.world_1(d) of now (--dynamism d --crowd none --change 0)"
    ),
    2: "v2 has two axes, motion and change, and crowds that are calibrated for each scene",
}


class WorldVersionError(MobiliaError):
    """Something is of another version of the world than this one."""


def not_this_world(version: int) -> str:
    """Why a world of that version cannot be made here, in words; empty for the one of here."""
    if version == WORLD:
        return ""
    if version > WORLD:
        return f"it is of world version {version}, this mobilia has {WORLD}: a newer one made it"
    changes = "; ".join(CHANGES[k] for k in range(version, WORLD) if k in CHANGES)
    return f"it is of world version {version}, this mobilia has {WORLD}: {changes}"


def world_of(path: Path, recipe: Mapping[str, Any]) -> int:
    """The version that the recipe in the file ``path`` holds; ``LogFormatError`` for no number."""
    version = recipe.get("world", UNSAID)
    if isinstance(version, bool) or not isinstance(version, int) or not 0 <= version < 2**31:
        raise LogFormatError(path, f"world must be a whole number >= 0, got {version!r:.40}")
    return version


def check_world(path: Path | str, version: int) -> None:
    """Raise ``WorldVersionError`` that names the file, or what else it is, of another world."""
    why = not_this_world(version)
    if why:
        raise WorldVersionError(f"{path}: cannot be made again, {why}")
