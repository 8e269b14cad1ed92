# SPDX-License-Identifier: Apache-2.0
"""One number in [0, 1] for how much a room moves, and the tables of what it means.

Two axes, both at ``d`` when one number ``dynamism`` is given:

**motion**  what moves now. ``CURVES`` below are the rates of shoves, doors and trips, as they were
            in world 1; ``crowd`` brings people, boards and trains into the room besides, at 1 the
            whole crowd of the scene (``scenes.crowd.BY_LEVEL``). Each scene has its own numbers at
            four levels, so that the share of returns from what moves grows about in a line with
            it. People hide one another, so their number grows faster than that.
**change**  of what can move, the share that stands elsewhere than when the robot last saw it
            (``sim.actors.rearranging``).

``Dynamism.world_1(d)`` are the rates alone, without a crowd or change: exactly what dynamism d was
in world 1. ``mobilia config dynamism`` prints the curves.

At 0 nothing moves by itself: people are present and stand perfectly still, chairs and bins are
never pushed and doors stay at their angle of rest (a door still gives way to the robot). How hard
a shove is does not depend on d: 0.25 to 1.5 m/s, which for a 13 kg chair is 3 to 20 N s
(design range for invisible shoves; a person at a desk rolls a chair at walking speed at most).
Heavier things get the speed that 45 N s give them.

For experiments that ask "how many may move?", ``moving_share`` replaces the shoves of chairs and
loads by a set share of them on the move at any time (``sim.actors.rolling``).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

from msgspec import Meta

from slam.errors import InvalidValueError
from slam.shaped import NotNegative, Positive, Share, check, shaped


@dataclass(frozen=True)
class Rate:
    """One rate as a function of the dynamism d in [0, 1].

    field  of ``Dynamism``
    """

    field: str
    meaning: str
    unit: str
    at: Callable[[float], float]


CURVES = (
    Rate("chair_push_rate", "shoves of each chair", "1/s", lambda d: 0.15 * d),
    Rate("bin_kick_rate", "kicks of each bin", "1/s", lambda d: 0.06 * d),
    Rate("load_push_rate", "moves of each trolley or pallet", "1/s", lambda d: 0.06 * d),
    Rate("door_rate", "each door moved by nobody", "1/s", lambda d: 0.04 * d),
    Rate(
        "stay_mean", "mean stay of a person at a goal; infinite: nobody leaves", "s",
        lambda d: 12.0 / d - 10.0 if d > 0.0 else math.inf,
    ),
    Rate("pace", "walking pace, times a person's own", "1", lambda d: 0.7 + 0.3 * d),
    Rate("crowd", "level of the scene's crowd", "1", lambda d: d),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Dynamism:
    """All rates of a moving room. ``Dynamism.at`` fills them from the table above.

    chair_push_rate  1/s for each chair          bin_kick_rate  1/s for each bin
    load_push_rate   1/s for each trolley, pallet or whatever else rolls in the plane
    moving_share     in [0, 1]: of all chairs and loads, on the move at any time; replaces their
                     shoves unless it is None
    door_rate        1/s for each door           stay_mean      s, infinite: nobody ever leaves
    pace             factor on each person's preferred speed
    crowd            in [0, 1]: level of the scene's crowd (``scenes.crowd.mix``)
    change           in [0, 1]: of what can move, elsewhere than when the robot last saw it
    push_speed_min/max  m/s a shove gives a chair
    kick_speed_min/max  m/s a kick gives a bin
    push_spin_max       rad/s a shove adds in yaw, either way
    """

    chair_push_rate: NotNegative = 0.0
    bin_kick_rate: NotNegative = 0.0
    load_push_rate: NotNegative = 0.0
    moving_share: Share | None = None
    door_rate: NotNegative = 0.0
    stay_mean: Annotated[float, Meta(gt=0.0)] = math.inf
    pace: Positive = 1.0
    crowd: Share = 0.0
    change: Share = 0.0
    push_speed_min: NotNegative = 0.25
    push_speed_max: NotNegative = 1.5
    kick_speed_min: NotNegative = 0.4
    kick_speed_max: NotNegative = 2.0
    push_spin_max: NotNegative = math.pi

    def __post_init__(self) -> None:
        check(self)
        for what in ("push", "kick"):
            low, high = getattr(self, f"{what}_speed_min"), getattr(self, f"{what}_speed_max")
            if not low <= high:
                raise InvalidValueError(
                    f"Dynamism.{what}_speed_min/max must satisfy min <= max, got {low}, {high}"
                )

    @classmethod
    def at(cls, dynamism: float, *, change: float | None = None) -> "Dynamism":
        """Both axes at a dynamism in [0, 1], or motion at it and ``change`` apart.

        Raises ``InvalidValueError`` outside.
        """
        d = shaped("dynamism", dynamism, Share)
        both = d if change is None else shaped("change", change, Share)
        return cls(**{rate.field: rate.at(d) for rate in CURVES}, change=both)

    @classmethod
    def world_1(cls, dynamism: float) -> "Dynamism":
        """What a dynamism was in world 1: the rates without a crowd or change."""
        return replace(cls.at(dynamism, change=0.0), crowd=0.0)

    @classmethod
    def of(
        cls,
        dynamism: "float | Dynamism",
        moving_share: float | None = None,
        *,
        motion: float | None = None,
        change: float | None = None,
    ) -> "Dynamism":
        """A number in [0, 1] for both axes, or the rates; then what is given for one axis alone.

        moving_share  as the field of that name
        motion        in [0, 1]: rates and crowd at this level instead
        change        in [0, 1]: the field of that name instead
        """
        rates = dynamism if isinstance(dynamism, Dynamism) else cls.at(dynamism)
        if motion is not None:
            rates = cls.at(shaped("motion", motion, Share), change=rates.change)
        if change is not None:
            rates = replace(rates, change=shaped("change", change, Share))
        return rates if moving_share is None else replace(rates, moving_share=moving_share)
