# SPDX-License-Identifier: Apache-2.0
"""The marks of a plan: sites named by words, ``room:kitchen``; which there are and what they need.

A plan with another mark, or with too few words in one, is refused: it would be left out silently.
"""

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco

from scenes.kinds import KINDS
from slam.errors import InvalidValueError, meant

if TYPE_CHECKING:
    from scenes.scene import Pose

# first word -> how the mark is written
WRITTEN = {
    "room": "room:NAME",
    "start": "start:robot",
    "goal": "goal:NAME",
    "door": "door:ROOM:left|right",
    "sliding": "sliding:ROOM:left|right",
    "lift": "lift:ROOM:left|right",
    "opening": "opening:NAME",
    "seat": "seat:KIND:N",
    "put": "put:KIND",
    "spot": "spot:KIND:N",
    "bin": "bin:ROOM:N",
    "bounds": "bounds:NAME",
}
STANDS = {"seat": "chair", "spot": "load"}  # group of the kinds that stand at a mark
NEEDED = ("room", "start")
BOXES = ("room", "bounds")


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A site of a plan: ``words`` of its name split at ':', where it is, half sizes of its box."""

    words: tuple[str, ...]
    pose: "Pose"
    half: tuple[float, float]

    @property
    def rect(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of an unrotated box, m."""
        (x, y, _), (a, b) = self.pose, self.half
        return x - a, y - b, x + a, y + b


def marks(spec: mujoco.MjSpec) -> tuple[Mark, ...]:
    """Every site of an uncompiled spec, in the order of the file."""
    return tuple(
        Mark(
            words=tuple(site.name.split(":")),
            pose=(float(site.pos[0]), float(site.pos[1]), yaw_of(site)),
            half=(float(site.size[0]), float(site.size[1])),
        )
        for site in spec.sites
    )


def check_written(source: str, found: Iterable[Mark]) -> None:
    """Raise ``InvalidValueError`` for a mark that lacks a word or names an unknown kind."""
    for mark in found:
        form = WRITTEN.get(mark.words[0], "")
        short = len(mark.words) < len(form.split(":"))
        short |= mark.words[0] == "start" and ":".join(mark.words) != form
        if short or (form.endswith("left|right") and mark.words[2] not in ("left", "right")):
            name = ":".join(mark.words)
            raise InvalidValueError(f"plan '{source}': mark '{name}' must be written {form}")
        known = [k for k, row in KINDS.items() if row.group == STANDS.get(mark.words[0])]
        if mark.words[0] in STANDS and mark.words[1] not in known:
            raise InvalidValueError(
                f"plan '{source}': mark '{':'.join(mark.words)}' has the unknown kind "
                f"'{mark.words[1]}'. There are: {', '.join(known)}"
            )


def check_marks(source: str, found: Sequence[Mark], parts: Collection[str]) -> None:
    """Raise ``InvalidValueError`` for a mark that means nothing, and for a plan that lacks one.

    source  name of the plan, for the error
    parts   first words that put a part
    """
    seen = {mark.words[0]: mark for mark in found}
    for first, mark in seen.items():
        if first in WRITTEN or first in parts:
            continue
        hint = meant(first, [*WRITTEN, *parts])
        raise InvalidValueError(
            f"plan '{source}': unknown mark '{':'.join(mark.words)}'.{hint} Marks: "
            f"{', '.join(WRITTEN.values())}; or furniture: {', '.join(sorted(parts))}"
        )
    for word in NEEDED:
        if word not in seen:
            raise InvalidValueError(f"plan '{source}' needs a mark '{WRITTEN[word]}'; it has none")
    x, y, _ = seen["start"].pose
    for word in BOXES:
        boxes = [mark.rect for mark in found if mark.words[0] == word]
        if boxes and not any(a <= x <= c and b <= y <= d for a, b, c, d in boxes):
            raise InvalidValueError(
                f"plan '{source}': start:robot at ({x:g}, {y:g}) is in no {word}; expected it "
                "inside one"
            )
    for mark in found:
        if mark.words[0] in BOXES and not min(mark.half) > 0.0:
            raise InvalidValueError(
                f"plan '{source}': mark '{':'.join(mark.words)}' must be a box of two half sizes "
                f"> 0 m, got {mark.half}"
            )


def yaw_of(element: mujoco.MjsSite | mujoco.MjsGeom) -> float:
    """rad by which what lies flat is turned, however its file says so."""
    if element.alt.type == mujoco.mjtOrientation.mjORIENTATION_EULER:
        return float(element.alt.euler[2])
    return 2.0 * math.atan2(float(element.quat[3]), float(element.quat[0]))
