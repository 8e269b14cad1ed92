# SPDX-License-Identifier: Apache-2.0
"""People who accompany a leader, the robot or one of them, and people in a line.

Everybody goes to a place of its own (``sim.actors.people.formation``) and makes way for the robot
and for those who are held up. Who is held up near the place rests there for a while.
"""

from __future__ import annotations

import math

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.formation import in_file, in_sight, near_place, taken, through_door
from sim.actors.people.leaders import MOVING, Leaders
from sim.actors.people.right_of_way import Crowd
from sim.core.flow import Field, clearance_at, way_at
from slam._jit import inner

_F = ACTORS.following
FASTEST, THERE, SERVED_S, GAIN = _F.fastest_mps, _F.there_m, _F.served_s, _F.gain
NARROW, WAY_M, WAY_HALF, ASIDE = _F.narrow_m, _F.way_m, _F.way_half_m, _F.aside_mps
TAKEN_M, ASKED_S, STANDS_S = _F.taken_m, _F.asked_s, _F.stands_s
ROOM_M, ROOM_PUSH_M, ROOM_HALF = _F.room_m, _F.room_push_m, _F.room_half_m
FILE_M, FILE_GAP, FILE_HALF = _F.file_m, _F.file_gap_m, _F.file_half
TURN_MOST = ACTORS.walking.turn_most
HELD_UP_S, REST_S = _F.held_up_s, _F.rest_s


@inner
def follow(i: int, field: Field, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """The velocity with which person ``i`` would like to keep its place."""
    k = crowd.task[i].leader
    x, y = crowd.discs[i].x, crowd.discs[i].y
    tx, ty = float(crowd.state[i].spot_x), float(crowd.state[i].spot_y)
    disc = crowd.discs[leaders.rows[k]]
    u, v = disc.u, disc.v
    if not in_sight(field, x, y, tx, ty) or through_door(field, x, y, tx, ty):
        u, v = 0.0, 0.0
        tx, ty = in_file(i, k, field, leaders, crowd)
    crowd.state[i].arrive, crowd.state[i].luck = tx, ty
    far = math.sqrt((tx - x) ** 2 + (ty - y) ** 2)
    if far < TAKEN_M and taken(i, tx, ty, crowd):  # as near as one gets
        return share_of(far) * u, share_of(far) * v
    return to_place(tx - x, ty - y, u, v)


@inner
def share_of(far: float) -> float:
    """Of the leader's velocity: who is far behind goes straight to the place."""
    return max(1.0 - far, 0.0)


@inner
def to_place(dx: float, dy: float, u: float, v: float) -> tuple[float, float]:
    """Velocity to a place (dx, dy) m away that itself moves at (u, v)."""
    far = math.sqrt(dx * dx + dy * dy)
    if far < THERE and u * u + v * v < MOVING * MOVING:
        return 0.0, 0.0
    share = share_of(far)
    wx, wy = share * u + GAIN * dx, share * v + GAIN * dy
    speed = math.sqrt(wx * wx + wy * wy)
    over = max(speed / FASTEST, 1.0)
    return wx / over + 0.0, wy / over + 0.0


@inner
def wait_behind(
    i: int, wanted: tuple[float, float], field: Field, leaders: Leaders, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of person ``i``, no faster than those of its company right before it.

    So in a narrow place, and where the leader stands; only those nearer to the leader count, so
    nobody waits for one who waits for it.
    """
    k, discs, task = crowd.task[i].leader, crowd.discs, crowd.task
    x, y = discs[i].x, discs[i].y
    speed = math.sqrt(wanted[0] ** 2 + wanted[1] ** 2)
    if speed < THERE or (leaders.course[k].stood < STANDS_S and clearance_at(field, x, y) > NARROW):
        return wanted
    c, s, most = wanted[0] / speed, wanted[1] / speed, speed
    row = leaders.rows[k]
    lx, ly = discs[row].x, discs[row].y
    own = (x - lx) ** 2 + (y - ly) ** 2
    for j in range(len(task) + 1):
        other = row if j == len(task) else j
        company = j == len(task) or (task[j].walking == columns.FOLLOWS and task[j].leader == k)
        ox, oy = discs[other].x, discs[other].y
        if not company or (ox - lx) ** 2 + (oy - ly) ** 2 >= own:
            continue
        ahead, left = c * (ox - x) + s * (oy - y), c * (oy - y) - s * (ox - x)
        reach = discs[i].r + discs[other].r
        if 0.0 < ahead < reach + FILE_M and abs(left) < FILE_HALF * reach:
            before = max(discs[other].u * c + discs[other].v * s, 0.0)
            most = min(most, before + GAIN * max(ahead - reach - FILE_GAP, 0.0))
    return most * c, most * s


@inner
def make_way(
    i: int, wanted: tuple[float, float], field: Field, leaders: Leaders, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of person ``i``, sideways where the robot it accompanies would drive.

    Where there is no room beside, it goes ahead.
    """
    robot = crowd.discs[leaders.rows[crowd.task[i].leader]]
    if robot.kind != columns.ROBOT:
        return wanted
    yaw = crowd.yaws[leaders.rows[crowd.task[i].leader]]
    c, s = math.cos(yaw), math.sin(yaw)
    dx = crowd.discs[i].x - robot.x
    dy = crowd.discs[i].y - robot.y
    ahead, left = c * dx + s * dy, c * dy - s * dx
    if ahead < 0.0 or ahead > WAY_M or abs(left) > WAY_HALF:
        return wanted
    side = 1.0 if left >= 0.0 else -1.0
    narrow = clearance_at(field, crowd.discs[i].x, crowd.discs[i].y) < NARROW
    along = max(wanted[0] * c + wanted[1] * s, ASIDE if narrow else 0.3)
    return along * c - side * ASIDE * s, along * s + side * ASIDE * c


@inner
def is_pushing(i: int, crowd: Crowd) -> bool:
    """Whether person ``i`` has something long before it, and not lost it since."""
    return bool(crowd.task[i].held >= 0 and crowd.state[i].turn_rate < TURN_MOST)


@inner
def make_room(
    i: int, wanted: tuple[float, float], field: Field, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of person ``i``, sideways where it stands in the way of one who is held up."""
    discs, task, state = crowd.discs, crowd.task, crowd.state
    for j in range(len(task)):
        if task[j].walking != columns.WALKS or state[j].blocked < ASKED_S:
            continue
        dx, dy = discs[i].x - discs[j].x, discs[i].y - discs[j].y
        pushing = is_pushing(j, crowd)
        reach = ROOM_PUSH_M if pushing else ROOM_M
        if dx * dx + dy * dy > reach * reach:
            continue
        c, s = math.cos(crowd.yaws[j]), math.sin(crowd.yaws[j])
        if not pushing:
            c, s = way_at(field, task[j].goal, discs[j].x, discs[j].y)
        ahead, left = c * dx + s * dy, c * dy - s * dx
        if ahead > 0.0 and abs(left) < ROOM_HALF:
            side = 1.0 if left >= 0.0 else -1.0
            return wanted[0] - side * ASIDE * s, wanted[1] + side * ASIDE * c
    return wanted


@inner
def rests(i: int, time: float, leaders: Leaders, crowd: Crowd) -> bool:
    """Whether person ``i`` was held up near its place and lets it be for a while."""
    state = crowd.state[i]
    if time < state.best_at:
        return True
    if state.blocked > HELD_UP_S and near_place(i, leaders, crowd):
        state.best_at, state.blocked = time + REST_S, 0.0
        return True
    return False


@inner
def stand_in_line(i: int, time: float, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """Velocity to one's place in the line, which moves up by one every ``SERVED_S``."""
    place = crowd.task[i].place
    first = crowd.task[i].first
    n = int(leaders.lines[first].places)
    now = (place - int(time / SERVED_S)) % n
    tx, ty = leaders.lines[first + now].x, leaders.lines[first + now].y
    dx, dy = tx - crowd.discs[i].x, ty - crowd.discs[i].y
    return to_place(dx, dy, 0.0, 0.0)


@inner
def faces(i: int, leaders: Leaders, crowd: Crowd) -> float:
    """Heading rad of someone who stands: towards the leader, or up the line."""
    k = crowd.task[i].leader
    if k < 0:
        return float(crowd.state[i].look)
    disc = crowd.discs[leaders.rows[k]]
    dx, dy = disc.x - crowd.discs[i].x, disc.y - crowd.discs[i].y
    return math.atan2(dy, dx)
