# SPDX-License-Identifier: Apache-2.0
"""How one walks with something in one's hands, or pushes something long before one."""

from __future__ import annotations

import math

import numpy as np

from sim.actors.config import ACTORS
from sim.actors.holding import Held
from sim.actors.people import columns
from sim.actors.people.right_of_way import Crowd, Int
from sim.core.flow import Field, clearance_at, time_at
from sim.core.state import Record
from slam._jit import inner

PEOPLE_STEPS = 2  # of the look ahead, in which people matter
_H = ACTORS.holding
STOP_M, STOP_ROBOT, STOP_WALL = _H.stop_m, _H.stop_robot_m, _H.stop_wall_m
STEP_S, SEES_S, BACKWARDS, BACK = _H.step_s, _H.sees_s, _H.backwards_mps, _H.backwards
HIT, CLOSE_M, CLOSE, TURNING = _H.hit, _H.close_m, _H.close, _H.turning
SLACK, TAUT, TAUT_GAIN = _H.slack_m, _H.taut_m, _H.taut_gain
HURRY, HURRY_MOST = _H.hurry, _H.hurry_most
TURN_GAIN = ACTORS.walking.turn_gain


@inner
def parts_of(i: int, crowd: Crowd, parts: Int) -> int:
    """Disc rows of person ``i`` and what it pushes, into ``parts``; returns how many.

    The end that is farthest ahead comes second.
    """
    discs, yaw = crowd.discs, crowd.yaws[i]
    c, s = math.cos(yaw), math.sin(yaw)
    parts[0], count, first, most = i, 1, 0, -math.inf
    for row in range(len(discs)):
        if crowd.owner[row] == crowd.task[i].held and count < len(parts):
            ahead = discs[row].x * c + discs[row].y * s
            if ahead > most:
                first, most = count, ahead
            parts[count] = row
            count += 1
    if first > 1:
        parts[1], parts[first] = parts[first], parts[1]
    return count


@inner
def part_at(
    part: Record, pivot: Record, yaw: float, v: float, omega: float, t: float
) -> tuple[float, float]:
    """Where a disc is after ``t`` s, if its thing goes ahead at ``v`` and turns at ``omega``."""
    c, s = math.cos(omega * t), math.sin(omega * t)
    dx, dy = part.x - pivot.x, part.y - pivot.y
    way, along = v * t, yaw + 0.5 * omega * t
    x = pivot.x + way * math.cos(along) + c * dx - s * dy
    return x, pivot.y + way * math.sin(along) + s * dx + c * dy


@inner
def runs_into(  # noqa: PLR0913 (kernel)
    v: float,
    omega: float,
    parts: Int,
    pivot: Record,
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
            free = clearance_at(field, x, y) - part.r - STOP_WALL
            if free < 0.0:
                now = clearance_at(field, part.x, part.y)
                if free < now - part.r - STOP_WALL - 0.01:
                    return HIT * (1.25 - 0.25 * step) ** 3
            closest = min(closest, free)
            for k in range(len(near)):
                other = discs[near[k]]
                kind = other.kind
                if kind == columns.CHAIR or (kind == columns.PERSON and step > PEOPLE_STEPS):
                    continue
                apart = part.r + other.r
                apart += STOP_ROBOT if kind == columns.ROBOT else STOP_M
                dx = other.x + on * other.u - x
                dy = other.y + on * other.v - y
                if dx * dx + dy * dy < (apart + CLOSE_M) ** 2:
                    free = math.sqrt(dx * dx + dy * dy) - apart
                    if free < 0.0:
                        nx, ny = other.x - part.x, other.y - part.y
                        if free < math.sqrt(nx * nx + ny * ny) - apart - 0.01:
                            cost = HIT * (1.25 - 0.25 * step) ** 3
                            return 10.0 * cost if kind == columns.ROBOT else cost
                    closest = min(closest, free)
    return CLOSE * (CLOSE_M - closest)


@inner
def pushes(
    i: int, wanted: tuple[float, float], near: Int, field: Field, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of someone who pushes a long thing, by the dynamic window of a long vehicle.

    They walk round it to turn it, about its middle; where there is no room for that they pull it
    back. What stands in the way of any part of it is waited for, but chairs are pushed along.
    """
    pace, yaw = math.sqrt(wanted[0] ** 2 + wanted[1] ** 2), crowd.yaws[i]
    crowd.state[i].look = yaw
    if pace < 0.05:
        return 0.0, 0.0
    rows = np.empty(8, dtype=np.int64)
    parts = rows[: parts_of(i, crowd, rows)]
    discs, goal = crowd.discs, crowd.task[i].goal
    me, tip, pivot = discs[i], discs[parts[1]], discs[crowd.task[i].held]
    here = time_at(field, goal, me.x, me.y)
    ahead = min(time_at(field, goal, tip.x, tip.y), here + 5.0)
    standing = runs_into(0.0, 0.0, parts, pivot, yaw, near, field, crowd)
    best, best_v, best_omega = ahead + min(standing, CLOSE * CLOSE_M), 0.0, 0.0
    for a in range(-1, 4):
        v = pace * a / 3.0 if a >= 0 else -min(pace, BACKWARDS)
        for b in range(-2, 3):
            omega = 0.5 * b * crowd.state[i].turn_rate
            if a < 0:
                x, y = part_at(me, pivot, yaw, v, omega, 4.0 * STEP_S)
                cost = ahead - BACK * max(here - time_at(field, goal, x, y), -1.0)
            else:
                x, y = part_at(tip, pivot, yaw, v, omega, 4.0 * STEP_S)
                cost = min(time_at(field, goal, x, y), here + 5.0)
            cost += TURNING * abs(omega)
            if v != 0.0 or omega != 0.0:  # who is held up rather backs out or turns than stands
                cost -= min(HURRY * crowd.state[i].blocked, HURRY_MOST)
            if cost < best:
                cost += runs_into(v, omega, parts, pivot, yaw, near, field, crowd)
            if cost < best:
                best, best_v, best_omega = cost, v, omega
    crowd.state[i].look = yaw + best_omega / TURN_GAIN
    vx = best_v * math.cos(yaw) - best_omega * (me.y - pivot.y)
    return vx, best_v * math.sin(yaw) + best_omega * (me.x - pivot.x)


@inner
def keep_hold(
    i: int, velocity: tuple[float, float], crowd: Crowd, held: Held, at: Int
) -> tuple[float, float]:
    """The velocity of person ``i`` less what would tear it from the thing it holds."""
    vx, vy = velocity
    row = crowd.task[i].held
    for k in range(len(held.at) if row >= 0 else 0):
        if held.at[k].qa != at[i, 0] or held.at[k].qb != at[row, 0]:
            continue
        me, thing = crowd.discs[i], crowd.discs[row]
        c, s = math.cos(crowd.yaws[i]), math.sin(crowd.yaws[i])
        px, py = held.pose[k, 0], held.pose[k, 1]
        ex = me.x - thing.x + c * px - s * py
        ey = me.y - thing.y + s * px + c * py
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
