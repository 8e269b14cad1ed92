# SPDX-License-Identifier: Apache-2.0
"""How people decide, all of them in one compiled call per control tick.

Each person stays somewhere, walks to the next goal down its flow field (``sim.core.flow``), gives
way at
doors, and picks a velocity that hits nothing soon (``sim.actors.people.avoidance``). A person
whose way is blocked by a chair loses patience and pushes it; now and then one sits down
(``sim.actors.people.sitting``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sim.actors.config import ACTORS
from sim.actors.people.avoidance import ACCEL, choose, spare_robot
from sim.actors.people.right_of_way import (
    ANGLE,
    ARRIVE,
    BEST,
    BEST_AT,
    BLOCKED,
    BLOCKED_S,
    CX,
    CY,
    GOAL,
    KIND,
    LEAF,
    LOOK,
    LOOK_UNTIL,
    LUCK,
    OPEN,
    SEAT,
    SIT,
    SPEED,
    STANDS,
    STAY_UNTIL,
    TO_SEAT,
    TURN,
    VX,
    VY,
    WALKED_S,
    WALKING,
    WALKS,
    WIDTH,
    Addresses,
    Crowd,
    Doors,
    Float,
    Int,
    U,
    V,
    X,
    Y,
    give_turns,
    hold_off,
    wait_beside,
)
from sim.actors.people.sitting import Hulls, may_sit, on_chair, sit, to_chair
from sim.core.draws import between, uniform, waiting
from sim.core.flow import FAR, Field, time_at, way_at
from slam._jit import njit

_W = ACTORS.walking
STILL, DOORWAY = _W.still_mps, _W.doorway_m
ARRIVE_LEAST, ARRIVE_MOST = _W.arrive_least_s, _W.arrive_most_s
LOOK_LEAST, LOOK_MOST = _W.look_least_s, _W.look_most_s
NEAR_S, NEAR_BLOCKED, NO_PROGRESS = _W.near_s, _W.near_blocked_s, _W.no_progress_s
GIVES_UP, TURN_GAIN, TURN_MOST = _W.blocked_s, _W.turn_gain, _W.turn_most


class People(NamedTuple):
    """Everybody in a room, n people.

    alive    whether they move at all
    rates    mean stay s, factor on each one's preferred speed
    at, field, ways, crowd  as in the modules they are from
    servos   (n,) first of the actuators vx, vy, vyaw of each
    torsos   (n, 2) first qpos and dof of each
    limbs    (n, 4) mocap rows of thigh_l, shank_l, thigh_r, shank_r
    feet     (n, 8) of ``sim.actors.people.gait``; sitting (n,) 0 stands to 1 sits
    hulls    what of the model follows who sits
    """

    alive: bool
    rates: tuple[float, float]
    at: Addresses
    field: Field
    ways: Doors
    crowd: Crowd
    servos: Int
    torsos: Int
    limbs: Int
    feet: Float
    sitting: Float
    hulls: Hulls


@njit
def new_trip(i: int, time: float, stay: float, field: Field, crowd: Crowd) -> None:
    """Draw the next goal of person ``i`` (always five draws) and set off."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    n_goals = field.times.shape[0]
    offset = 1 + int(uniform(draws, i) * (n_goals - 1))
    goal = task[i, GOAL]
    state[i, ARRIVE] = between(draws, i, ARRIVE_LEAST, ARRIVE_MOST)
    state[i, STAY_UNTIL] = waiting(draws, i, 1.0 / stay)  # a duration until the arrival
    state[i, LOOK] = between(draws, i, -math.pi, math.pi)
    state[i, LUCK] = uniform(draws, i)
    for _ in range(n_goals):
        goal = (task[i, GOAL] + offset) % n_goals
        if time_at(field, goal, discs[i, X], discs[i, Y]) < FAR:
            break
        offset += 1
    task[i, GOAL] = goal
    task[i, WALKING] = WALKS
    state[i, BLOCKED] = 0.0
    state[i, BEST], state[i, BEST_AT] = FAR, time


@njit
def want(i: int, pace: float, ways: Doors, field: Field, crowd: Crowd) -> tuple[float, float]:
    """The velocity person ``i`` would like to have, other movers aside."""
    discs, state, task = crowd.discs, crowd.state, crowd.task
    if task[i, WALKING] == TO_SEAT:
        return to_chair(i, crowd)
    if task[i, WALKING] != WALKS:
        return 0.0, 0.0
    goal = task[i, GOAL]
    wx, wy = way_at(field, goal, discs[i, X], discs[i, Y])
    left = time_at(field, goal, discs[i, X], discs[i, Y])
    speed = min(pace * state[i, SPEED], 0.3 + 1.2 * left)
    wx, wy = speed * wx, speed * wy
    for d in range(ways.doors.shape[0]):
        side, turn = ways.sides[i, d], ways.passage[d, TURN]
        if side == 0:
            continue
        if turn != 0.0 and side != turn:
            wx, wy = wait_beside(i, ways.doors[d], side, field, discs)
        elif ways.doors[d, ANGLE] < OPEN:
            wx, wy = hold_off(i, d, (wx, wy), ways, discs)
    return wx, wy


@njit
def arrived(i: int, left: float, doors: Float, discs: Float, state: Float) -> bool:
    """Near enough to the goal, or held up close to it, and not standing in a doorway."""
    for d in range(doors.shape[0]):
        dx, dy = discs[i, X] - doors[d, CX], discs[i, Y] - doors[d, CY]
        if dx * dx + dy * dy < DOORWAY * DOORWAY:
            return False
    return left < state[i, ARRIVE] or (left < NEAR_S and state[i, BLOCKED] > NEAR_BLOCKED)


@njit
def plan(  # noqa: C901, PLR0913 (kernel)
    i: int, time: float, tick: float, stay: float, doors: Float, field: Field, crowd: Crowd
) -> None:
    """Stay, set off, arrive or give up; keeps the account of time walked and blocked."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    look = len(task) + i  # its generator
    sit(i, time, tick, crowd)
    if task[i, WALKING] == TO_SEAT:
        return
    if task[i, WALKING] != WALKS:
        if time >= state[i, STAY_UNTIL]:
            new_trip(i, time, stay, field, crowd)
        elif task[i, WALKING] == STANDS and time >= state[i, LOOK_UNTIL]:
            state[i, LOOK] = between(draws, look, -math.pi, math.pi)
            state[i, LOOK_UNTIL] = time + between(draws, look, LOOK_LEAST, LOOK_MOST)
        return
    if state[i, SIT] > 0.0:  # getting up
        state[i, BEST_AT] = time
        return
    left = time_at(field, task[i, GOAL], discs[i, X], discs[i, Y])
    state[i, WALKED_S] += tick
    if discs[i, U] ** 2 + discs[i, V] ** 2 < STILL * STILL:
        state[i, BLOCKED] += tick
        state[i, BLOCKED_S] += tick
    else:
        state[i, BLOCKED] = max(0.0, state[i, BLOCKED] - 2.0 * tick)
    if left < state[i, BEST] - 0.3:
        state[i, BEST], state[i, BEST_AT] = left, time
    if arrived(i, left, doors, discs, state):
        task[i, WALKING] = STANDS
        state[i, STAY_UNTIL] += time
        state[i, LOOK_UNTIL] = time + between(draws, look, LOOK_LEAST, LOOK_MOST)
        if task[i, SEAT] < 0:
            may_sit(i, field, crowd)
    elif state[i, BLOCKED] > GIVES_UP or time - state[i, BEST_AT] > NO_PROGRESS:
        new_trip(i, time, stay, field, crowd)


@njit
def nearby(i: int, seat: int, discs: Float, sides: Int, near: Int) -> int:
    """Rows of ``discs`` within 3 m of person ``i``, into ``near``; returns how many.

    The leaf of a door one wants to pass is no obstacle: ``at_door`` deals with it; nor is the chair
    in row ``seat`` that one sits down on.
    """
    count = 0
    for k in range(discs.shape[0]):
        dx, dy = discs[k, X] - discs[i, X], discs[k, Y] - discs[i, Y]
        if k in (i, seat) or dx * dx + dy * dy > 9.0 or count == len(near):
            continue
        if discs[k, KIND] >= LEAF and sides[i, int(discs[k, KIND] - LEAF)] != 0:
            continue
        near[count] = k
        count += 1
    return count


@njit
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@njit
def sense(at: Addresses, qpos: Float, qvel: Float, ways: Doors, crowd: Crowd) -> None:
    """Read discs, headings, door angles and the discs that stand for the leaves."""
    discs, k = crowd.discs, at.discs.shape[0]
    for row in range(k):
        q, v = at.discs[row]
        discs[row, X], discs[row, Y] = qpos[q], qpos[q + 1]
        discs[row, U], discs[row, V] = qvel[v], qvel[v + 1]
        if row < len(crowd.yaws):
            crowd.yaws[row] = qpos[q + 2]
    for d in range(at.doors.shape[0]):
        q, v = at.doors[d]
        x, y, closed, sign = at.hinges[d]
        ways.doors[d, ANGLE] = qpos[q]
        c, s = math.cos(closed + sign * qpos[q]), math.sin(closed + sign * qpos[q])
        for part in range(3):
            row = k + 3 * d + part
            length = (0.35 + 0.3 * part) * ways.doors[d, WIDTH]
            discs[row, X], discs[row, Y] = x + length * c, y + length * s
            discs[row, U] = -length * s * sign * qvel[v]
            discs[row, V] = length * c * sign * qvel[v]


@njit
def steer(i: int, tick: float, vx: float, vy: float, crowd: Crowd, out: Float) -> None:
    """Change towards (vx, vy) as fast as legs allow and face the way; servo targets to ``out``."""
    state, yaw = crowd.state, crowd.yaws[i]
    dvx, dvy = vx - state[i, VX], vy - state[i, VY]
    change = math.sqrt(dvx * dvx + dvy * dvy)
    share = min(1.0, ACCEL * tick / change) if change > 0.0 else 0.0
    state[i, VX] += share * dvx
    state[i, VY] += share * dvy
    heading = yaw
    if on_chair(i, crowd):
        heading = state[i, LOOK]
    elif state[i, VX] ** 2 + state[i, VY] ** 2 > 0.04:
        heading = math.atan2(state[i, VY], state[i, VX])
    elif crowd.task[i, WALKING] == STANDS:
        heading = state[i, LOOK]
    out[0], out[1] = state[i, VX], state[i, VY]
    out[2] = min(max(TURN_GAIN * wrap(heading - yaw), -TURN_MOST), TURN_MOST)


@njit
def patience(i: int, time: float, crowd: Crowd) -> float:
    """Respect of person ``i`` for chairs and leaves in the way: 1 at first, 0 when worn out.

    It wears out after 0.8 to 1.6 s of standing, or 2 to 4 s of walking about without progress.
    """
    stood = (crowd.state[i, BLOCKED] - 0.8) / 0.8
    lost = (time - crowd.state[i, BEST_AT] - 2.0) / 2.0 if crowd.task[i, WALKING] == WALKS else 0.0
    return float(min(max(1.0 - max(stood, lost), 0.0), 1.0))


@njit
def decide(clock: tuple[float, float], physics: tuple[Float, Float, Float], people: People) -> None:
    """One tick of all people, from positions to the set points of their servos.

    clock    time s, length of the tick s
    physics  qpos and qvel (read), ctrl (written)
    """
    time, tick = clock
    stay, pace = people.rates
    qpos, qvel, ctrl = physics
    at, field, ways, crowd = people.at, people.field, people.ways, people.crowd
    servos = people.servos
    near = np.zeros(24, dtype=np.int64)
    sense(at, qpos, qvel, ways, crowd)
    for i in range(len(servos)):
        plan(i, time, tick, stay, ways.doors, field, crowd)
    give_turns(ways, field, crowd)
    for i in range(len(servos)):
        if on_chair(i, crowd):
            vx, vy = to_chair(i, crowd)
            steer(i, tick, vx, vy, crowd, ctrl[servos[i] : servos[i] + 3])
            continue
        wanted = want(i, pace, ways, field, crowd)
        count = nearby(i, crowd.task[i, SEAT], crowd.discs, ways.sides, near)
        fade = patience(i, time, crowd)
        chosen = choose(i, wanted, near[:count], fade, field, crowd)
        vx, vy = spare_robot(i, chosen, near[:count], crowd.discs)
        steer(i, tick, vx, vy, crowd, ctrl[servos[i] : servos[i] + 3])
