# SPDX-License-Identifier: Apache-2.0
"""Now and then somebody sits down: goes to a free chair, sits, gets up and leaves.

What a scanner below the knee sees of it: two shanks that stand still in front of a chair's column,
and a chair that comes along when its sitter shifts. Sitter and chair do not collide with each other
from the moment one sits down until they are apart again (``dress``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.gait import HIP, SEAT_HEIGHT
from sim.actors.people.right_of_way import Crowd, Float, Int
from sim.core.flow import Field, clearance_at
from slam._jit import inner, njit

_S = ACTORS.sitting
SHARE, HAND, STAY, DOWN_S = _S.share, _S.hand_m, _S.stay, _S.down_s
NEAR, ROOM, PACE, GIVE_UP_S = _S.near_m, _S.room_m, _S.pace_mps, _S.give_up_s
PLANAR_BIT = 2  # contype of chairs, bins and the robot


class Hulls(NamedTuple):
    """The parts of the model that follow who sits; derived from the state, so never saved.

    geoms (n,) hull of each person; bits (n, 2) its contype and conaffinity; looks (n,) body that is
    seen, -1 none; heights (n,) m of that; then the model's own arrays, which are written
    """

    geoms: Int
    bits: NDArray[np.int32]
    looks: Int
    heights: Float
    contype: NDArray[np.int32]
    affinity: NDArray[np.int32]
    body_pos: Float


@njit
def dress(crowd: Crowd, hulls: Hulls) -> None:
    """Who has a chair, and no longer walks to it, meets walls, people and doors only; and sinks."""
    for i in range(len(hulls.geoms)):
        geom, look = hulls.geoms[i], hulls.looks[i]
        off = crowd.task[i].seat >= 0 and crowd.task[i].walking != columns.TO_SEAT
        hulls.contype[geom] = 0 if off else hulls.bits[i, 0]
        hulls.affinity[geom] = hulls.bits[i, 1] & ~PLANAR_BIT if off else hulls.bits[i, 1]
        if look >= 0:
            sunk = (HIP - SEAT_HEIGHT) * crowd.state[i].sit
            hulls.body_pos[look, 2] = hulls.heights[i] - sunk


@inner
def free_seat(i: int, field: Field, crowd: Crowd) -> int:
    """Row of the nearest chair at hand that nobody else has and the way to which is free; -1."""
    discs, task = crowd.discs, crowd.task
    best, found = HAND * HAND, -1
    for k in range(discs.shape[0]):
        dx, dy = discs[k].x - discs[i].x, discs[k].y - discs[i].y
        far = dx * dx + dy * dy
        if discs[k].kind != columns.CHAIR or far >= best:
            continue
        if discs[k].u ** 2 + discs[k].v ** 2 > 0.01:
            continue
        taken = False
        for other in range(len(task)):
            taken = taken or task[other].seat == k
        open_way = clearance_at(field, discs[k].x, discs[k].y) > ROOM
        for part in range(1, 5):
            x, y = discs[i].x + 0.2 * part * dx, discs[i].y + 0.2 * part * dy
            open_way = open_way and clearance_at(field, x, y) > 0.25
        if open_way and not taken:
            best, found = far, k
    return found


@inner
def may_sit(i: int, field: Field, crowd: Crowd) -> None:
    """On arrival: perhaps go on to a chair."""
    if crowd.state[i].luck < SHARE:
        seat = free_seat(i, field, crowd)
        if seat >= 0:
            crowd.task[i].walking, crowd.task[i].seat = columns.TO_SEAT, seat
            crowd.state[i].blocked = 0.0


@inner
def sit(i: int, time: float, tick: float, crowd: Crowd) -> None:
    """Come to the chair, sit down, get up; call it at every tick."""
    discs, state, task = crowd.discs, crowd.state, crowd.task
    seat = task[i].seat
    if seat < 0:
        return
    dx, dy = discs[seat].x - discs[i].x, discs[seat].y - discs[i].y
    far = math.sqrt(dx * dx + dy * dy)
    apart = far - discs[i].r - discs[seat].r
    if task[i].walking == columns.TO_SEAT:
        slow = discs[i].u ** 2 + discs[i].v ** 2 < 0.01
        state[i].blocked += tick if slow else 0.0
        if apart < NEAR:
            task[i].walking = columns.SEATED
            state[i].stay_until += (STAY - 1.0) * max(state[i].stay_until - time, 0.0) + 2.0
        elif state[i].blocked > GIVE_UP_S or far > HAND + 1.0:
            task[i].walking, task[i].seat = columns.STANDS, -1
    elif task[i].walking == columns.SEATED:
        state[i].look = crowd.yaws[seat]
        if far < 0.15:
            state[i].sit = min(state[i].sit + tick / DOWN_S, 1.0)
    else:
        state[i].sit = max(state[i].sit - tick / DOWN_S, 0.0)
        if state[i].sit == 0.0 and apart > 0.03:
            task[i].seat = -1


@inner
def on_chair(i: int, crowd: Crowd) -> bool:
    """Sitting, sitting down or getting up: moves with the chair."""
    seated = crowd.task[i].walking == columns.SEATED
    return bool(seated or (crowd.task[i].walking == columns.WALKS and crowd.state[i].sit > 0.0))


@inner
def to_chair(i: int, crowd: Crowd) -> tuple[float, float]:
    """Velocity to the middle of the chair."""
    discs, seat = crowd.discs, crowd.task[i].seat
    dx, dy = discs[seat].x - discs[i].x, discs[seat].y - discs[i].y
    far = math.sqrt(dx * dx + dy * dy)
    speed = min(PACE, 3.0 * far) / max(far, 1e-6)
    return speed * dx + 0.0, speed * dy + 0.0
