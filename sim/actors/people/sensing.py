# SPDX-License-Identifier: Apache-2.0
"""What people know of each other and of the room: discs of all that moves, angles of doors."""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.right_of_way import Addresses, Crowd, Doors, Float, Int
from slam._jit import inner

SIGHT_M = ACTORS.holding.sight_m


@inner
def sense(at: Addresses, qpos: Float, qvel: Float, ways: Doors, crowd: Crowd) -> None:
    """Read discs, headings, door angles and the discs that stand for the leaves."""
    discs, k = crowd.discs, at.discs.shape[0]
    for row in range(k):
        q, v = at.discs[row]
        discs[row].x, discs[row].y = qpos[q], qpos[q + 1]
        discs[row].u, discs[row].v = qvel[v], qvel[v + 1]
        if row < len(crowd.yaws):
            crowd.yaws[row] = qpos[q + 2]
    for d in range(at.doors.shape[0]):
        q, v = at.doors[d]
        x, y, closed, sign, slides = at.hinges[d]
        ways.doors[d].angle = qpos[q]
        if slides != 0.0:
            ways.doors[d].angle = 0.5 * math.pi * qpos[q] / ways.doors[d].width
        c, s = math.cos(closed + sign * qpos[q]), math.sin(closed + sign * qpos[q])
        for part in range(3):
            row = k + 3 * d + part
            length = (0.35 + 0.3 * part) * ways.doors[d].width
            if slides != 0.0:
                along = length + slides * qpos[q]
                discs[row].x, discs[row].y = x + along * c, y + along * s
                discs[row].u, discs[row].v = slides * qvel[v] * c, slides * qvel[v] * s
                continue
            discs[row].x, discs[row].y = x + length * c, y + length * s
            discs[row].u = -length * s * sign * qvel[v]
            discs[row].v = length * c * sign * qvel[v]
    first = len(discs) - len(crowd.long)
    for part in range(len(crowd.long)):
        row = int(crowd.long[part, 0])
        q, v = at.discs[row]
        rx, ry = (
            crowd.long[part, 1] * math.cos(qpos[q + 2]),
            crowd.long[part, 1] * math.sin(qpos[q + 2]),
        )
        end = discs[first + part]
        end.x, end.y = qpos[q] + rx, qpos[q + 1] + ry
        end.u, end.v = qvel[v] - qvel[v + 2] * ry, qvel[v + 1] + qvel[v + 2] * rx


@inner
def nearby(i: int, crowd: Crowd, sides: Int, near: Int) -> int:
    """Rows of discs within 3 m of person ``i``, into ``near``; returns how many.

    Who holds something looks farther.

    The leaf of a door one wants to pass is no obstacle: ``at_doors`` deals with it. Nor is the
    chair that one sits down on, nor what one holds.
    """
    discs, count = crowd.discs, 0
    seat, held = crowd.task[i].seat, crowd.task[i].held
    reach = 9.0 if held < 0 else SIGHT_M * SIGHT_M
    for k in range(discs.shape[0]):
        dx, dy = discs[k].x - discs[i].x, discs[k].y - discs[i].y
        if k in (i, seat) or dx * dx + dy * dy > reach or count == len(near):
            continue
        if held >= 0 and crowd.owner[k] == held:
            continue
        if discs[k].kind >= columns.LEAF and sides[i, int(discs[k].kind - columns.LEAF)] != 0:
            continue
        near[count] = k
        count += 1
    return count
