# SPDX-License-Identifier: Apache-2.0
"""What is usual at which time of day: the habits of a building (``sim.world.sessions``)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from slam.shaped import whole

MOST_SESSIONS = 50
DAY_S, HOUR_S = 86_400.0, 3_600.0
OPEN, AJAR, SHUT = (1.25, 1.75), (0.3, 0.9), (0.0, 0.0)  # rad, as in ``scenes.recipe``


@dataclass(frozen=True, kw_only=True)
class TimeOfDay:
    """What is usual then.

    motion   times the rates of the dynamism        present  share of the people
    likely   of each group to be put elsewhere: relative to each other
    sorts    how often a thing is put on a seat or spot, in a row at a wall, on floor at a wall
    hour     of the clock at which a session of it begins; night is after midnight, hour 25
    home     whether things go back to where they belong
    doors    angles at which they rest, rad
    """

    name: str
    motion: float
    present: float
    likely: Mapping[str, float]
    sorts: tuple[float, float, float]
    hour: float
    home: bool = False
    doors: tuple[float, float] = OPEN


DAY = (
    TimeOfDay(
        name="morning", hour=9.0, motion=1.0, present=0.7, home=True, sorts=(0.8, 0.0, 0.2),
        likely={"chair": 1.0, "bin": 0.3, "load": 1.0, "door": 1.0},
    ),
    TimeOfDay(
        name="lunch", hour=12.5, motion=0.6, present=0.5, sorts=(0.7, 0.05, 0.25),
        likely={"chair": 1.0, "bin": 0.2, "load": 0.6, "door": 0.4},
    ),
    TimeOfDay(
        name="meeting", hour=15.0, motion=0.5, present=1.0, sorts=(0.6, 0.1, 0.3), doors=AJAR,
        likely={"chair": 1.0, "bin": 0.1, "load": 1.0, "door": 0.4},
    ),
    TimeOfDay(
        name="cleaning", hour=19.0, motion=0.8, present=0.2, sorts=(0.05, 0.7, 0.25),
        likely={"chair": 1.0, "bin": 1.0, "load": 0.4, "door": 0.3},
    ),
    TimeOfDay(
        name="night", hour=25.0, motion=0.0, present=0.0, sorts=(0.3, 0.4, 0.3), doors=SHUT,
        likely={"chair": 0.2, "bin": 0.2, "load": 0.2, "door": 2.0},
    ),
)  # fmt: skip


def time_of(session: int) -> TimeOfDay:
    """The time of day of a session: they go round."""
    return DAY[checked(session) % len(DAY)]


def clock_s(session: int) -> float:
    """When a session begins, s since the midnight before the first."""
    day, _ = divmod(checked(session), len(DAY))
    return day * DAY_S + time_of(session).hour * HOUR_S


def checked(session: Any) -> int:
    """A number of a session; ``InvalidValueError`` for anything else."""
    whole("session", session, 0, MOST_SESSIONS - 1)
    return int(session)
