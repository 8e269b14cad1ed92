# SPDX-License-Identifier: Apache-2.0
"""How one walks with something in one's hands or pushes something long, and how cleaners do.

Cleaners take chairs to a row at a wall, and later back to where they stood.
"""

import math

from sim.actors.config import CLEAN, HOLD, WALK
from sim.actors.holding import Held
from sim.actors.people import columns
from sim.actors.people.following import in_sight, route
from sim.actors.people.leaders import Leaders
from sim.actors.people.right_of_way import Crowd, Int
from sim.core.flow import Field, clearance_at, time_at
from sim.core.state import Record
from slam._jit import inner
from slam.frames import Float

PEOPLE_STEPS = 2  # of the look ahead, in which people matter


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
    discs, closest = crowd.discs, HOLD.close_m
    for step in range(1, 5):
        t = HOLD.step_s * step
        on = min(t, HOLD.sees_s)
        for p in range(len(parts)):
            part = discs[parts[p]]
            x, y = part_at(part, pivot, yaw, v, omega, t)
            free = clearance_at(field, x, y) - part.r - HOLD.stop_wall_m
            if free < 0.0:
                now = clearance_at(field, part.x, part.y)
                if free < now - part.r - HOLD.stop_wall_m - 0.01:
                    return HOLD.hit * (1.25 - 0.25 * step) ** 3
            closest = min(closest, free)
            for k in range(len(near)):
                other = discs[near[k]]
                kind = other.kind
                if kind == columns.CHAIR or (kind == columns.PERSON and step > PEOPLE_STEPS):
                    continue
                apart = part.r + other.r
                apart += HOLD.stop_robot_m if kind == columns.ROBOT else HOLD.stop_m
                dx = other.x + on * other.u - x
                dy = other.y + on * other.v - y
                if dx * dx + dy * dy < (apart + HOLD.close_m) ** 2:
                    free = math.sqrt(dx * dx + dy * dy) - apart
                    if free < 0.0:
                        nx, ny = other.x - part.x, other.y - part.y
                        if free < math.sqrt(nx * nx + ny * ny) - apart - 0.01:
                            cost = HOLD.hit * (1.25 - 0.25 * step) ** 3
                            return 10.0 * cost if kind == columns.ROBOT else cost
                    closest = min(closest, free)
    return HOLD.close * (HOLD.close_m - closest)


@inner
def pushes(  # noqa: PLR0913 (kernel)
    i: int, wanted: tuple[float, float], near: Int, field: Field, crowd: Crowd, rows: Int,
    held: Held | None,
) -> tuple[float, float]:  # fmt: skip
    """The velocity of someone who pushes a long thing, by the dynamic window of a long vehicle.

    They walk round it to turn it, about its middle; where there is no room for that they pull it
    back. What stands in the way of any part of it is waited for, but chairs are pushed along.
    rows: scratch.
    """
    if held is None:
        return wanted
    pace, yaw = math.sqrt(wanted[0] ** 2 + wanted[1] ** 2), crowd.yaws[i]
    crowd.state[i].look = yaw
    if pace < 0.05:
        return 0.0, 0.0
    parts = rows[: parts_of(i, crowd, rows)]
    discs, goal = crowd.discs, crowd.task[i].goal
    me, tip, pivot = discs[i], discs[parts[1]], discs[crowd.task[i].held]
    here = time_at(field, goal, me.x, me.y)
    ahead = min(time_at(field, goal, tip.x, tip.y), here + 5.0)
    standing = runs_into(0.0, 0.0, parts, pivot, yaw, near, field, crowd)
    best, best_v, best_omega = ahead + min(standing, HOLD.close * HOLD.close_m), 0.0, 0.0
    for a in range(-1, 4):
        v = pace * a / 3.0 if a >= 0 else -min(pace, HOLD.backwards_mps)
        for b in range(-2, 3):
            omega = 0.5 * b * crowd.state[i].turn_rate
            if a < 0:
                x, y = part_at(me, pivot, yaw, v, omega, 4.0 * HOLD.step_s)
                cost = ahead - HOLD.backwards * max(here - time_at(field, goal, x, y), -1.0)
            else:
                x, y = part_at(tip, pivot, yaw, v, omega, 4.0 * HOLD.step_s)
                cost = min(time_at(field, goal, x, y), here + 5.0)
            cost += HOLD.turning * abs(omega)
            if v != 0.0 or omega != 0.0:  # who is held up rather backs out or turns than stands
                cost -= min(HOLD.hurry * crowd.state[i].blocked, HOLD.hurry_most)
            if cost < best:
                cost += runs_into(v, omega, parts, pivot, yaw, near, field, crowd)
            if cost < best:
                best, best_v, best_omega = cost, v, omega
    crowd.state[i].look = yaw + best_omega / WALK.turn_gain
    vx = best_v * math.cos(yaw) - best_omega * (me.y - pivot.y)
    return vx, best_v * math.sin(yaw) + best_omega * (me.x - pivot.x)


@inner
def keep_hold(
    i: int, velocity: tuple[float, float], crowd: Crowd, held: Held | None, at: Int
) -> tuple[float, float]:
    """The velocity of person ``i`` less what would tear it from the thing it holds."""
    if held is None:
        return velocity
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
        if far < HOLD.slack_m:
            continue
        away = (vx * ex + vy * ey) / far
        excess = max(away - HOLD.taut_gain * (HOLD.taut_m - far), 0.0)
        vx, vy = vx - excess * ex / far, vy - excess * ey / far
    return vx, vy


@inner
def next_chair(i: int, field: Field, leaders: Leaders, crowd: Crowd) -> int:
    """Disc row of the nearest chair in sight that stands, and nobody sits on or holds; -1.

    Those that stand in a row of chairs stay there.
    """
    discs, task, best, found = crowd.discs, crowd.task, CLEAN.hand_m * CLEAN.hand_m, -1
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
    crowd.state[i].free_at, crowd.state[i].blocked = time + CLEAN.rest_s, 0.0


@inner
def to_what_is_taken(
    i: int, field: Field, leaders: Leaders, crowd: Crowd, held: Held | None
) -> tuple[float, float]:
    """The velocity with which person ``i`` goes to the chair to take, or takes it to its place."""
    if held is None:
        return 0.0, 0.0
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
    speed = min(CLEAN.pace_mps, 1.5 * far) / max(far, 1e-6)
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
def clean(  # noqa: C901, PLR0913 (kernel)
    i: int,
    time: float,
    field: Field,
    leaders: Leaders,
    crowd: Crowd,
    held: Held | None,
    at: Int,
    weights: Float,
) -> None:
    """Look for a chair, go to it, take it, take it to its place, put it down.

    A chair that cannot be reached is left; one that cannot be brought to its place is put down.
    """
    if held is None:
        return
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
    late = state[i].blocked > WALK.blocked_s or time - state[i].best_at > CLEAN.trip_s
    dx = crowd.discs[row].x - crowd.discs[i].x
    dy = crowd.discs[row].y - crowd.discs[i].y
    if doing == columns.TO_CHAIR:
        reach = crowd.discs[i].r + crowd.discs[row].r
        if math.sqrt(dx * dx + dy * dy) - reach < CLEAN.near_m:
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
    if late or tx * tx + ty * ty < CLEAN.there_m * CLEAN.there_m:
        held.at[hand].dropped = held.at[hand].vb
        held.at[hand].qb = held.at[hand].vb = -1
        if not filling:
            leaders.lines[place].chair = -1.0
        next_turn(i, time, leaders, crowd)
