# SPDX-License-Identifier: Apache-2.0
"""Cleaners: who takes chairs to a row at a wall, and later back to where they stood."""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.holding import Held
from sim.actors.people import columns
from sim.actors.people.formation import in_sight, route
from sim.actors.people.leaders import Leaders
from sim.actors.people.right_of_way import Crowd, Float, Int
from sim.core.flow import Field
from slam._jit import inner

_C = ACTORS.cleaning
REACH, NEAR, REST_S = _C.hand_m, _C.near_m, _C.rest_s
PACE, THERE, TRIP_S = _C.pace_mps, _C.there_m, _C.trip_s
GIVES_UP_S = ACTORS.walking.blocked_s


@inner
def next_chair(i: int, field: Field, leaders: Leaders, crowd: Crowd) -> int:
    """Disc row of the nearest chair in sight that stands, and nobody sits on or holds; -1.

    Those that stand in a row of chairs stay there.
    """
    discs, task, best, found = crowd.discs, crowd.task, REACH * REACH, -1
    x, y = discs[i].x, discs[i].y
    for k in range(len(crowd.yaws)):
        if discs[k].kind != columns.CHAIR:
            continue
        dx, dy = discs[k].x - x, discs[k].y - y
        far = dx * dx + dy * dy
        if far >= best or discs[k].u ** 2 + discs[k].v ** 2 > 0.01:
            continue
        taken = False
        for other in range(len(task)):
            taken = taken or task[other].seat == k or task[other].held == k
        for place in range(len(leaders.lines)):
            taken = taken or leaders.lines[place].chair == k
        if not taken and in_sight(field, x, y, x + 0.7 * dx, y + 0.7 * dy):
            best, found = far, k
    return found


@inner
def row_place(i: int, leaders: Leaders, crowd: Crowd) -> int:
    """Row of ``lines`` that is next: the chairs go in, then out again, the last one first."""
    first, turn = crowd.task[i].first, crowd.task[i].place
    n = int(leaders.lines[first].places)
    return int(first + (turn if turn < n else 2 * n - 1 - turn))


@inner
def fills(i: int, leaders: Leaders, crowd: Crowd) -> bool:
    """Whether somebody's row of chairs is being filled, or else emptied."""
    n = int(leaders.lines[crowd.task[i].first].places)
    return bool(crowd.task[i].place < n)


@inner
def next_turn(i: int, time: float, leaders: Leaders, crowd: Crowd) -> None:
    """The next chair, after a rest."""
    n = int(leaders.lines[crowd.task[i].first].places)
    crowd.task[i].place = (crowd.task[i].place + 1) % (2 * n)
    crowd.task[i].walking, crowd.task[i].held = columns.CLEANS, -1
    crowd.state[i].free_at, crowd.state[i].blocked = time + REST_S, 0.0


@inner
def to_what_is_taken(i: int, field: Field, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """The velocity with which person ``i`` goes to the chair to take, or takes it to its place."""
    task = crowd.task[i]
    if task.walking == columns.CLEANS:
        return 0.0, 0.0
    x, y = crowd.discs[i].x, crowd.discs[i].y
    tx, ty = crowd.discs[task.held].x, crowd.discs[task.held].y
    if task.walking == columns.CARRIES:
        line = leaders.lines[row_place(i, leaders, crowd)]
        tx, ty = (line.x, line.y) if fills(i, leaders, crowd) else (line.home_x, line.home_y)
    tx, ty = route(i, tx, ty, field, crowd)
    dx, dy = tx - x, ty - y
    far = math.sqrt(dx * dx + dy * dy)
    speed = min(PACE, 1.5 * far) / max(far, 1e-6)
    return speed * dx + 0.0, speed * dy + 0.0


@inner
def find_work(i: int, time: float, field: Field, leaders: Leaders, crowd: Crowd) -> None:
    """Choose the next chair; where there is none, the row is emptied, or one goes elsewhere."""
    task = crowd.task
    place = row_place(i, leaders, crowd)
    row = int(leaders.lines[place].chair)
    if fills(i, leaders, crowd):
        row = next_chair(i, field, leaders, crowd)
        if row >= 0:
            leaders.lines[place].chair = row
            leaders.lines[place].home_x = crowd.discs[row].x
            leaders.lines[place].home_y = crowd.discs[row].y
            leaders.lines[place].home_yaw = crowd.yaws[row]
    elif row >= 0:
        dx = crowd.discs[row].x - leaders.lines[place].x
        dy = crowd.discs[row].y - leaders.lines[place].y
        if dx * dx + dy * dy > 1.0:  # somebody has taken it away meanwhile
            leaders.lines[place].chair = row = -1
        for other in range(len(task)):
            if row >= 0 and task[other].seat == row:
                leaders.lines[place].chair = row = -1
    if row < 0:
        next_turn(i, time, leaders, crowd)
        return
    task[i].walking, task[i].held = columns.TO_CHAIR, row
    crowd.state[i].blocked, crowd.state[i].best_at = 0.0, time


@inner
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
    task, state, hand = crowd.task, crowd.state, crowd.task[i].hand
    if hand < 0 or task[i].first < 0:
        return
    doing, row = task[i].walking, task[i].held
    if doing < columns.TO_CHAIR:
        task[i].walking = columns.CLEANS
        return
    if doing == columns.CLEANS:
        if time >= state[i].free_at:
            find_work(i, time, field, leaders, crowd)
        return
    place = row_place(i, leaders, crowd)
    late = state[i].blocked > GIVES_UP_S or time - state[i].best_at > TRIP_S
    dx = crowd.discs[row].x - crowd.discs[i].x
    dy = crowd.discs[row].y - crowd.discs[i].y
    if doing == columns.TO_CHAIR:
        reach = crowd.discs[i].r + crowd.discs[row].r
        if math.sqrt(dx * dx + dy * dy) - reach < NEAR:
            held.at[hand].qb, held.at[hand].vb = at[row, 0], at[row, 1]
            held.bodies[hand, 0], held.bodies[hand, 1] = weights[row, 0], weights[row, 1]
            held.pose[hand, 0], held.pose[hand, 1] = reach + 0.04, 0.0
            held.pose[hand, 2] = crowd.yaws[row] - math.atan2(dy, dx)
            task[i].walking, state[i].best_at = columns.CARRIES, time
            state[i].blocked = 0.0
        elif late:
            leaders.lines[place].chair = -1.0
            next_turn(i, time, leaders, crowd)
        return
    line = leaders.lines[place]
    filling = fills(i, leaders, crowd)
    tx, ty = (line.x, line.y) if filling else (line.home_x, line.home_y)
    tx, ty = tx - crowd.discs[row].x, ty - crowd.discs[row].y
    if late or tx * tx + ty * ty < THERE * THERE:
        held.at[hand].dropped = held.at[hand].vb
        held.at[hand].qb = held.at[hand].vb = -1
        if not filling:
            leaders.lines[place].chair = -1.0
        next_turn(i, time, leaders, crowd)
