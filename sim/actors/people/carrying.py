# SPDX-License-Identifier: Apache-2.0
"""Who takes chairs along, and how one walks with something in one's hands."""

from __future__ import annotations

import math

import numpy as np

from sim.actors.config import ACTORS
from sim.actors.holding import DROPPED, QA, QB, VB, Held
from sim.actors.people import columns
from sim.actors.people.formation import in_sight, route
from sim.actors.people.leaders import Leaders
from sim.actors.people.right_of_way import Crowd, Float, Int
from sim.core.flow import Field, clearance_at, time_at
from slam._jit import njit

_C = ACTORS.cleaning
REACH, NEAR, REST_S = _C.hand_m, _C.near_m, _C.rest_s
PACE, THERE, TRIP_S = _C.pace_mps, _C.there_m, _C.trip_s
PEOPLE_STEPS = 2  # of the look ahead, in which people matter
CHAIR, HOME = 3, 4  # columns of ``Leaders.lines``: the chair of a place, and its pose before
GIVES_UP_S = ACTORS.walking.blocked_s
_H = ACTORS.holding
STOP_M, STOP_ROBOT, STOP_WALL = _H.stop_m, _H.stop_robot_m, _H.stop_wall_m
STEP_S, SEES_S, BACKWARDS, BACK = _H.step_s, _H.sees_s, _H.backwards_mps, _H.backwards
HIT, CLOSE_M, CLOSE, TURNING = _H.hit, _H.close_m, _H.close, _H.turning
SLACK, TAUT, TAUT_GAIN = _H.slack_m, _H.taut_m, _H.taut_gain
HURRY, HURRY_MOST = _H.hurry, _H.hurry_most
TURN_GAIN = ACTORS.walking.turn_gain


@njit
def parts_of(i: int, crowd: Crowd, parts: Int) -> int:
    """Disc rows of person ``i`` and what it pushes, into ``parts``; returns how many.

    The end that is farthest ahead comes second.
    """
    discs, yaw = crowd.discs, crowd.yaws[i]
    c, s = math.cos(yaw), math.sin(yaw)
    parts[0], count, first, most = i, 1, 0, -math.inf
    for row in range(len(discs)):
        if crowd.owner[row] == crowd.task[i, columns.HELD] and count < len(parts):
            ahead = discs[row, columns.X] * c + discs[row, columns.Y] * s
            if ahead > most:
                first, most = count, ahead
            parts[count] = row
            count += 1
    if first > 1:
        parts[1], parts[first] = parts[first], parts[1]
    return count


@njit
def part_at(
    part: Float, pivot: Float, yaw: float, v: float, omega: float, t: float
) -> tuple[float, float]:
    """Where a disc is after ``t`` s, if its thing goes ahead at ``v`` and turns at ``omega``."""
    c, s = math.cos(omega * t), math.sin(omega * t)
    dx, dy = part[columns.X] - pivot[columns.X], part[columns.Y] - pivot[columns.Y]
    way, along = v * t, yaw + 0.5 * omega * t
    x = pivot[columns.X] + way * math.cos(along) + c * dx - s * dy
    return x, pivot[columns.Y] + way * math.sin(along) + s * dx + c * dy


@njit
def runs_into(  # noqa: PLR0913 (kernel)
    v: float,
    omega: float,
    parts: Int,
    pivot: Float,
    yaw: float,
    near: Int,
    field: Field,
    crowd: Crowd,
) -> float:
    """Cost of what the parts of a thing would touch soon, going ahead at ``v`` and turning.

    Chairs are pushed along, and people go out of the way in time; the robot is never touched. What
    is too near already may be left.
    """
    discs, closest = crowd.discs, CLOSE_M
    for step in range(1, 5):
        t = STEP_S * step
        on = min(t, SEES_S)
        for p in range(len(parts)):
            part = discs[parts[p]]
            x, y = part_at(part, pivot, yaw, v, omega, t)
            free = clearance_at(field, x, y) - part[columns.R] - STOP_WALL
            if free < 0.0:
                now = clearance_at(field, part[columns.X], part[columns.Y])
                if free < now - part[columns.R] - STOP_WALL - 0.01:
                    return HIT * (1.25 - 0.25 * step) ** 3
            closest = min(closest, free)
            for k in range(len(near)):
                other = discs[near[k]]
                kind = other[columns.KIND]
                if kind == columns.CHAIR or (kind == columns.PERSON and step > PEOPLE_STEPS):
                    continue
                apart = part[columns.R] + other[columns.R]
                apart += STOP_ROBOT if kind == columns.ROBOT else STOP_M
                dx = other[columns.X] + on * other[columns.U] - x
                dy = other[columns.Y] + on * other[columns.V] - y
                if dx * dx + dy * dy < (apart + CLOSE_M) ** 2:
                    free = math.sqrt(dx * dx + dy * dy) - apart
                    if free < 0.0:
                        nx, ny = (
                            other[columns.X] - part[columns.X],
                            other[columns.Y] - part[columns.Y],
                        )
                        if free < math.sqrt(nx * nx + ny * ny) - apart - 0.01:
                            cost = HIT * (1.25 - 0.25 * step) ** 3
                            return 10.0 * cost if kind == columns.ROBOT else cost
                    closest = min(closest, free)
    return CLOSE * (CLOSE_M - closest)


@njit
def pushes(
    i: int, wanted: tuple[float, float], near: Int, field: Field, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of someone who pushes a long thing, by the dynamic window of a long vehicle.

    They walk round it to turn it, about its middle; where there is no room for that they pull it
    back. What stands in the way of any part of it is waited for, but chairs are pushed along.
    """
    pace, yaw = math.sqrt(wanted[0] ** 2 + wanted[1] ** 2), crowd.yaws[i]
    crowd.state[i, columns.LOOK] = yaw
    if pace < 0.05:
        return 0.0, 0.0
    rows = np.empty(8, dtype=np.int64)
    parts = rows[: parts_of(i, crowd, rows)]
    discs, goal = crowd.discs, crowd.task[i, columns.GOAL]
    me, tip, pivot = discs[i], discs[parts[1]], discs[crowd.task[i, columns.HELD]]
    here = time_at(field, goal, me[columns.X], me[columns.Y])
    ahead = min(time_at(field, goal, tip[columns.X], tip[columns.Y]), here + 5.0)
    standing = runs_into(0.0, 0.0, parts, pivot, yaw, near, field, crowd)
    best, best_v, best_omega = ahead + min(standing, CLOSE * CLOSE_M), 0.0, 0.0
    for a in range(-1, 4):
        v = pace * a / 3.0 if a >= 0 else -min(pace, BACKWARDS)
        for b in range(-2, 3):
            omega = 0.5 * b * crowd.state[i, columns.TURN_RATE]
            if a < 0:
                x, y = part_at(me, pivot, yaw, v, omega, 4.0 * STEP_S)
                cost = ahead - BACK * max(here - time_at(field, goal, x, y), -1.0)
            else:
                x, y = part_at(tip, pivot, yaw, v, omega, 4.0 * STEP_S)
                cost = min(time_at(field, goal, x, y), here + 5.0)
            cost += TURNING * abs(omega)
            if v != 0.0 or omega != 0.0:  # who is held up rather backs out or turns than stands
                cost -= min(HURRY * crowd.state[i, columns.BLOCKED], HURRY_MOST)
            if cost < best:
                cost += runs_into(v, omega, parts, pivot, yaw, near, field, crowd)
            if cost < best:
                best, best_v, best_omega = cost, v, omega
    crowd.state[i, columns.LOOK] = yaw + best_omega / TURN_GAIN
    vx = best_v * math.cos(yaw) - best_omega * (me[columns.Y] - pivot[columns.Y])
    return vx, best_v * math.sin(yaw) + best_omega * (me[columns.X] - pivot[columns.X])


@njit
def keep_hold(
    i: int, velocity: tuple[float, float], crowd: Crowd, held: Held, at: Int
) -> tuple[float, float]:
    """The velocity of person ``i`` less what would tear it from the thing it holds."""
    vx, vy = velocity
    row = crowd.task[i, columns.HELD]
    for k in range(len(held.at) if row >= 0 else 0):
        if held.at[k, QA] != at[i, 0] or held.at[k, QB] != at[row, 0]:
            continue
        me, thing = crowd.discs[i], crowd.discs[row]
        c, s = math.cos(crowd.yaws[i]), math.sin(crowd.yaws[i])
        px, py = held.pose[k, 0], held.pose[k, 1]
        ex = me[columns.X] - thing[columns.X] + c * px - s * py
        ey = me[columns.Y] - thing[columns.Y] + s * px + c * py
        if held.hinged[k]:
            ct, st = math.cos(crowd.yaws[row]), math.sin(crowd.yaws[row])
            ex -= px * (c - ct)
            ey -= px * (s - st)
        far = math.sqrt(ex * ex + ey * ey)
        if far < SLACK:
            continue
        away = (vx * ex + vy * ey) / far
        excess = max(away - TAUT_GAIN * (TAUT - far), 0.0)
        vx, vy = vx - excess * ex / far, vy - excess * ey / far
    return vx, vy


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
