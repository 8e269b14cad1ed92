# SPDX-License-Identifier: Apache-2.0
"""How people decide, all of them in one compiled call per control tick.

Each person stays somewhere, walks to the next goal down its flow field (``sim.core.flow``) or
follows somebody (``sim.actors.people.following``), gives way at doors, and picks a velocity that
hits nothing soon (``sim.actors.people.avoidance``). A person whose way is blocked by a chair loses
patience and pushes it; now and then one sits down (``sim.actors.people.sitting``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sim.actors.config import ACTORS
from sim.actors.holding import Held
from sim.actors.people import columns
from sim.actors.people.avoidance import ACCEL, choose, spare_robot
from sim.actors.people.carrying import clean, keep_hold, pushes, to_what_is_taken
from sim.actors.people.following import (
    Leaders,
    faces,
    follow,
    is_pushing,
    make_room,
    make_way,
    near_place,
    note_ways,
    rests,
    spread_out,
    stand_in_line,
    wait_behind,
)
from sim.actors.people.right_of_way import (
    OPEN,
    Addresses,
    Crowd,
    Doors,
    Float,
    Int,
    give_turns,
    hold_off,
    round_leaf,
    wait_beside,
)
from sim.actors.people.sitting import Hulls, may_sit, on_chair, sit, to_chair
from sim.core.draws import between, uniform, waiting
from sim.core.flow import FAR, Field, clearance_at, time_at, way_at
from slam._jit import njit

_W = ACTORS.walking
STILL, DOORWAY = _W.still_mps, _W.doorway_m
ARRIVE_LEAST, ARRIVE_MOST = _W.arrive_least_s, _W.arrive_most_s
LOOK_LEAST, LOOK_MOST = _W.look_least_s, _W.look_most_s
NEAR_S, NEAR_BLOCKED, NO_PROGRESS = _W.near_s, _W.near_blocked_s, _W.no_progress_s
SIGHT_M = ACTORS.holding.sight_m
NEAR, CROWD_NEAR = 24, 64  # discs around one that are looked at, without and with a crowd
_S = ACTORS.steering
LANE_HALF, LANE, LANE_SIDE, LANE_WALL = _S.lane_half_m, _S.lane, _S.lane_side_m, _S.lane_wall_m
GIVES_UP, CROWD_GIVES_UP = _W.blocked_s, _W.crowd_blocked_s
PATIENT, CROWD_PATIENT = _W.patient_s, _W.crowd_patient_s
TURN_GAIN, TURN_MOST = _W.turn_gain, _W.turn_most


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
    leaders  who is followed; held  who holds what
    weights  (k, 2) mass kg and yaw inertia kg m2 of each planar disc row
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
    leaders: Leaders
    held: Held
    weights: Float


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
def want(i: int, pace: float, ways: Doors, field: Field, crowd: Crowd) -> tuple[float, float]:
    """The velocity person ``i`` would like to have, other movers aside."""
    discs, state, task = crowd.discs, crowd.state, crowd.task
    if task[i, columns.WALKING] == columns.TO_SEAT:
        return to_chair(i, crowd)
    if task[i, columns.WALKING] != columns.WALKS:
        return 0.0, 0.0
    goal = task[i, columns.GOAL]
    wx, wy = way_at(field, goal, discs[i, columns.X], discs[i, columns.Y])
    left = time_at(field, goal, discs[i, columns.X], discs[i, columns.Y])
    speed = min(pace * state[i, columns.SPEED] * state[i, columns.SLOW], 0.3 + 1.2 * left)
    wx, wy = speed * wx, speed * wy
    if state[i, columns.STAYS] == 0.0:
        wx, wy = keep_right(i, wx, wy, field, discs)
    return at_doors(i, (wx, wy), ways, field, discs)


@njit
def at_doors(
    i: int, wanted: tuple[float, float], ways: Doors, field: Field, discs: Float
) -> tuple[float, float]:
    """The wanted velocity, where it is others' turn to pass a door or the leaf is not open yet."""
    wx, wy = wanted
    for d in range(ways.doors.shape[0]):
        side, turn = ways.sides[i, d], ways.passage[d, columns.TURN]
        if side == 0:
            continue
        if turn != 0.0 and side != turn:
            wx, wy = wait_beside(i, ways.doors[d], side, field, discs)
        elif ways.doors[d, columns.ANGLE] < OPEN:
            wx, wy = hold_off(i, d, (wx, wy), ways, discs)
    return wx, wy


@njit
def keep_right(i: int, wx: float, wy: float, field: Field, discs: Float) -> tuple[float, float]:
    """The wanted velocity of one of a stream, which keeps to the right side of a corridor."""
    x, y = discs[i, columns.X], discs[i, columns.Y]
    speed = math.sqrt(wx * wx + wy * wy)
    if speed < STILL or clearance_at(field, x, y) > LANE_HALF:
        return wx, wy
    rx, ry = wy / speed, -wx / speed
    if clearance_at(field, x + LANE_SIDE * rx, y + LANE_SIDE * ry) < LANE_WALL:
        return wx, wy
    return wx + LANE * speed * rx, wy + LANE * speed * ry


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
def nearby(i: int, crowd: Crowd, sides: Int, near: Int) -> int:
    """Rows of discs within 3 m of person ``i``, into ``near``; returns how many.

    Who holds something looks farther.

    The leaf of a door one wants to pass is no obstacle: ``at_doors`` deals with it; nor is the
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
def steer(i: int, tick: float, vx: float, vy: float, crowd: Crowd, out: Float) -> None:
    """Change towards (vx, vy) as fast as legs allow and face the way; servo targets to ``out``."""
    state, yaw = crowd.state, crowd.yaws[i]
    dvx, dvy = vx - state[i, columns.VX], vy - state[i, columns.VY]
    change = math.sqrt(dvx * dvx + dvy * dvy)
    share = min(1.0, ACCEL * tick / change) if change > 0.0 else 0.0
    state[i, columns.VX] += share * dvx
    state[i, columns.VY] += share * dvy
    heading, most = yaw, state[i, columns.TURN_RATE]
    if on_chair(i, crowd) or is_pushing(i, crowd):
        heading = state[i, columns.LOOK]
    elif state[i, columns.VX] ** 2 + state[i, columns.VY] ** 2 > 0.04:
        heading = math.atan2(state[i, columns.VY], state[i, columns.VX])
    elif crowd.task[i, columns.WALKING] in (columns.STANDS, columns.FOLLOWS, columns.QUEUES):
        heading = state[i, columns.LOOK]
    out[0], out[1] = state[i, columns.VX], state[i, columns.VY]
    out[2] = min(max(TURN_GAIN * wrap(heading - yaw), -most), most)


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


@njit
def wish(i: int, time: float, tick: float, people: People) -> tuple[float, float]:
    """The velocity person ``i`` would like to have, whatever it does; keeps account of the way."""
    crowd, field = people.crowd, people.field
    state, task = crowd.state, crowd.task
    doing = task[i, columns.WALKING]
    if doing < columns.FOLLOWS:
        return want(i, people.rates[1], people.ways, field, crowd)
    if doing == columns.FOLLOWS:
        state[i, columns.LOOK] = faces(i, people.leaders, crowd)
        if rests(i, time, people.leaders, crowd):
            return make_room(i, (0.0, 0.0), field, crowd)
        wx, wy = follow(i, field, people.leaders, crowd)
        wx, wy = round_leaf(i, (wx, wy), people.ways, crowd.discs)
        wx, wy = at_doors(i, (wx, wy), people.ways, field, crowd.discs)
        wx, wy = wait_behind(i, (wx, wy), field, people.leaders, crowd)
        wx, wy = make_room(i, (wx, wy), field, crowd)
        wx, wy = make_way(i, (wx, wy), field, people.leaders, crowd)
    elif doing == columns.QUEUES:
        wx, wy = stand_in_line(i, time, people.leaders, crowd)
    else:
        wx, wy = to_what_is_taken(i, field, people.leaders, crowd)
    if wx * wx + wy * wy > 0.09:
        still = crowd.discs[i, columns.U] ** 2 + crowd.discs[i, columns.V] ** 2 < STILL * STILL
        # Who stands still with the leader has nowhere to get on to.
        waits = still and doing == columns.FOLLOWS and near_place(i, people.leaders, crowd)
        state[i, columns.WALKED_S] += 0.0 if waits else tick
        if still:
            state[i, columns.BLOCKED] += tick
            state[i, columns.BLOCKED_S] += 0.0 if waits else tick
            return wx, wy
    state[i, columns.BLOCKED] = max(0.0, state[i, columns.BLOCKED] - 2.0 * tick)
    return wx, wy


@njit
def decide(clock: tuple[float, float], physics: tuple[Float, Float, Float], people: People) -> None:
    """One tick of all people, from positions to the set points of their servos.

    clock    time s, length of the tick s
    physics  qpos and qvel (read), ctrl (written)
    """
    time, tick = clock
    stay = people.rates[0]
    qpos, qvel, ctrl = physics
    at, field, ways, crowd = people.at, people.field, people.ways, people.crowd
    servos = people.servos
    crowded = (crowd.state[:, columns.DENSE] < 1.0).any()
    near = np.zeros(CROWD_NEAR if crowded else NEAR, dtype=np.int64)
    sense(at, qpos, qvel, ways, crowd)
    note_ways(tick, people.leaders, crowd)
    spread_out(field, people.leaders, crowd)
    for i in range(len(servos)):
        plan(i, time, tick, stay, ways.doors, field, crowd)
        clean(i, time, field, people.leaders, crowd, people.held, at.discs, people.weights)
    give_turns(ways, field, crowd)
    for i in range(len(servos)):
        if on_chair(i, crowd):
            vx, vy = to_chair(i, crowd)
            steer(i, tick, vx, vy, crowd, ctrl[servos[i] : servos[i] + 3])
            continue
        wanted = wish(i, time, tick, people)
        count = nearby(i, crowd, ways.sides, near)
        fade = patience(i, time, crowd)
        if is_pushing(i, crowd):
            vx, vy = pushes(i, wanted, near[:count], field, crowd)
        else:
            vx, vy = choose(i, wanted, near[:count], fade, field, crowd)
        before = vx * vx + vy * vy
        vx, vy = keep_hold(i, (vx, vy), crowd, people.held, at.discs)
        vx, vy = spare_robot(i, (vx, vy), near[:count], crowd)
        if is_pushing(i, crowd):  # nor is a long thing turned into it
            share = min(math.sqrt((vx * vx + vy * vy) / max(before, 1e-9)), 1.0)
            turn = crowd.state[i, columns.LOOK] - crowd.yaws[i]
            crowd.state[i, columns.LOOK] = crowd.yaws[i] + share * turn
        steer(i, tick, vx, vy, crowd, ctrl[servos[i] : servos[i] + 3])
