# SPDX-License-Identifier: Apache-2.0
"""Cleaners: who takes chairs to a row at a wall, and later back to where they stood."""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.holding import DROPPED, QB, VB, Held
from sim.actors.people import columns
from sim.actors.people.formation import in_sight, route
from sim.actors.people.leaders import Leaders
from sim.actors.people.right_of_way import Crowd, Float, Int
from sim.core.flow import Field
from slam._jit import njit

_C = ACTORS.cleaning
REACH, NEAR, REST_S = _C.hand_m, _C.near_m, _C.rest_s
PACE, THERE, TRIP_S = _C.pace_mps, _C.there_m, _C.trip_s
CHAIR, HOME = 3, 4  # columns of ``Leaders.lines``: the chair of a place, and its pose before
GIVES_UP_S = ACTORS.walking.blocked_s


@njit
def next_chair(i: int, field: Field, leaders: Leaders, crowd: Crowd) -> int:
    """Disc row of the nearest chair in sight that stands, and nobody sits on or holds; -1.

    Those that stand in a row of chairs stay there.
    """
    discs, task, best, found = crowd.discs, crowd.task, REACH * REACH, -1
    x, y = discs[i, columns.X], discs[i, columns.Y]
    for k in range(len(crowd.yaws)):
        if discs[k, columns.KIND] != columns.CHAIR:
            continue
        dx, dy = discs[k, columns.X] - x, discs[k, columns.Y] - y
        far = dx * dx + dy * dy
        if far >= best or discs[k, columns.U] ** 2 + discs[k, columns.V] ** 2 > 0.01:
            continue
        taken = False
        for other in range(len(task)):
            taken = taken or task[other, columns.SEAT] == k or task[other, columns.HELD] == k
        for place in range(len(leaders.lines)):
            taken = taken or leaders.lines[place, CHAIR] == k
        if not taken and in_sight(field, x, y, x + 0.7 * dx, y + 0.7 * dy):
            best, found = far, k
    return found


@njit
def row_place(i: int, leaders: Leaders, crowd: Crowd) -> int:
    """Row of ``lines`` that is next: the chairs go in, then out again, the last one first."""
    first, turn = crowd.task[i, columns.FIRST], crowd.task[i, columns.PLACE]
    n = int(leaders.lines[first, 2])
    return int(first + (turn if turn < n else 2 * n - 1 - turn))


@njit
def fills(i: int, leaders: Leaders, crowd: Crowd) -> bool:
    """Whether somebody's row of chairs is being filled, or else emptied."""
    n = int(leaders.lines[crowd.task[i, columns.FIRST], 2])
    return bool(crowd.task[i, columns.PLACE] < n)


@njit
def next_turn(i: int, time: float, leaders: Leaders, crowd: Crowd) -> None:
    """The next chair, after a rest."""
    n = int(leaders.lines[crowd.task[i, columns.FIRST], 2])
    crowd.task[i, columns.PLACE] = (crowd.task[i, columns.PLACE] + 1) % (2 * n)
    crowd.task[i, columns.WALKING], crowd.task[i, columns.HELD] = columns.CLEANS, -1
    crowd.state[i, columns.FREE_AT], crowd.state[i, columns.BLOCKED] = time + REST_S, 0.0


@njit
def to_what_is_taken(i: int, field: Field, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """The velocity with which person ``i`` goes to the chair to take, or takes it to its place."""
    task = crowd.task[i]
    if task[columns.WALKING] == columns.CLEANS:
        return 0.0, 0.0
    x, y = crowd.discs[i, columns.X], crowd.discs[i, columns.Y]
    tx, ty = crowd.discs[task[columns.HELD], columns.X], crowd.discs[task[columns.HELD], columns.Y]
    if task[columns.WALKING] == columns.CARRIES:
        line = leaders.lines[row_place(i, leaders, crowd)]
        tx, ty = (line[0], line[1]) if fills(i, leaders, crowd) else (line[HOME], line[HOME + 1])
    tx, ty = route(i, tx, ty, field, crowd)
    dx, dy = tx - x, ty - y
    far = math.sqrt(dx * dx + dy * dy)
    speed = min(PACE, 1.5 * far) / max(far, 1e-6)
    return speed * dx + 0.0, speed * dy + 0.0


@njit
def find_work(i: int, time: float, field: Field, leaders: Leaders, crowd: Crowd) -> None:
    """Choose the next chair; where there is none, the row is emptied, or one goes elsewhere."""
    task = crowd.task
    place = row_place(i, leaders, crowd)
    row = int(leaders.lines[place, CHAIR])
    if fills(i, leaders, crowd):
        row = next_chair(i, field, leaders, crowd)
        if row >= 0:
            leaders.lines[place, CHAIR] = row
            leaders.lines[place, HOME] = crowd.discs[row, columns.X]
            leaders.lines[place, HOME + 1] = crowd.discs[row, columns.Y]
            leaders.lines[place, HOME + 2] = crowd.yaws[row]
    elif row >= 0:
        dx = crowd.discs[row, columns.X] - leaders.lines[place, 0]
        dy = crowd.discs[row, columns.Y] - leaders.lines[place, 1]
        if dx * dx + dy * dy > 1.0:  # somebody has taken it away meanwhile
            leaders.lines[place, CHAIR] = row = -1
        for other in range(len(task)):
            if row >= 0 and task[other, columns.SEAT] == row:
                leaders.lines[place, CHAIR] = row = -1
    if row < 0:
        next_turn(i, time, leaders, crowd)
        return
    task[i, columns.WALKING], task[i, columns.HELD] = columns.TO_CHAIR, row
    crowd.state[i, columns.BLOCKED], crowd.state[i, columns.BEST_AT] = 0.0, time


@njit
def clean(  # noqa: PLR0913 (kernel)
    i: int,
    time: float,
    field: Field,
    leaders: Leaders,
    crowd: Crowd,
    held: Held,
    at: Int,
    weights: Float,
) -> None:
    """Look for a chair, go to it, take it, take it to its place, put it down.

    A chair that cannot be reached is left; one that cannot be brought to its place is put down.
    """
    task, state, hand = crowd.task, crowd.state, crowd.task[i, columns.HAND]
    if hand < 0 or task[i, columns.FIRST] < 0:
        return
    doing, row = task[i, columns.WALKING], task[i, columns.HELD]
    if doing < columns.TO_CHAIR:
        task[i, columns.WALKING] = columns.CLEANS
        return
    if doing == columns.CLEANS:
        if time >= state[i, columns.FREE_AT]:
            find_work(i, time, field, leaders, crowd)
        return
    place = row_place(i, leaders, crowd)
    late = state[i, columns.BLOCKED] > GIVES_UP_S or time - state[i, columns.BEST_AT] > TRIP_S
    dx = crowd.discs[row, columns.X] - crowd.discs[i, columns.X]
    dy = crowd.discs[row, columns.Y] - crowd.discs[i, columns.Y]
    if doing == columns.TO_CHAIR:
        reach = crowd.discs[i, columns.R] + crowd.discs[row, columns.R]
        if math.sqrt(dx * dx + dy * dy) - reach < NEAR:
            held.at[hand, QB], held.at[hand, VB] = at[row, 0], at[row, 1]
            held.bodies[hand, 0], held.bodies[hand, 1] = weights[row, 0], weights[row, 1]
            held.pose[hand, 0], held.pose[hand, 1] = reach + 0.04, 0.0
            held.pose[hand, 2] = crowd.yaws[row] - math.atan2(dy, dx)
            task[i, columns.WALKING], state[i, columns.BEST_AT] = columns.CARRIES, time
            state[i, columns.BLOCKED] = 0.0
        elif late:
            leaders.lines[place, CHAIR] = -1.0
            next_turn(i, time, leaders, crowd)
        return
    line = leaders.lines[place]
    filling = fills(i, leaders, crowd)
    tx, ty = (line[0], line[1]) if filling else (line[HOME], line[HOME + 1])
    tx, ty = tx - crowd.discs[row, columns.X], ty - crowd.discs[row, columns.Y]
    if late or tx * tx + ty * ty < THERE * THERE:
        held.at[hand, DROPPED] = held.at[hand, VB]
        held.at[hand, QB] = held.at[hand, VB] = -1
        if not filling:
            leaders.lines[place, CHAIR] = -1.0
        next_turn(i, time, leaders, crowd)
