# SPDX-License-Identifier: Apache-2.0
"""What people know of each other and of the room: discs of all that moves, angles of doors."""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.right_of_way import Addresses, Crowd, Doors, Float, Int
from slam._jit import njit

SIGHT_M = ACTORS.holding.sight_m


@njit
def sense(at: Addresses, qpos: Float, qvel: Float, ways: Doors, crowd: Crowd) -> None:
    """Read discs, headings, door angles and the discs that stand for the leaves."""
    discs, k = crowd.discs, at.discs.shape[0]
    for row in range(k):
        q, v = at.discs[row]
        discs[row, columns.X], discs[row, columns.Y] = qpos[q], qpos[q + 1]
        discs[row, columns.U], discs[row, columns.V] = qvel[v], qvel[v + 1]
        if row < len(crowd.yaws):
            crowd.yaws[row] = qpos[q + 2]
    for d in range(at.doors.shape[0]):
        q, v = at.doors[d]
        x, y, closed, sign, slides = at.hinges[d]
        ways.doors[d, columns.ANGLE] = qpos[q]
        if slides != 0.0:
            ways.doors[d, columns.ANGLE] = 0.5 * math.pi * qpos[q] / ways.doors[d, columns.WIDTH]
        c, s = math.cos(closed + sign * qpos[q]), math.sin(closed + sign * qpos[q])
        for part in range(3):
            row = k + 3 * d + part
            length = (0.35 + 0.3 * part) * ways.doors[d, columns.WIDTH]
            if slides != 0.0:
                along = length + slides * qpos[q]
                discs[row, columns.X], discs[row, columns.Y] = x + along * c, y + along * s
                discs[row, columns.U], discs[row, columns.V] = (
                    slides * qvel[v] * c,
                    slides * qvel[v] * s,
                )
                continue
            discs[row, columns.X], discs[row, columns.Y] = x + length * c, y + length * s
            discs[row, columns.U] = -length * s * sign * qvel[v]
            discs[row, columns.V] = length * c * sign * qvel[v]
    first = len(discs) - len(crowd.long)
    for part in range(len(crowd.long)):
        row = int(crowd.long[part, 0])
        q, v = at.discs[row]
        rx, ry = (
            crowd.long[part, 1] * math.cos(qpos[q + 2]),
            crowd.long[part, 1] * math.sin(qpos[q + 2]),
        )
        end = discs[first + part]
        end[columns.X], end[columns.Y] = qpos[q] + rx, qpos[q + 1] + ry
        end[columns.U], end[columns.V] = qvel[v] - qvel[v + 2] * ry, qvel[v + 1] + qvel[v + 2] * rx


@njit
def nearby(i: int, crowd: Crowd, sides: Int, near: Int) -> int:
    """Rows of discs within 3 m of person ``i``, into ``near``; returns how many.

    Who holds something looks farther.

    The leaf of a door one wants to pass is no obstacle: ``at_doors`` deals with it. Nor is the
    chair that one sits down on, nor what one holds.
    """
    discs, count = crowd.discs, 0
    seat, held = crowd.task[i, columns.SEAT], crowd.task[i, columns.HELD]
    reach = 9.0 if held < 0 else SIGHT_M * SIGHT_M
    for k in range(discs.shape[0]):
        dx, dy = (
            discs[k, columns.X] - discs[i, columns.X],
            discs[k, columns.Y] - discs[i, columns.Y],
        )
        if k in (i, seat) or dx * dx + dy * dy > reach or count == len(near):
            continue
        if held >= 0 and crowd.owner[k] == held:
            continue
        if (
            discs[k, columns.KIND] >= columns.LEAF
            and sides[i, int(discs[k, columns.KIND] - columns.LEAF)] != 0
        ):
            continue
        near[count] = k
        count += 1
    return count
