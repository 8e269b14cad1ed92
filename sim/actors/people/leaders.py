# SPDX-License-Identifier: Apache-2.0
"""Who is followed: the way each leader has come, and the course of its formation.

The course turns after the leader slowly: a robot that turns on the spot does not whirl its visitors
about.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.actors.config import FOLLOW
from sim.actors.people import columns
from sim.actors.people.right_of_way import Crowd, Int
from sim.core.state import Records, flat
from slam._jit import inner
from slam.frames import Float

CRUMBS = 160  # remembered of each leader: 40 m


class Leaders(NamedTuple):
    """Those who are followed, and lines.

    rows    (l,) disc row of each leader
    trail   (l, CRUMBS, 2) m, places it has been at, a ring
    course  (l,) of each leader
    lines   (q,) places
    """

    rows: Int
    trail: Float
    course: Records
    lines: Records


def leaders_of(rows: list[int], lines: list[tuple[float, ...]]) -> Leaders:
    """Of discs in these rows, not yet on their way."""
    n = len(rows)
    return Leaders(
        np.array(rows, dtype=np.int64),
        np.zeros((n, CRUMBS, 2)),
        np.zeros(n, columns.COURSE),
        np.array(lines, columns.PLACE),
    )


def arrays(leaders: Leaders) -> dict[str, NDArray[np.generic]]:
    """The live arrays that are state."""
    course, lines = flat(leaders.course), flat(leaders.lines)
    return {"trail": leaders.trail, "course": course, "lines": lines}


@inner
def note_ways(tick: float, leaders: Leaders, crowd: Crowd) -> None:
    """Remember where every leader is, and turn its formation after it."""
    for k in range(len(leaders.rows)):
        disc, course = crowd.discs[leaders.rows[k]], leaders.course[k]
        x, y, u, v = disc.x, disc.y, disc.u, disc.v
        if course.count == 0.0:
            course.heading = crowd.yaws[leaders.rows[k]]
        last = int(course.last)
        dx, dy = x - leaders.trail[k, last, 0], y - leaders.trail[k, last, 1]
        if course.count == 0.0 or dx * dx + dy * dy > FOLLOW.crumb_m * FOLLOW.crumb_m:
            last = (last + 1) % CRUMBS
            leaders.trail[k, last, 0], leaders.trail[k, last, 1] = x, y
            course.last, course.count = last, min(course.count + 1.0, CRUMBS)
        moves = u * u + v * v > FOLLOW.moving_mps * FOLLOW.moving_mps
        course.stood = 0.0 if moves else course.stood + tick
        towards = course.heading
        if disc.kind == columns.ROBOT:  # shows where it will go before it does
            towards = crowd.yaws[leaders.rows[k]]
        elif moves:
            towards = math.atan2(v, u)
        turn = towards - course.heading
        turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
        course.heading += min(max(turn, -FOLLOW.course_rate * tick), FOLLOW.course_rate * tick)
