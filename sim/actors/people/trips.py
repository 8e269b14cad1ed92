# SPDX-License-Identifier: Apache-2.0
"""Where a person goes next, when it has arrived, and when it gives up or loses patience."""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.following import is_pushing
from sim.actors.people.right_of_way import Crowd, Float
from sim.actors.people.sitting import may_sit, sit
from sim.core.draws import between, uniform, waiting
from sim.core.flow import FAR, Field, time_at
from slam._jit import njit

_W = ACTORS.walking
STILL, DOORWAY = _W.still_mps, _W.doorway_m
ARRIVE_LEAST, ARRIVE_MOST = _W.arrive_least_s, _W.arrive_most_s
LOOK_LEAST, LOOK_MOST = _W.look_least_s, _W.look_most_s
NEAR_S, NEAR_BLOCKED, NO_PROGRESS = _W.near_s, _W.near_blocked_s, _W.no_progress_s
GIVES_UP, CROWD_GIVES_UP = _W.blocked_s, _W.crowd_blocked_s
PATIENT, CROWD_PATIENT = _W.patient_s, _W.crowd_patient_s


@njit
def new_trip(i: int, time: float, stay: float, field: Field, crowd: Crowd) -> None:
    """Draw the next goal of person ``i`` (always five draws) and set off."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    n_goals = field.times.shape[0]
    offset = 1 + int(uniform(draws, i) * (n_goals - 1))
    goal = task[i, columns.GOAL]
    state[i, columns.ARRIVE] = between(draws, i, ARRIVE_LEAST, ARRIVE_MOST)
    wait = waiting(draws, i, 1.0 / stay)
    state[i, columns.STAY_UNTIL] = wait * state[i, columns.STAYS]  # a duration until the arrival
    state[i, columns.LOOK] = between(draws, i, -math.pi, math.pi)
    state[i, columns.LUCK] = uniform(draws, i)
    for _ in range(n_goals):
        goal = (task[i, columns.GOAL] + offset) % n_goals
        if (
            crowd.allowed[i, goal]
            and time_at(field, goal, discs[i, columns.X], discs[i, columns.Y]) < FAR
            and (goal != task[i, columns.GOAL] or state[i, columns.DENSE] == 1.0)
        ):
            break
        offset += 1
    task[i, columns.GOAL] = goal
    task[i, columns.WALKING] = columns.WALKS
    state[i, columns.BLOCKED] = 0.0
    state[i, columns.BEST], state[i, columns.BEST_AT] = FAR, time


@njit
def way_left(i: int, field: Field, crowd: Crowd) -> float:
    """s to the goal, of person ``i`` or whatever of the thing it pushes is nearest to it."""
    discs, goal = crowd.discs, crowd.task[i, columns.GOAL]
    left = time_at(field, goal, discs[i, columns.X], discs[i, columns.Y])
    if is_pushing(i, crowd):
        for part in range(len(discs)):
            if crowd.owner[part] == crowd.task[i, columns.HELD]:
                left = min(
                    left, time_at(field, goal, discs[part, columns.X], discs[part, columns.Y])
                )
    return left


@njit
def arrived(i: int, left: float, doors: Float, discs: Float, state: Float) -> bool:
    """Near enough to the goal, or held up close to it, and not standing in a doorway."""
    for d in range(doors.shape[0]):
        dx, dy = (
            discs[i, columns.X] - doors[d, columns.CX],
            discs[i, columns.Y] - doors[d, columns.CY],
        )
        if dx * dx + dy * dy < DOORWAY * DOORWAY:
            return False
    return left < state[i, columns.ARRIVE] or (
        left < NEAR_S and state[i, columns.BLOCKED] > NEAR_BLOCKED
    )


@njit
def plan(  # noqa: C901, PLR0913 (kernel)
    i: int, time: float, tick: float, stay: float, doors: Float, field: Field, crowd: Crowd
) -> None:
    """Stay, set off, arrive or give up; keeps the account of time walked and blocked."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    look = len(task) + i  # its generator
    sit(i, time, tick, crowd)
    if task[i, columns.WALKING] == columns.TO_SEAT or task[i, columns.WALKING] >= columns.FOLLOWS:
        return
    if task[i, columns.WALKING] != columns.WALKS:
        if time >= state[i, columns.STAY_UNTIL]:
            new_trip(i, time, stay, field, crowd)
        elif task[i, columns.WALKING] == columns.STANDS and time >= state[i, columns.LOOK_UNTIL]:
            state[i, columns.LOOK] = between(draws, look, -math.pi, math.pi)
            state[i, columns.LOOK_UNTIL] = time + between(draws, look, LOOK_LEAST, LOOK_MOST)
        return
    if state[i, columns.SIT] > 0.0:  # getting up
        state[i, columns.BEST_AT] = time
        return
    left = way_left(i, field, crowd)
    gives_up = CROWD_GIVES_UP if state[i, columns.DENSE] < 1.0 else GIVES_UP
    state[i, columns.WALKED_S] += tick
    if discs[i, columns.U] ** 2 + discs[i, columns.V] ** 2 < STILL * STILL:
        state[i, columns.BLOCKED] += tick
        state[i, columns.BLOCKED_S] += tick
    else:
        state[i, columns.BLOCKED] = max(0.0, state[i, columns.BLOCKED] - 2.0 * tick)
    if left < state[i, columns.BEST] - 0.3:
        state[i, columns.BEST], state[i, columns.BEST_AT] = left, time
    if arrived(i, left, doors, discs, state):
        task[i, columns.WALKING] = columns.STANDS
        state[i, columns.STAY_UNTIL] += time
        state[i, columns.LOOK_UNTIL] = time + between(draws, look, LOOK_LEAST, LOOK_MOST)
        if task[i, columns.SEAT] < 0 and task[i, columns.HAND] < 0 and task[i, columns.HELD] < 0:
            may_sit(i, field, crowd)
    elif state[i, columns.BLOCKED] > gives_up or time - state[i, columns.BEST_AT] > NO_PROGRESS:
        new_trip(i, time, stay, field, crowd)


@njit
def patience(i: int, time: float, crowd: Crowd) -> float:
    """Respect of person ``i`` for chairs and leaves in the way: 1 at first, 0 when worn out.

    It wears out after 0.8 to 1.6 s of standing, or 2 to 4 s of walking about without progress; in a
    crowd after 0.3 to 0.6 s of standing.
    """
    patient = CROWD_PATIENT if crowd.state[i, columns.DENSE] < 1.0 else PATIENT
    stood = (crowd.state[i, columns.BLOCKED] - patient) / patient
    lost = (
        (time - crowd.state[i, columns.BEST_AT] - 2.0) / 2.0
        if crowd.task[i, columns.WALKING] == columns.WALKS
        else 0.0
    )
    return float(min(max(1.0 - max(stood, lost), 0.0), 1.0))
