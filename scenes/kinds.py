# SPDX-License-Identifier: Apache-2.0
"""One row a kind of thing that moves: a part in ``parts/<kind>.xml`` and its row here are all.

The physics reads ``group`` and ``feet``, the bag ``height_m``; pictures draw the part itself.
"""

from dataclasses import dataclass
from typing import Literal

from slam.errors import InvalidValueError, UnknownNameError
from slam.shaped import NotNegative, Positive, check

Group = Literal["chair", "bin", "load", "person", "door", "robot"]
PUSHED = ("chair", "bin", "load")  # groups that a plan or a file may put


@dataclass(frozen=True, kw_only=True)
class Feet:
    """Castors or glides that it stands on at the level "free".

    number    of them, evenly on a circle
    circle_m  radius of that circle
    first_rad angle of the first from the front
    radius_m  of the sphere that each is
    """

    number: int
    circle_m: float
    first_rad: float
    radius_m: float


@dataclass(frozen=True, kw_only=True)
class KindOfMover:
    """One kind.

    group     what moves it: "chair", "bin" and "load" are pushed at their own rates, the others
              have a will of their own
    height_m  of its marker in the bag
    feet      None: it slides in the plane at every level
    part      path of its MJCF file; "" for ``parts/<kind>.xml``
    usual     weight of this kind among the chairs that a scene puts anywhere
    half_length_m  0: round, one hull. Else its hulls stand in a row along its x axis, and this is
                   half the distance between the centres of the outer two
    """

    group: Group
    height_m: Positive
    feet: Feet | None = None
    part: str = ""
    usual: NotNegative = 0.0
    half_length_m: NotNegative = 0.0

    def __post_init__(self) -> None:
        check(self)


KINDS = {
    "chair_swivel": KindOfMover(
        group="chair", height_m=0.95, usual=0.75,
        feet=Feet(number=5, circle_m=0.30, first_rad=0.0, radius_m=0.028),
    ),
    "chair_visitor": KindOfMover(
        group="chair", height_m=0.85, usual=0.25,
        feet=Feet(number=4, circle_m=0.295, first_rad=0.75, radius_m=0.012),
    ),
    "bin": KindOfMover(group="bin", height_m=0.4),
    "trolley": KindOfMover(group="load", height_m=1.0),
    "pallet": KindOfMover(group="load", height_m=0.15),
    "carton": KindOfMover(group="load", height_m=0.6),
    "board": KindOfMover(group="load", height_m=1.8, half_length_m=0.55),
    "hospital_bed": KindOfMover(group="load", height_m=1.0, half_length_m=0.55),
    "couch": KindOfMover(group="load", height_m=0.8, half_length_m=0.37),
    "person": KindOfMover(group="person", height_m=1.75),
    "person_coat": KindOfMover(group="person", height_m=1.75),
    "door": KindOfMover(group="door", height_m=2.0),
    "door_sliding": KindOfMover(group="door", height_m=2.0, part="door_sliding"),
    "door_lift": KindOfMover(group="door", height_m=2.0, part="door_sliding"),
    "robot": KindOfMover(group="robot", height_m=0.45),
}  # fmt: skip


def is_door(kind: str) -> bool:
    """Whether a kind by that name is a door, swinging or sliding; also for names of recordings."""
    return kind.partition("_")[0] == "door"


def joint_of_door(kind: str) -> str:
    """Its one joint: "hinge", rad, or "slide", m."""
    return "hinge" if kind == "door" else "slide"


def register(kind: str, row: KindOfMover) -> None:
    """Make a kind of your own known; its row names its ``part``.

    Raises ``InvalidValueError`` for a name that is taken by another row.
    """
    if KINDS.setdefault(kind, row) != row:
        raise InvalidValueError(f"kind '{kind}' has a row already. Taken: {', '.join(KINDS)}")


def kind_of(kind: str) -> KindOfMover:
    """Its row; ``UnknownNameError`` where it has none."""
    if kind not in KINDS:
        known = ", ".join(KINDS)
        raise UnknownNameError(f"kind must have a row in scenes.kinds ({known}), got {kind!r}")
    return KINDS[kind]
