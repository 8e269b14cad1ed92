# SPDX-License-Identifier: Apache-2.0
"""The places of those who follow, and the way to them.

Everybody has a place in the frame of the leader's course. Two who would cross each other's way take
each other's place. A place in a wall is drawn in towards the leader, so whoever is there can see
it; who cannot goes the way the leader went. When the leader stands for a while, the places around
it step back, which lets it out of a corner.
"""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.leaders import CRUMB, CRUMBS, Leaders
from sim.actors.people.right_of_way import Crowd
from sim.core.flow import FAR, Field, clearance_at, time_at, way_at
from slam._jit import inner

_F = ACTORS.following
GIVE_WAY_S, STEP_BACK, STEP_BACK_M = _F.give_way_s, _F.step_back, _F.step_back_m
MARGIN, SIGHT, WIDE = _F.margin_m, _F.sight_m, _F.wide_m
NARROW, NARROW_SIDE, CROSSING = _F.narrow_m, _F.narrow_side_m, _F.crossing_m2
STANDS_S, STANDS_M, NEAR_M = _F.stands_s, _F.stands_m, _F.near_m
BEHIND = -0.5  # m; a place farther behind is one on the leader's way


@inner
def in_sight(field: Field, x: float, y: float, tx: float, ty: float) -> bool:
    """Whether the straight way between two places is free of walls."""
    dx, dy = tx - x, ty - y
    far = math.sqrt(dx * dx + dy * dy)
    steps = int(far / 0.15) + 1
    for k in range(1, steps + 1):
        if clearance_at(field, x + dx * k / steps, y + dy * k / steps) < SIGHT:
            return False
    return True


@inner
def through_door(field: Field, x: float, y: float, tx: float, ty: float) -> bool:
    """Whether the straight way between two places leads through something narrow."""
    dx, dy = tx - x, ty - y
    steps = int(math.sqrt(dx * dx + dy * dy) / 0.15)
    for k in range(steps // 4 + 2, steps - steps // 4 - 1):
        if clearance_at(field, x + dx * k / steps, y + dy * k / steps) < WIDE:
            return True
    return False


@inner
def route(i: int, tx: float, ty: float, field: Field, crowd: Crowd) -> tuple[float, float]:
    """A place in sight of person ``i`` on the way to (tx, ty): itself, or a step round the walls.

    Round walls one goes the way to the goal that is the nearest to it.
    """
    x, y = crowd.discs[i].x, crowd.discs[i].y
    if in_sight(field, x, y, tx, ty):
        return tx, ty
    goal, least = -1, FAR
    for k in range(field.times.shape[0]):
        time = time_at(field, k, tx, ty)
        if time < least:
            goal, least = k, time
    if goal < 0:
        return tx, ty
    wx, wy = way_at(field, goal, x, y)
    return x + wx, y + wy


@inner
def place_of(i: int, k: int, field: Field, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """Where person ``i`` would like to be, in the formation of leader ``k``."""
    course, disc = leaders.course[k], crowd.discs[leaders.rows[k]]
    ahead, left = crowd.state[i].ahead, crowd.state[i].left
    far = math.sqrt(ahead * ahead + left * left)
    clear = clearance_at(field, disc.x, disc.y)
    if clear < NARROW:  # those beside it go in file, those ahead keep between the walls
        room = max(clear - NARROW_SIDE, 0.1)
        if ahead <= 0.5:
            ahead = -float(crowd.state[i].file)
        elif abs(left) > room:
            ahead += 0.5 * (abs(left) - room)
            left = room if left > 0.0 else -room
        far = math.sqrt(ahead * ahead + left * left)
    if ahead < BEHIND:  # on the way that the leader has come
        back = min(int(-ahead / CRUMB), int(course.count) - 1)
        at = (int(course.last) - back) % CRUMBS
        return float(leaders.trail[k, at, 0]), float(leaders.trail[k, at, 1])
    back_off = min(max(course.stood - GIVE_WAY_S, 0.0) * STEP_BACK, STEP_BACK_M)
    far += back_off
    angle = course.heading + math.atan2(left, ahead)
    c, s = math.cos(angle), math.sin(angle)
    x, y, reach = disc.x, disc.y, 0.0
    while reach + 0.1 <= far:
        if clearance_at(field, x + (reach + 0.1) * c, y + (reach + 0.1) * s) < MARGIN:
            break
        reach += 0.1
    return x + reach * c, y + reach * s


@inner
def _crossing(a: float, b: float, p: float, q: float) -> float:
    """By how much (m2) the ways from a to q and b to p are shorter, on one axis."""
    return (a - p) ** 2 + (b - q) ** 2 - (a - q) ** 2 - (b - p) ** 2


@inner
def spread_out(field: Field, leaders: Leaders, crowd: Crowd) -> None:
    """Where everybody's place is now; pairs who would cross take each other's."""
    state, task, discs = crowd.state, crowd.task, crowd.discs
    for i in range(len(task)):
        if task[i].walking == columns.FOLLOWS:
            x, y = place_of(i, task[i].leader, field, leaders, crowd)
            state[i].spot_x, state[i].spot_y = x, y
    for i in range(len(task)):
        for j in range(i + 1 if task[i].walking == columns.FOLLOWS else len(task), len(task)):
            if task[j].walking != columns.FOLLOWS or task[j].leader != task[i].leader:
                continue
            one, two = state[i], state[j]
            gain = _crossing(discs[i].x, discs[j].x, one.spot_x, two.spot_x)
            gain += _crossing(discs[i].y, discs[j].y, one.spot_y, two.spot_y)
            if gain > CROSSING:
                one.ahead, two.ahead = two.ahead, one.ahead
                one.left, two.left = two.left, one.left
                one.file, two.file = two.file, one.file
                one.spot_x, two.spot_x = two.spot_x, one.spot_x
                one.spot_y, two.spot_y = two.spot_y, one.spot_y


@inner
def in_file(i: int, k: int, field: Field, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """Where person ``i`` goes who does not see its place: in file on the way of leader ``k``."""
    x, y = crowd.discs[i].x, crowd.discs[i].y
    course, count = leaders.course[k], int(leaders.course[k].count)
    own = min(int(crowd.state[i].file / CRUMB), count - 1)
    for step in range(count):  # one's own place, then those behind it, then those before it
        back = own + step if own + step < count else count - 1 - step
        at = (int(course.last) - back) % CRUMBS
        if in_sight(field, x, y, leaders.trail[k, at, 0], leaders.trail[k, at, 1]):
            return float(leaders.trail[k, at, 0]), float(leaders.trail[k, at, 1])
    leader = crowd.discs[leaders.rows[k]]
    return route(i, leader.x, leader.y, field, crowd)


@inner
def near_place(i: int, leaders: Leaders, crowd: Crowd) -> bool:
    """Whether person ``i`` is as good as at its place, or with its leader.

    Farther off will do while the leader stands.
    """
    k = crowd.task[i].leader
    reach = STANDS_M if leaders.course[k].stood > STANDS_S else NEAR_M
    leader = crowd.discs[leaders.rows[k]]
    lx = leader.x - crowd.discs[i].x
    ly = leader.y - crowd.discs[i].y
    if lx * lx + ly * ly < reach * reach:
        return True
    dx = crowd.state[i].spot_x - crowd.discs[i].x
    dy = crowd.state[i].spot_y - crowd.discs[i].y
    return bool(dx * dx + dy * dy < reach * reach)


@inner
def taken(i: int, x: float, y: float, crowd: Crowd) -> bool:
    """Whether something else stands at a place, so that person ``i`` cannot."""
    discs = crowd.discs
    for k in range(len(discs)):
        dx, dy = discs[k].x - x, discs[k].y - y
        reach = discs[k].r + discs[i].r
        if k != i and dx * dx + dy * dy < reach * reach:
            return True
    return False
