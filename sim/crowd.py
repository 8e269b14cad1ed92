# SPDX-License-Identifier: Apache-2.0
"""How people decide, all of them in one compiled call per control tick.

Each person stays somewhere, walks to the next goal down its flow field (``sim.flow``), gives way at
doors, and picks the velocity that is nearest to the wanted one among those that hit nothing soon:
reciprocal velocity obstacles by sampling (van den Berg, Lin, Manocha, ICRA 2008), with walls read
from the clearance field. A person whose way is blocked by a chair loses patience and pushes it.
"""

from __future__ import annotations

import math

import numpy as np

from sim.draws import between, uniform, waiting
from sim.flow import FAR, Field, clearance_at, time_at, way_at
from sim.manners import (
    ANGLE,
    ARRIVE,
    BEST,
    BEST_AT,
    BLOCKED,
    BLOCKED_S,
    BODY,
    CX,
    CY,
    GOAL,
    KIND,
    LEAF,
    LOOK,
    LOOK_UNTIL,
    OPEN,
    PERSON,
    ROBOT,
    SPEED,
    STAY_UNTIL,
    TURN,
    VX,
    VY,
    WALKED_S,
    WALKING,
    WIDTH,
    Addresses,
    Crowd,
    Doors,
    Float,
    Int,
    R,
    U,
    V,
    X,
    Y,
    give_turns,
    hold_off,
    wait_beside,
)
from slam._jit import njit

HORIZON = 2.5  # s, collisions later than this do not matter
STILL = 0.1  # m/s, a walker slower than this is blocked
ACCEL = 3.0  # m/s2
SPARE = 0.05  # m that people leave between themselves and the robot


@njit
def impact_time(dx: float, dy: float, wx: float, wy: float, reach: float) -> float:
    """s until a point moving at (wx, wy) is within ``reach`` of (dx, dy); HORIZON if later."""
    c = dx * dx + dy * dy - reach * reach
    b = dx * wx + dy * wy
    if c <= 0.0:
        return 0.0 if b > 0.0 else HORIZON
    a = wx * wx + wy * wy
    root = b * b - a * c
    if b <= 0.0 or root <= 0.0:
        return HORIZON
    return min(c / (b + math.sqrt(root)), HORIZON)


@njit
def danger(i: int, vx: float, vy: float, near: Int, discs: Float, fade: float) -> float:
    """Cost of what person ``i`` would run into at velocity (vx, vy)."""
    x, y, r, ux, uy = discs[i, X], discs[i, Y], discs[i, R], discs[i, U], discs[i, V]
    cost = 0.0
    for k in range(len(near)):
        other = discs[near[k]]
        weight = 1.0 if other[KIND] == PERSON or other[KIND] == ROBOT else fade
        if weight <= 0.0:
            continue
        dx, dy, reach = other[X] - x, other[Y] - y, r + other[R] + 0.06
        if other[KIND] == PERSON:  # each takes half of the evasion
            wx, wy = 2.0 * vx - ux - other[U], 2.0 * vy - uy - other[V]
        else:
            wx, wy = vx - other[U], vy - other[V]
        gap2 = dx * dx + dy * dy
        if gap2 < reach * reach:
            closing = (dx * vx + dy * vy) / math.sqrt(max(gap2, 1e-6))
            cost += weight * 4.0 * max(closing, 0.0)
        else:
            when = impact_time(dx, dy, wx, wy, reach)
            cost += weight * (1.0 / (when + 0.1) - 1.0 / (HORIZON + 0.1))
    return cost


@njit
def choose(
    i: int,
    wanted: tuple[float, float],
    near: Int,
    fade: float,
    field: Field,
    crowd: Crowd,
) -> tuple[float, float]:
    """The best of 35 velocities for person ``i`` who would like to walk at ``wanted``."""
    discs, state = crowd.discs, crowd.state
    wx, wy = wanted
    x, y = discs[i, X], discs[i, Y]
    heading = math.atan2(wy, wx)
    here = min(clearance_at(field, x, y), BODY)
    wish = math.sqrt(wx * wx + wy * wy)
    pace = max(wish, 0.5)
    hurry = min(1.5 * state[i, BLOCKED], 3.0) if wish > 0.3 else 0.0
    best, best_x, best_y = math.inf, 0.0, 0.0
    for k in range(35):
        if k == 0:
            vx, vy = wx, wy
        elif k == 1:
            vx, vy = 0.0, 0.0
        elif k == 2:
            vx, vy = state[i, VX], state[i, VY]
        else:
            angle = heading + (k - 3) // 2 * (math.pi / 8.0)
            speed = pace if k % 2 == 0 else 0.5 * pace
            vx, vy = speed * math.cos(angle), speed * math.sin(angle)
        speed = math.sqrt(vx * vx + vy * vy)
        cost = math.sqrt((vx - wx) ** 2 + (vy - wy) ** 2)
        cost += 0.15 * math.sqrt((vx - state[i, VX]) ** 2 + (vy - state[i, VY]) ** 2)
        cost += 0.06 * max(0.0, wx * vy - wy * vx)  # people keep right
        if speed < 0.9 * pace:  # who has been held up steps aside rather than stand
            cost += hurry * (1.0 - speed / pace)
        for step in range(1, 3):
            c = clearance_at(field, x + 0.3 * step * vx, y + 0.3 * step * vy)
            if c < here:
                cost += 25.0 * (here - c)
        if cost < best:
            cost += danger(i, vx, vy, near, discs, fade)
        if cost < best:
            best, best_x, best_y = cost, vx, vy
    return best_x, best_y


@njit
def new_trip(i: int, time: float, stay: float, field: Field, crowd: Crowd) -> None:
    """Draw the next goal of person ``i`` (always four draws) and set off."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    n_goals = field.times.shape[0]
    offset = 1 + int(uniform(draws, i) * (n_goals - 1))
    goal = task[i, GOAL]
    state[i, ARRIVE] = between(draws, i, 0.25, 0.8)
    state[i, STAY_UNTIL] = waiting(draws, i, 1.0 / stay)  # a duration until the arrival
    state[i, LOOK] = between(draws, i, -math.pi, math.pi)
    for _ in range(n_goals):
        goal = (task[i, GOAL] + offset) % n_goals
        if time_at(field, goal, discs[i, X], discs[i, Y]) < FAR:
            break
        offset += 1
    task[i, GOAL] = goal
    task[i, WALKING] = 1
    state[i, BLOCKED] = 0.0
    state[i, BEST], state[i, BEST_AT] = FAR, time


@njit
def want(i: int, pace: float, ways: Doors, field: Field, crowd: Crowd) -> tuple[float, float]:
    """The velocity person ``i`` would like to have, other movers aside."""
    discs, state, task = crowd.discs, crowd.state, crowd.task
    if task[i, WALKING] == 0:
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
        if dx * dx + dy * dy < 1.44:
            return False
    return left < state[i, ARRIVE] or (left < 2.0 and state[i, BLOCKED] > 0.8)


@njit
def plan(
    i: int, time: float, tick: float, stay: float, doors: Float, field: Field, crowd: Crowd
) -> None:
    """Stay, set off, arrive or give up; keeps the account of time walked and blocked."""
    discs, state, task, draws = crowd.discs, crowd.state, crowd.task, crowd.draws
    look = len(task) + i  # its generator
    if task[i, WALKING] == 0:
        if time >= state[i, STAY_UNTIL]:
            new_trip(i, time, stay, field, crowd)
        elif time >= state[i, LOOK_UNTIL]:
            state[i, LOOK] = between(draws, look, -math.pi, math.pi)
            state[i, LOOK_UNTIL] = time + between(draws, look, 4.0, 15.0)
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
        task[i, WALKING] = 0
        state[i, STAY_UNTIL] += time
        state[i, LOOK_UNTIL] = time + between(draws, look, 4.0, 15.0)
    elif state[i, BLOCKED] > 5.0 or time - state[i, BEST_AT] > 12.0:
        new_trip(i, time, stay, field, crowd)


@njit
def spare_robot(
    i: int, wanted: tuple[float, float], near: Int, discs: Float
) -> tuple[float, float]:
    """The velocity less what would run into the robot: nobody pushes it, not even when held up."""
    vx, vy = wanted
    for k in range(len(near)):
        robot = discs[near[k]]
        if robot[KIND] != ROBOT:
            continue
        dx, dy = robot[X] - discs[i, X], robot[Y] - discs[i, Y]
        far = math.sqrt(max(dx * dx + dy * dy, 1e-6))
        ux, uy = dx / far, dy / far
        gap = far - discs[i, R] - robot[R] - SPARE
        # A person stops at ACCEL; what the robot itself comes nearer is stepped back from.
        approach = vx * ux + vy * uy - (robot[U] * ux + robot[V] * uy)
        allowed = math.sqrt(2.0 * ACCEL * gap) if gap > 0.0 else 4.0 * gap
        excess = min(max(approach - allowed, 0.0), 2.0)
        vx, vy = vx - excess * ux, vy - excess * uy
    return vx, vy


@njit
def nearby(i: int, discs: Float, sides: Int, near: Int) -> int:
    """Rows of ``discs`` within 3 m of person ``i``, into ``near``; returns how many.

    The leaf of a door one wants to pass is no obstacle: ``at_door`` deals with it.
    """
    count = 0
    for k in range(discs.shape[0]):
        dx, dy = discs[k, X] - discs[i, X], discs[k, Y] - discs[i, Y]
        if k == i or dx * dx + dy * dy > 9.0 or count == len(near):
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
    if state[i, VX] ** 2 + state[i, VY] ** 2 > 0.04:
        heading = math.atan2(state[i, VY], state[i, VX])
    elif crowd.task[i, WALKING] == 0:
        heading = state[i, LOOK]
    out[0], out[1] = state[i, VX], state[i, VY]
    out[2] = min(max(4.0 * wrap(heading - yaw), -3.0), 3.0)


@njit
def patience(i: int, time: float, crowd: Crowd) -> float:
    """Respect of person ``i`` for chairs and leaves in the way: 1 at first, 0 when worn out.

    It wears out after 0.8 to 1.6 s of standing, or 2 to 4 s of walking about without progress.
    """
    stood = (crowd.state[i, BLOCKED] - 0.8) / 0.8
    lost = (time - crowd.state[i, BEST_AT] - 2.0) / 2.0 if crowd.task[i, WALKING] != 0 else 0.0
    return float(min(max(1.0 - max(stood, lost), 0.0), 1.0))


@njit
def decide(
    clock: tuple[float, float],
    rates: tuple[float, float],
    physics: tuple[Float, Float, Float],
    at: Addresses,
    field: Field,
    ways: Doors,
    crowd: Crowd,
    servos: Int,
) -> None:
    """One tick of all people, from positions to the set points of their servos.

    clock    time s, length of the tick s
    rates    mean stay s, factor on each one's preferred speed
    physics  qpos and qvel (read), ctrl (written)
    servos   (n,) first of the actuators vx, vy, vyaw of each person
    """
    time, tick = clock
    stay, pace = rates
    qpos, qvel, ctrl = physics
    near = np.zeros(24, dtype=np.int64)
    sense(at, qpos, qvel, ways, crowd)
    for i in range(len(servos)):
        plan(i, time, tick, stay, ways.doors, field, crowd)
    give_turns(ways, field, crowd)
    for i in range(len(servos)):
        wanted = want(i, pace, ways, field, crowd)
        count = nearby(i, crowd.discs, ways.sides, near)
        fade = patience(i, time, crowd)
        chosen = choose(i, wanted, near[:count], fade, field, crowd)
        vx, vy = spare_robot(i, chosen, near[:count], crowd.discs)
        steer(i, tick, vx, vy, crowd, ctrl[servos[i] : servos[i] + 3])
