# SPDX-License-Identifier: Apache-2.0
"""Who takes chairs along, and how one walks with something in one's hands."""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.holding import DROPPED, QB, VB, Held
from sim.actors.people import columns
from sim.actors.people.following import in_sight
from sim.actors.people.right_of_way import Crowd, Float, Int
from sim.core.flow import Field
from slam._jit import njit

_C = ACTORS.cleaning
REACH, NEAR, REST_S = _C.hand_m, _C.near_m, _C.rest_s
GIVES_UP_S = ACTORS.walking.blocked_s
_H = ACTORS.holding
STOP_M, BRAKE, BACKWARDS = _H.stop_m, _H.brake, _H.backwards_mps


@njit
def pushes(
    i: int, wanted: tuple[float, float], near: Int, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of someone who pushes a long thing: they turn it to the way, then walk ahead.

    Who or what stands before its far end is waited for, but chairs are pushed along.
    """
    speed = math.sqrt(wanted[0] ** 2 + wanted[1] ** 2)
    if speed < 0.05:
        return 0.0, 0.0
    crowd.state[i, columns.LOOK] = math.atan2(wanted[1], wanted[0])
    discs, yaw = crowd.discs, crowd.yaws[i]
    c, s = math.cos(yaw), math.sin(yaw)
    ahead = (wanted[0] * c + wanted[1] * s) / speed
    if ahead < 0.0:  # backwards while turning round: its far end needs the room
        return BACKWARDS * ahead * c, BACKWARDS * ahead * s
    go = speed * ahead * ahead
    first = discs[i]
    for part in range(len(discs)):  # the farthest disc of the thing ahead
        if crowd.owner[part] == crowd.task[i, columns.HELD]:
            if (discs[part, columns.X] - first[columns.X]) * c + (
                discs[part, columns.Y] - first[columns.Y]
            ) * s > 0.1:
                first = discs[part]
    for k in range(len(near)):
        other = discs[near[k]]
        kind = other[columns.KIND]
        if kind == columns.CHAIR:  # is pushed along
            continue
        dx, dy = other[columns.X] - first[columns.X], other[columns.Y] - first[columns.Y]
        along, beside = dx * c + dy * s, abs(dy * c - dx * s)
        reach = other[columns.R] + first[columns.R]
        if along > 0.0 and beside < reach + 0.05:
            gap = along - math.sqrt(max(reach * reach - beside * beside, 0.0)) - STOP_M
            go = min(go, max(BRAKE * gap, 0.0))
    return go * c, go * s


@njit
def next_chair(i: int, field: Field, crowd: Crowd) -> int:
    """Disc row of the nearest chair in sight that stands, and nobody sits on or holds; -1."""
    discs, task, best, found = crowd.discs, crowd.task, REACH * REACH, -1
    for k in range(len(crowd.yaws)):
        if discs[k, columns.KIND] != columns.CHAIR:
            continue
        dx, dy = discs[k, columns.X] - discs[i, columns.X], discs[k, columns.Y] - discs[i, columns.Y]
        far = dx * dx + dy * dy
        if far >= best or discs[k, columns.U] ** 2 + discs[k, columns.V] ** 2 > 0.01:
            continue
        taken = k == task[i, columns.PLACE]  # the one that has just been put down
        for other in range(len(task)):
            taken = taken or task[other, columns.SEAT] == k or task[other, columns.HELD] == k
        x, y = discs[i, columns.X], discs[i, columns.Y]
        if not taken and in_sight(field, x, y, x + 0.7 * dx, y + 0.7 * dy):
            best, found = far, k
    return found


@njit
def to_what_is_taken(i: int, crowd: Crowd) -> tuple[float, float]:
    """Velocity to the chair that is to be taken along."""
    discs, row = crowd.discs, crowd.task[i, columns.HELD]
    dx, dy = discs[row, columns.X] - discs[i, columns.X], discs[row, columns.Y] - discs[i, columns.Y]
    far = math.sqrt(dx * dx + dy * dy)
    speed = min(0.8, 1.5 * far) / max(far, 1e-6)
    return speed * dx + 0.0, speed * dy + 0.0


@njit
def may_take(  # noqa: PLR0913 (kernel)
    i: int, time: float, field: Field, crowd: Crowd, held: Held, at: Int, weights: Float
) -> bool:
    """Look for a chair, go to it, take it; True when it has just been taken."""
    task, state, hand = crowd.task, crowd.state, crowd.task[i, columns.HAND]
    doing = task[i, columns.WALKING]
    if doing == columns.STANDS and task[i, columns.HELD] < 0 and time >= state[i, columns.FREE_AT]:
        row = next_chair(i, field, crowd)
        state[i, columns.FREE_AT] = time + REST_S
        if row >= 0:
            task[i, columns.WALKING], task[i, columns.HELD] = columns.TO_CHAIR, row
            state[i, columns.BLOCKED] = 0.0
        return False
    if doing != columns.TO_CHAIR:
        return False
    row = task[i, columns.HELD]
    dx = crowd.discs[row, columns.X] - crowd.discs[i, columns.X]
    dy = crowd.discs[row, columns.Y] - crowd.discs[i, columns.Y]
    reach = crowd.discs[i, columns.R] + crowd.discs[row, columns.R]
    far = math.sqrt(dx * dx + dy * dy)
    if far - reach < NEAR:
        held.at[hand, QB], held.at[hand, VB] = at[row, 0], at[row, 1]
        held.bodies[hand, 0], held.bodies[hand, 1] = weights[row, 0], weights[row, 1]
        held.pose[hand, 0], held.pose[hand, 1] = reach + 0.04, 0.0
        held.pose[hand, 2] = crowd.yaws[row] - math.atan2(dy, dx)
        return True
    if state[i, columns.BLOCKED] > GIVES_UP_S or far > REACH + 2.0:
        task[i, columns.WALKING], task[i, columns.PLACE] = columns.STANDS, row
        task[i, columns.HELD] = -1
    return False


@njit
def put_down(i: int, time: float, crowd: Crowd, held: Held) -> None:
    """Let go of the chair."""
    task, hand = crowd.task, crowd.task[i, columns.HAND]
    held.at[hand, DROPPED] = held.at[hand, VB]
    held.at[hand, QB] = held.at[hand, VB] = -1
    task[i, columns.PLACE], task[i, columns.HELD] = task[i, columns.HELD], -1
    crowd.state[i, columns.FREE_AT] = time + REST_S
