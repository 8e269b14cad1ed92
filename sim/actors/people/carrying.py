# SPDX-License-Identifier: Apache-2.0
"""Who takes chairs along, and how one walks with something in one's hands."""

from __future__ import annotations

import math

import numpy as np

from sim.actors.config import ACTORS
from sim.actors.holding import DROPPED, QB, VB, Held
from sim.actors.people import columns
from sim.actors.people.following import in_sight
from sim.actors.people.right_of_way import Crowd, Float, Int
from sim.core.flow import Field, clearance_at, time_at
from slam._jit import njit

_C = ACTORS.cleaning
REACH, NEAR, REST_S = _C.hand_m, _C.near_m, _C.rest_s
GIVES_UP_S = ACTORS.walking.blocked_s
_H = ACTORS.holding
STOP_M, STOP_ROBOT, STOP_WALL = _H.stop_m, _H.stop_robot_m, _H.stop_wall_m
STEP_S, SEES_S, BACKWARDS, BACK = _H.step_s, _H.sees_s, _H.backwards_mps, _H.backwards
HIT, CLOSE_M, CLOSE, TURNING = _H.hit, _H.close_m, _H.close, _H.turning
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
def part_at(  # noqa: PLR0913 (kernel)
    part: Float, pivot: Float, yaw: float, v: float, omega: float, t: float
) -> tuple[float, float]:
    """Where a disc is after ``t`` s, if its thing goes ahead at ``v`` and turns at ``omega``."""
    c, s = math.cos(omega * t), math.sin(omega * t)
    dx, dy = part[columns.X] - pivot[columns.X], part[columns.Y] - pivot[columns.Y]
    way, along = v * t, yaw + 0.5 * omega * t
    x = pivot[columns.X] + way * math.cos(along) + c * dx - s * dy
    return x, pivot[columns.Y] + way * math.sin(along) + s * dx + c * dy


@njit
def runs_into(  # noqa: C901, PLR0913 (kernel)
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

    Chairs are pushed along. What is too near already may be left.
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
                    return HIT * (1.25 - 0.25 * step)
            closest = min(closest, free)
            for k in range(len(near)):
                other = discs[near[k]]
                if other[columns.KIND] == columns.CHAIR:
                    continue
                apart = part[columns.R] + other[columns.R]
                apart += STOP_ROBOT if other[columns.KIND] == columns.ROBOT else STOP_M
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
                            return HIT * (1.25 - 0.25 * step)
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
    best, best_v, best_omega = ahead, 0.0, 0.0
    for a in range(-1, 4):
        v = pace * a / 3.0 if a >= 0 else -min(pace, BACKWARDS)
        for b in range(-2, 3):
            omega = 0.5 * b * crowd.state[i, columns.TURN_RATE]
            if a < 0:
                x, y = part_at(me, pivot, yaw, v, omega, 4.0 * STEP_S)
                cost = ahead - BACK * (here - time_at(field, goal, x, y))
            else:
                x, y = part_at(tip, pivot, yaw, v, omega, 4.0 * STEP_S)
                cost = min(time_at(field, goal, x, y), here + 5.0)
            cost += TURNING * abs(omega)
            if cost < best:
                cost += runs_into(v, omega, parts, pivot, yaw, near, field, crowd)
            if cost < best:
                best, best_v, best_omega = cost, v, omega
    crowd.state[i, columns.LOOK] = yaw + best_omega / TURN_GAIN
    vx = best_v * math.cos(yaw) - best_omega * (me[columns.Y] - pivot[columns.Y])
    return vx, best_v * math.sin(yaw) + best_omega * (me[columns.X] - pivot[columns.X])


@njit
def next_chair(i: int, field: Field, crowd: Crowd) -> int:
    """Disc row of the nearest chair in sight that stands, and nobody sits on or holds; -1."""
    discs, task, best, found = crowd.discs, crowd.task, REACH * REACH, -1
    for k in range(len(crowd.yaws)):
        if discs[k, columns.KIND] != columns.CHAIR:
            continue
        dx, dy = (
            discs[k, columns.X] - discs[i, columns.X],
            discs[k, columns.Y] - discs[i, columns.Y],
        )
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
    dx, dy = (
        discs[row, columns.X] - discs[i, columns.X],
        discs[row, columns.Y] - discs[i, columns.Y],
    )
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
