# SPDX-License-Identifier: Apache-2.0
"""Who is followed: the way each leader has come, and the course of its formation.

The course turns after the leader slowly: a robot that turns on the spot does not whirl its visitors
about.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.right_of_way import Crowd, Float, Int
from slam._jit import njit

_F = ACTORS.following
CRUMB, COURSE_RATE, MOVING = _F.crumb_m, _F.course_rate, _F.moving_mps
CRUMBS = 160  # remembered of each leader: 40 m
HEADING, STOOD, LAST, COUNT = range(4)  # columns of ``Leaders.course``


class Leaders(NamedTuple):
    """Those who are followed, and lines.

    rows    (l,) disc row of each leader
    trail   (l, CRUMBS, 2) m, places it has been at, a ring
    course  (l, 4) heading rad of its formation, s it has stood, last crumb, number of crumbs
    lines   (q, 7) place in a line x, y m, and the number of places of that line; of a row of chairs
            also the disc row of the chair that stands there (-1 none) and its pose before
    """

    rows: Int
    trail: Float
    course: Float
    lines: Float


def leaders_of(rows: list[int], lines: list[tuple[float, ...]]) -> Leaders:
    """Of discs in these rows, not yet on their way."""
    n = len(rows)
    return Leaders(
        np.array(rows, dtype=np.int64),
        np.zeros((n, CRUMBS, 2)),
        np.zeros((n, 4)),
        np.array(lines, dtype=np.float64).reshape(-1, 7),
    )


def arrays(leaders: Leaders) -> dict[str, NDArray[np.generic]]:
    """The live arrays that are state."""
    return {"trail": leaders.trail, "course": leaders.course, "lines": leaders.lines}


@njit
def note_ways(tick: float, leaders: Leaders, crowd: Crowd) -> None:
    """Remember where every leader is, and turn its formation after it."""
    for k in range(len(leaders.rows)):
        disc, course = crowd.discs[leaders.rows[k]], leaders.course[k]
        x, y, u, v = disc[columns.X], disc[columns.Y], disc[columns.U], disc[columns.V]
        if course[COUNT] == 0.0:
            course[HEADING] = crowd.yaws[leaders.rows[k]]
        last = int(course[LAST])
        dx, dy = x - leaders.trail[k, last, 0], y - leaders.trail[k, last, 1]
        if course[COUNT] == 0.0 or dx * dx + dy * dy > CRUMB * CRUMB:
            last = (last + 1) % CRUMBS
            leaders.trail[k, last, 0], leaders.trail[k, last, 1] = x, y
            course[LAST], course[COUNT] = last, min(course[COUNT] + 1.0, CRUMBS)
        moves = u * u + v * v > MOVING * MOVING
        course[STOOD] = 0.0 if moves else course[STOOD] + tick
        towards = course[HEADING]
        if disc[columns.KIND] == columns.ROBOT:  # shows where it will go before it does
            towards = crowd.yaws[leaders.rows[k]]
        elif moves:
            towards = math.atan2(v, u)
        turn = towards - course[HEADING]
        turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
        course[HEADING] += min(max(turn, -COURSE_RATE * tick), COURSE_RATE * tick)
