# SPDX-License-Identifier: Apache-2.0
"""Where a person goes next, when it has arrived, when it gives up or loses patience, and who sits.

Now and then somebody goes to a free chair, sits, gets up and leaves. What a scanner below the knee
sees of it: two shanks that stand still in front of a chair's column, and a chair that comes along
when its sitter shifts. Sitter and chair do not collide with each other from the moment one sits
down until they are apart again (``dress``).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.actors.config import SIT, WALK
from sim.actors.people import columns
from sim.actors.people.following import is_pushing
from sim.actors.people.gait import HIP, SEAT_HEIGHT
from sim.actors.people.right_of_way import Crowd, Int
from sim.core.flow import FAR, Field, clearance_at, time_at
from sim.core.seeds import between, uniform, waiting
from sim.core.state import Records
from slam._jit import inner, uncounted
from slam.frames import Float

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


@uncounted
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
    best, found = SIT.hand_m * SIT.hand_m, -1
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
        open_way = clearance_at(field, discs[k].x, discs[k].y) > SIT.room_m
        for part in range(1, 5):
            x, y = discs[i].x + 0.2 * part * dx, discs[i].y + 0.2 * part * dy
            open_way = open_way and clearance_at(field, x, y) > 0.25
        if open_way and not taken:
            best, found = far, k
    return found


@inner
def may_sit(i: int, field: Field, crowd: Crowd) -> None:
    """On arrival: perhaps go on to a chair."""
    if crowd.state[i].luck < SIT.share:
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
        if apart < SIT.near_m:
            task[i].walking = columns.SEATED
            state[i].stay_until += (SIT.stay - 1.0) * max(state[i].stay_until - time, 0.0) + 2.0
        elif state[i].blocked > SIT.give_up_s or far > SIT.hand_m + 1.0:
            task[i].walking, task[i].seat = columns.STANDS, -1
    elif task[i].walking == columns.SEATED:
        state[i].look = crowd.yaws[seat]
        if far < 0.15:
            state[i].sit = min(state[i].sit + tick / SIT.down_s, 1.0)
    else:
        state[i].sit = max(state[i].sit - tick / SIT.down_s, 0.0)
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
    speed = min(SIT.pace_mps, 3.0 * far) / max(far, 1e-6)
    return speed * dx + 0.0, speed * dy + 0.0


@inner
def new_trip(i: int, time: float, stay: float, field: Field, crowd: Crowd) -> None:
    """Draw the next goal of person ``i`` (always five draws) and set off."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    n_goals = field.times.shape[0]
    offset = 1 + int(uniform(draws, i) * (n_goals - 1))
    goal = task[i].goal
    state[i].arrive = between(draws, i, WALK.arrive_least_s, WALK.arrive_most_s)
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
        if dx * dx + dy * dy < WALK.doorway_m * WALK.doorway_m:
            return False
    return left < state[i].arrive or (left < WALK.near_s and state[i].blocked > WALK.near_blocked_s)


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
            state[i].look_until = time + between(draws, look, WALK.look_least_s, WALK.look_most_s)
        return
    if state[i].sit > 0.0:  # getting up
        state[i].best_at = time
        return
    left = way_left(i, field, crowd)
    gives_up = WALK.crowd_blocked_s if state[i].dense < 1.0 else WALK.blocked_s
    state[i].walked_s += tick
    if discs[i].u ** 2 + discs[i].v ** 2 < WALK.still_mps * WALK.still_mps:
        state[i].blocked += tick
        state[i].blocked_s += tick
    else:
        state[i].blocked = max(0.0, state[i].blocked - 2.0 * tick)
    if left < state[i].best - 0.3:
        state[i].best, state[i].best_at = left, time
    if arrived(i, left, doors, discs, state):
        task[i].walking = columns.STANDS
        state[i].stay_until += time
        state[i].look_until = time + between(draws, look, WALK.look_least_s, WALK.look_most_s)
        if task[i].seat < 0 and task[i].hand < 0 and task[i].held < 0:
            may_sit(i, field, crowd)
    elif state[i].blocked > gives_up or time - state[i].best_at > WALK.no_progress_s:
        new_trip(i, time, stay, field, crowd)


@inner
def patience(i: int, time: float, crowd: Crowd) -> float:
    """Respect of person ``i`` for chairs and leaves in the way: 1 at first, 0 when worn out.

    It wears out after 0.8 to 1.6 s of standing, or 2 to 4 s of walking about without progress; in a
    crowd after 0.3 to 0.6 s of standing.
    """
    patient = WALK.crowd_patient_s if crowd.state[i].dense < 1.0 else WALK.patient_s
    stood = (crowd.state[i].blocked - patient) / patient
    lost = (
        (time - crowd.state[i].best_at - 2.0) / 2.0
        if crowd.task[i].walking == columns.WALKS
        else 0.0
    )
    return float(min(max(1.0 - max(stood, lost), 0.0), 1.0))
