# SPDX-License-Identifier: Apache-2.0
"""A rectangle cut into rooms by walls that run from wall to wall, and openings that join them all.

Each cut parts one region in two, so one opening per cut joins all rooms: by induction on the cuts,
the two sides of each are joined through it. Any two rooms that share enough wall may get another.
"""

import math
from dataclasses import dataclass

import numpy as np

from scenes.scene import Pose
from slam.errors import InvalidValueError

Rect = tuple[float, float, float, float]

MIN_SIDE = 3.0  # m between the middles of walls
OPENING = 1.0  # m
CORNER = 0.35  # m from an opening to the next corner
HINGE_IN, HINGE_OUT = 0.03, 0.04  # m from opening's end and wall's middle to the hinge
SHARE_OF_DOORS = 0.75
SHARE_OF_LOOPS = 0.3
TRIES = 6  # places tried for a cut


@dataclass(frozen=True, kw_only=True)
class Cut:
    """A wall's middle line: at ``at`` m across ``axis`` (0: x = at), from ``low`` to ``high``."""

    axis: int
    at: float
    low: float
    high: float

    def point(self, along: float, across: float = 0.0) -> tuple[float, float]:
        """World x, y of a place ``along`` the line and beside it."""
        return (self.at + across, along) if self.axis == 0 else (along, self.at + across)


@dataclass(frozen=True, kw_only=True)
class Opening:
    """A gap from ``low`` to ``low + OPENING`` m in a cut; with a hinge it has a door.

    hinge  where the leaf turns and which way it points when shut; ``clockwise`` how it opens
    """

    cut: Cut
    low: float
    hinge: Pose | None = None
    clockwise: bool = False

    @property
    def middle(self) -> tuple[float, float]:
        """World x, y."""
        return self.cut.point(self.low + 0.5 * OPENING)


def partition(
    width: float, depth: float, n_rooms: int, rng: np.random.Generator
) -> tuple[list[Rect], list[Cut], list[Opening]]:
    """Rooms (to the middles of their walls), walls between them and the openings in these.

    Raises ``InvalidValueError`` when that many rooms do not fit.
    """
    whole = (-0.5 * width, -0.5 * depth, 0.5 * width, 0.5 * depth)
    if n_rooms > _room_for(whole):
        raise InvalidValueError(
            f"n_rooms = {n_rooms} does not fit: {width:.1f} x {depth:.1f} m holds "
            f"{_room_for(whole)} of {MIN_SIDE:g} m"
        )
    rooms: list[Rect] = []
    cuts: list[Cut] = []
    _divide(whole, n_rooms, rng, rooms, cuts)
    return rooms, cuts, [opening for cut in cuts for opening in _openings(cut, rooms, rng)]


def _room_for(region: Rect) -> int:
    """How many rooms of the least size a region holds side by side."""
    across, along = (math.floor((region[i + 2] - region[i]) / MIN_SIDE + 1e-6) for i in (0, 1))
    return across * along


def _divide(
    region: Rect, n: int, rng: np.random.Generator, rooms: list[Rect], cuts: list[Cut]
) -> None:
    """Cut a region that has room for ``n`` rooms into them."""
    if n == 1:
        rooms.append(region)
        return
    axis = 0 if region[2] - region[0] >= region[3] - region[1] else 1
    low, high = region[axis], region[axis + 2]
    columns = math.floor((high - low) / MIN_SIDE + 1e-6)
    places = [round(low + share * (high - low), 2) for share in rng.uniform(0.33, 0.67, TRIES)]
    for at in [*places, low + (columns // 2) * (high - low) / columns]:  # the last always holds n
        first, second = list(region), list(region)
        first[axis + 2] = second[axis] = float(at)
        sides = _rect(first), _rect(second)
        holds = [_room_for(side) for side in sides]
        if min(holds) >= 1 and sum(holds) >= n:
            break
    wanted = round(n * (at - low) / (high - low))
    n_first = min(max(wanted, n - holds[1], 1), holds[0], n - 1)
    cuts.append(Cut(axis=axis, at=float(at), low=region[1 - axis], high=region[3 - axis]))
    _divide(sides[0], n_first, rng, rooms, cuts)
    _divide(sides[1], n - n_first, rng, rooms, cuts)


def _rect(values: list[float]) -> Rect:
    return values[0], values[1], values[2], values[3]


def _openings(cut: Cut, rooms: list[Rect], rng: np.random.Generator) -> list[Opening]:
    """One opening between a random pair of rooms on both sides, and perhaps more."""
    a, b = 1 - cut.axis, 3 - cut.axis  # places of low and high along the cut in a rectangle
    inside = [r for r in rooms if r[a] >= cut.low - 1e-9 and r[b] <= cut.high + 1e-9]
    left = [r for r in inside if abs(r[cut.axis + 2] - cut.at) < 1e-9]
    right = [r for r in inside if abs(r[cut.axis] - cut.at) < 1e-9]
    shared = [(max(p[a], q[a]), min(p[b], q[b])) for p in left for q in right]
    long_enough = [s for s in shared if s[1] - s[0] >= OPENING + 2.0 * CORNER]
    needed = int(rng.integers(len(long_enough)))
    extra = rng.random(len(long_enough)) < SHARE_OF_LOOPS
    return [
        _opening(cut, low, high, rng)
        for index, (low, high) in enumerate(long_enough)
        if index == needed or extra[index]
    ]


def _opening(cut: Cut, low: float, high: float, rng: np.random.Generator) -> Opening:
    """Somewhere between ``low`` and ``high``, with a door or without."""
    start = round(float(rng.uniform(low + CORNER, high - CORNER - OPENING)), 2)
    has_door, from_end, beyond = (rng.random(3) < [SHARE_OF_DOORS, 0.5, 0.5]).tolist()
    if not has_door:
        return Opening(cut=cut, low=start)
    along = start + (OPENING - HINGE_IN if from_end else HINGE_IN)
    x, y = cut.point(along, HINGE_OUT if beyond else -HINGE_OUT)
    turn = (0.5 * math.pi if cut.axis == 0 else 0.0) + (math.pi if from_end else 0.0)
    # the left of +x is "beyond" (+y), the left of +y is not (-x); seen from the end it is reversed
    opens_left = beyond == (cut.axis == 1) if not from_end else beyond == (cut.axis == 0)
    hinge = (x, y, math.remainder(turn, math.tau))
    return Opening(cut=cut, low=start, hinge=hinge, clockwise=not opens_left)
