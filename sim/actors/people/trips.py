# SPDX-License-Identifier: Apache-2.0
"""Where a person goes next, when it has arrived, and when it gives up or loses patience."""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.following import is_pushing
from sim.actors.people.right_of_way import Crowd
from sim.actors.people.sitting import may_sit, sit
from sim.core.draws import between, uniform, waiting
from sim.core.flow import FAR, Field, time_at
from sim.core.state import Records
from slam._jit import inner

_W = ACTORS.walking
STILL, DOORWAY = _W.still_mps, _W.doorway_m
ARRIVE_LEAST, ARRIVE_MOST = _W.arrive_least_s, _W.arrive_most_s
LOOK_LEAST, LOOK_MOST = _W.look_least_s, _W.look_most_s
NEAR_S, NEAR_BLOCKED, NO_PROGRESS = _W.near_s, _W.near_blocked_s, _W.no_progress_s
GIVES_UP, CROWD_GIVES_UP = _W.blocked_s, _W.crowd_blocked_s
PATIENT, CROWD_PATIENT = _W.patient_s, _W.crowd_patient_s


@inner
def new_trip(i: int, time: float, stay: float, field: Field, crowd: Crowd) -> None:
    """Draw the next goal of person ``i`` (always five draws) and set off."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    n_goals = field.times.shape[0]
    offset = 1 + int(uniform(draws, i) * (n_goals - 1))
    goal = task[i].goal
    state[i].arrive = between(draws, i, ARRIVE_LEAST, ARRIVE_MOST)
    wait = waiting(draws, i, 1.0 / stay)
    state[i].stay_until = wait * state[i].stays  # a duration until the arrival
    state[i].look = between(draws, i, -math.pi, math.pi)
    state[i].luck = uniform(draws, i)
    for _ in range(n_goals):
        goal = (task[i].goal + offset) % n_goals
        if (
            crowd.allowed[i, goal]
            and time_at(field, goal, discs[i].x, discs[i].y) < FAR
            and (goal != task[i].goal or state[i].dense == 1.0)
        ):
            break
        offset += 1
    task[i].goal = goal
    task[i].walking = columns.WALKS
    state[i].blocked = 0.0
    state[i].best, state[i].best_at = FAR, time


@inner
def way_left(i: int, field: Field, crowd: Crowd) -> float:
    """s to the goal, of person ``i`` or whatever of the thing it pushes is nearest to it."""
    discs, goal = crowd.discs, crowd.task[i].goal
    left = time_at(field, goal, discs[i].x, discs[i].y)
    if is_pushing(i, crowd):
        for part in range(len(discs)):
            if crowd.owner[part] == crowd.task[i].held:
                left = min(left, time_at(field, goal, discs[part].x, discs[part].y))
    return left


@inner
def arrived(i: int, left: float, doors: Records, discs: Records, state: Records) -> bool:
    """Near enough to the goal, or held up close to it, and not standing in a doorway."""
    for d in range(doors.shape[0]):
        dx, dy = discs[i].x - doors[d].cx, discs[i].y - doors[d].cy
        if dx * dx + dy * dy < DOORWAY * DOORWAY:
            return False
    return left < state[i].arrive or (left < NEAR_S and state[i].blocked > NEAR_BLOCKED)


@inner
def plan(  # noqa: C901, PLR0913 (kernel)
    i: int, time: float, tick: float, stay: float, doors: Records, field: Field, crowd: Crowd
) -> None:
    """Stay, set off, arrive or give up; keeps the account of time walked and blocked."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    look = len(task) + i  # its generator
    sit(i, time, tick, crowd)
    if task[i].walking == columns.TO_SEAT or task[i].walking >= columns.FOLLOWS:
        return
    if task[i].walking != columns.WALKS:
        if time >= state[i].stay_until:
            new_trip(i, time, stay, field, crowd)
        elif task[i].walking == columns.STANDS and time >= state[i].look_until:
            state[i].look = between(draws, look, -math.pi, math.pi)
            state[i].look_until = time + between(draws, look, LOOK_LEAST, LOOK_MOST)
        return
    if state[i].sit > 0.0:  # getting up
        state[i].best_at = time
        return
    left = way_left(i, field, crowd)
    gives_up = CROWD_GIVES_UP if state[i].dense < 1.0 else GIVES_UP
    state[i].walked_s += tick
    if discs[i].u ** 2 + discs[i].v ** 2 < STILL * STILL:
        state[i].blocked += tick
        state[i].blocked_s += tick
    else:
        state[i].blocked = max(0.0, state[i].blocked - 2.0 * tick)
    if left < state[i].best - 0.3:
        state[i].best, state[i].best_at = left, time
    if arrived(i, left, doors, discs, state):
        task[i].walking = columns.STANDS
        state[i].stay_until += time
        state[i].look_until = time + between(draws, look, LOOK_LEAST, LOOK_MOST)
        if task[i].seat < 0 and task[i].hand < 0 and task[i].held < 0:
            may_sit(i, field, crowd)
    elif state[i].blocked > gives_up or time - state[i].best_at > NO_PROGRESS:
        new_trip(i, time, stay, field, crowd)


@inner
def patience(i: int, time: float, crowd: Crowd) -> float:
    """Respect of person ``i`` for chairs and leaves in the way: 1 at first, 0 when worn out.

    It wears out after 0.8 to 1.6 s of standing, or 2 to 4 s of walking about without progress; in a
    crowd after 0.3 to 0.6 s of standing.
    """
    patient = CROWD_PATIENT if crowd.state[i].dense < 1.0 else PATIENT
    stood = (crowd.state[i].blocked - patient) / patient
    lost = (
        (time - crowd.state[i].best_at - 2.0) / 2.0
        if crowd.task[i].walking == columns.WALKS
        else 0.0
    )
    return float(min(max(1.0 - max(stood, lost), 0.0), 1.0))
