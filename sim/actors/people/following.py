# SPDX-License-Identifier: Apache-2.0
"""People who accompany a leader, the robot or one of them, and people in a line.

Everybody has a place in the frame of the leader's course, which turns after the leader slowly: a
robot that turns on the spot does not whirl its visitors about. Two who would cross each other's way
take each other's place. A place in a wall is drawn in towards the leader, so whoever is there can
see it; who cannot goes the way the leader went. When the leader stands for a while, those around it
step back, which lets it out of a corner. Who is held up near the place rests there for a while.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.actors.config import ACTORS
from sim.actors.people import columns
from sim.actors.people.right_of_way import Crowd, Float, Int
from sim.core.flow import FAR, Field, clearance_at, time_at, way_at
from slam._jit import njit

_F = ACTORS.following
CRUMB, COURSE_RATE, MOVING = _F.crumb_m, _F.course_rate, _F.moving_mps
GIVE_WAY_S, STEP_BACK, STEP_BACK_M = _F.give_way_s, _F.step_back, _F.step_back_m
MARGIN, SIGHT, GAIN, WIDE = _F.margin_m, _F.sight_m, _F.gain, _F.wide_m
FASTEST, THERE, SERVED_S = _F.fastest_mps, _F.there_m, _F.served_s
NARROW, WAY_M, WAY_HALF, ASIDE = _F.narrow_m, _F.way_m, _F.way_half_m, _F.aside_mps
TAKEN_M, CROSSING = _F.taken_m, _F.crossing_m2
NARROW_SIDE, ASKED_S, ROOM_M = _F.narrow_side_m, _F.asked_s, _F.room_m
ROOM_PUSH_M, ROOM_HALF = _F.room_push_m, _F.room_half_m
STANDS_S, STANDS_M = _F.stands_s, _F.stands_m
FILE_M, FILE_GAP, FILE_HALF = _F.file_m, _F.file_gap_m, _F.file_half
TURN_MOST = ACTORS.walking.turn_most
HELD_UP_S, NEAR_M, REST_S = _F.held_up_s, _F.near_m, _F.rest_s
CRUMBS = 160  # remembered of each leader: 40 m
BEHIND = -0.5  # m; a place farther behind is one on the leader's way
HEADING, STOOD, LAST, COUNT = range(4)  # columns of ``Leaders.course``


class Leaders(NamedTuple):
    """Those who are followed, and lines.

    rows    (l,) disc row of each leader
    trail   (l, CRUMBS, 2) m, places it has been at, a ring
    course  (l, 4) heading rad of its formation, s it has stood, last crumb, number of crumbs
    lines   (q, 7) place in a line x, y m, and the number of places of that line; of a row of chairs
            also the disc row of the chair that stands there (-1 none) and its pose before
    """

    rows: Int
    trail: Float
    course: Float
    lines: Float


def leaders_of(rows: list[int], lines: list[tuple[float, ...]]) -> Leaders:
    """Of discs in these rows, not yet on their way."""
    n = len(rows)
    return Leaders(
        np.array(rows, dtype=np.int64),
        np.zeros((n, CRUMBS, 2)),
        np.zeros((n, 4)),
        np.array(lines, dtype=np.float64).reshape(-1, 7),
    )


@njit
def note_ways(tick: float, leaders: Leaders, crowd: Crowd) -> None:
    """Remember where every leader is, and turn its formation after it."""
    for k in range(len(leaders.rows)):
        disc, course = crowd.discs[leaders.rows[k]], leaders.course[k]
        x, y, u, v = disc[columns.X], disc[columns.Y], disc[columns.U], disc[columns.V]
        if course[COUNT] == 0.0:
            course[HEADING] = crowd.yaws[leaders.rows[k]]
        last = int(course[LAST])
        dx, dy = x - leaders.trail[k, last, 0], y - leaders.trail[k, last, 1]
        if course[COUNT] == 0.0 or dx * dx + dy * dy > CRUMB * CRUMB:
            last = (last + 1) % CRUMBS
            leaders.trail[k, last, 0], leaders.trail[k, last, 1] = x, y
            course[LAST], course[COUNT] = last, min(course[COUNT] + 1.0, CRUMBS)
        moves = u * u + v * v > MOVING * MOVING
        course[STOOD] = 0.0 if moves else course[STOOD] + tick
        towards = course[HEADING]
        if disc[columns.KIND] == columns.ROBOT:  # shows where it will go before it does
            towards = crowd.yaws[leaders.rows[k]]
        elif moves:
            towards = math.atan2(v, u)
        turn = towards - course[HEADING]
        turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
        course[HEADING] += min(max(turn, -COURSE_RATE * tick), COURSE_RATE * tick)


@njit
def in_sight(field: Field, x: float, y: float, tx: float, ty: float) -> bool:
    """Whether the straight way between two places is free of walls."""
    dx, dy = tx - x, ty - y
    far = math.sqrt(dx * dx + dy * dy)
    steps = int(far / 0.15) + 1
    for k in range(1, steps + 1):
        if clearance_at(field, x + dx * k / steps, y + dy * k / steps) < SIGHT:
            return False
    return True


@njit
def through_door(field: Field, x: float, y: float, tx: float, ty: float) -> bool:
    """Whether the straight way between two places leads through something narrow."""
    dx, dy = tx - x, ty - y
    steps = int(math.sqrt(dx * dx + dy * dy) / 0.15)
    for k in range(steps // 4 + 2, steps - steps // 4 - 1):
        if clearance_at(field, x + dx * k / steps, y + dy * k / steps) < WIDE:
            return True
    return False


@njit
def place_of(i: int, k: int, field: Field, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """Where person ``i`` would like to be, in the formation of leader ``k``."""
    course, disc = leaders.course[k], crowd.discs[leaders.rows[k]]
    ahead, left = crowd.state[i, columns.AHEAD], crowd.state[i, columns.LEFT]
    far = math.sqrt(ahead * ahead + left * left)
    clear = clearance_at(field, disc[columns.X], disc[columns.Y])
    if clear < NARROW:  # those beside it go in file, those ahead keep between the walls
        room = max(clear - NARROW_SIDE, 0.1)
        if ahead <= 0.5:
            ahead = -float(crowd.state[i, columns.FILE])
        elif abs(left) > room:
            ahead += 0.5 * (abs(left) - room)
            left = room if left > 0.0 else -room
        far = math.sqrt(ahead * ahead + left * left)
    if ahead < BEHIND:  # on the way that the leader has come
        back = min(int(-ahead / CRUMB), int(course[COUNT]) - 1)
        at = (int(course[LAST]) - back) % CRUMBS
        return float(leaders.trail[k, at, 0]), float(leaders.trail[k, at, 1])
    back_off = min(max(course[STOOD] - GIVE_WAY_S, 0.0) * STEP_BACK, STEP_BACK_M)
    far += back_off
    angle = course[HEADING] + math.atan2(left, ahead)
    c, s = math.cos(angle), math.sin(angle)
    x, y, reach = disc[columns.X], disc[columns.Y], 0.0
    while reach + 0.1 <= far:
        if clearance_at(field, x + (reach + 0.1) * c, y + (reach + 0.1) * s) < MARGIN:
            break
        reach += 0.1
    return x + reach * c, y + reach * s


@njit
def spread_out(field: Field, leaders: Leaders, crowd: Crowd) -> None:
    """Where everybody's place is now; pairs who would cross take each other's."""
    state, task, discs = crowd.state, crowd.task, crowd.discs
    for i in range(len(task)):
        if task[i, columns.WALKING] == columns.FOLLOWS:
            x, y = place_of(i, task[i, columns.LEADER], field, leaders, crowd)
            state[i, columns.SPOT_X], state[i, columns.SPOT_Y] = x, y
    for i in range(len(task)):
        for j in range(
            i + 1 if task[i, columns.WALKING] == columns.FOLLOWS else len(task), len(task)
        ):
            if (
                task[j, columns.WALKING] != columns.FOLLOWS
                or task[j, columns.LEADER] != task[i, columns.LEADER]
            ):
                continue
            gain = 0.0
            for axis in range(2):
                a, b = discs[i, columns.X + axis], discs[j, columns.X + axis]
                p, q = state[i, columns.SPOT_X + axis], state[j, columns.SPOT_X + axis]
                gain += (a - p) ** 2 + (b - q) ** 2 - (a - q) ** 2 - (b - p) ** 2
            if gain > CROSSING:
                for column in (
                    columns.AHEAD,
                    columns.LEFT,
                    columns.FILE,
                    columns.SPOT_X,
                    columns.SPOT_Y,
                ):
                    state[i, column], state[j, column] = state[j, column], state[i, column]


@njit
def make_way(
    i: int, wanted: tuple[float, float], field: Field, leaders: Leaders, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of person ``i``, sideways where the robot it accompanies would drive.

    Where there is no room beside, it goes ahead.
    """
    robot = crowd.discs[leaders.rows[crowd.task[i, columns.LEADER]]]
    if robot[columns.KIND] != columns.ROBOT:
        return wanted
    yaw = crowd.yaws[leaders.rows[crowd.task[i, columns.LEADER]]]
    c, s = math.cos(yaw), math.sin(yaw)
    dx = crowd.discs[i, columns.X] - robot[columns.X]
    dy = crowd.discs[i, columns.Y] - robot[columns.Y]
    ahead, left = c * dx + s * dy, c * dy - s * dx
    if ahead < 0.0 or ahead > WAY_M or abs(left) > WAY_HALF:
        return wanted
    side = 1.0 if left >= 0.0 else -1.0
    narrow = clearance_at(field, crowd.discs[i, columns.X], crowd.discs[i, columns.Y]) < NARROW
    along = max(wanted[0] * c + wanted[1] * s, ASIDE if narrow else 0.3)
    return along * c - side * ASIDE * s, along * s + side * ASIDE * c


@njit
def is_pushing(i: int, crowd: Crowd) -> bool:
    """Whether person ``i`` has something long before it, and not lost it since."""
    return bool(crowd.task[i, columns.HELD] >= 0 and crowd.state[i, columns.TURN_RATE] < TURN_MOST)


@njit
def make_room(
    i: int, wanted: tuple[float, float], field: Field, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of person ``i``, sideways where it stands in the way of one who is held up."""
    discs, task, state = crowd.discs, crowd.task, crowd.state
    for j in range(len(task)):
        if task[j, columns.WALKING] != columns.WALKS or state[j, columns.BLOCKED] < ASKED_S:
            continue
        dx, dy = (
            discs[i, columns.X] - discs[j, columns.X],
            discs[i, columns.Y] - discs[j, columns.Y],
        )
        pushing = is_pushing(j, crowd)
        reach = ROOM_PUSH_M if pushing else ROOM_M
        if dx * dx + dy * dy > reach * reach:
            continue
        c, s = math.cos(crowd.yaws[j]), math.sin(crowd.yaws[j])
        if not pushing:
            c, s = way_at(field, task[j, columns.GOAL], discs[j, columns.X], discs[j, columns.Y])
        ahead, left = c * dx + s * dy, c * dy - s * dx
        if ahead > 0.0 and abs(left) < ROOM_HALF:
            side = 1.0 if left >= 0.0 else -1.0
            return wanted[0] - side * ASIDE * s, wanted[1] + side * ASIDE * c
    return wanted


@njit
def near_place(i: int, leaders: Leaders, crowd: Crowd) -> bool:
    """Whether person ``i`` is as good as at its place, or with its leader.

    Farther off will do while the leader stands.
    """
    k = crowd.task[i, columns.LEADER]
    reach = STANDS_M if leaders.course[k, STOOD] > STANDS_S else NEAR_M
    leader = crowd.discs[leaders.rows[k]]
    lx = leader[columns.X] - crowd.discs[i, columns.X]
    ly = leader[columns.Y] - crowd.discs[i, columns.Y]
    if lx * lx + ly * ly < reach * reach:
        return True
    dx = crowd.state[i, columns.SPOT_X] - crowd.discs[i, columns.X]
    dy = crowd.state[i, columns.SPOT_Y] - crowd.discs[i, columns.Y]
    return bool(dx * dx + dy * dy < reach * reach)


@njit
def rests(i: int, time: float, leaders: Leaders, crowd: Crowd) -> bool:
    """Whether person ``i`` was held up near its place and lets it be for a while."""
    state = crowd.state[i]
    if time < state[columns.BEST_AT]:
        return True
    if state[columns.BLOCKED] > HELD_UP_S and near_place(i, leaders, crowd):
        state[columns.BEST_AT], state[columns.BLOCKED] = time + REST_S, 0.0
        return True
    return False


@njit
def route(i: int, tx: float, ty: float, field: Field, crowd: Crowd) -> tuple[float, float]:
    """A place in sight of person ``i`` on the way to (tx, ty): itself, or a step round the walls.

    Round walls one goes the way to the goal that is the nearest to it.
    """
    x, y = crowd.discs[i, columns.X], crowd.discs[i, columns.Y]
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


@njit
def in_file(i: int, k: int, field: Field, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """Where person ``i`` goes who does not see its place: in file on the way of leader ``k``."""
    x, y = crowd.discs[i, columns.X], crowd.discs[i, columns.Y]
    course, count = leaders.course[k], int(leaders.course[k, COUNT])
    own = min(int(crowd.state[i, columns.FILE] / CRUMB), count - 1)
    for step in range(count):  # one's own place, then those behind it, then those before it
        back = own + step if own + step < count else count - 1 - step
        at = (int(course[LAST]) - back) % CRUMBS
        if in_sight(field, x, y, leaders.trail[k, at, 0], leaders.trail[k, at, 1]):
            return float(leaders.trail[k, at, 0]), float(leaders.trail[k, at, 1])
    leader = crowd.discs[leaders.rows[k]]
    return route(i, leader[columns.X], leader[columns.Y], field, crowd)


@njit
def follow(i: int, field: Field, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """The velocity with which person ``i`` would like to keep its place."""
    k = crowd.task[i, columns.LEADER]
    x, y = crowd.discs[i, columns.X], crowd.discs[i, columns.Y]
    tx, ty = float(crowd.state[i, columns.SPOT_X]), float(crowd.state[i, columns.SPOT_Y])
    disc = crowd.discs[leaders.rows[k]]
    u, v = disc[columns.U], disc[columns.V]
    if not in_sight(field, x, y, tx, ty) or through_door(field, x, y, tx, ty):
        u, v = 0.0, 0.0
        tx, ty = in_file(i, k, field, leaders, crowd)
    crowd.state[i, columns.AIM_X], crowd.state[i, columns.AIM_Y] = tx, ty
    far = math.sqrt((tx - x) ** 2 + (ty - y) ** 2)
    if far < TAKEN_M and taken(i, tx, ty, crowd):  # as near as one gets
        return share_of(far) * u, share_of(far) * v
    return to_place(tx - x, ty - y, u, v)


@njit
def taken(i: int, x: float, y: float, crowd: Crowd) -> bool:
    """Whether something else stands at a place, so that person ``i`` cannot."""
    discs = crowd.discs
    for k in range(len(discs)):
        dx, dy = discs[k, columns.X] - x, discs[k, columns.Y] - y
        reach = discs[k, columns.R] + discs[i, columns.R]
        if k != i and dx * dx + dy * dy < reach * reach:
            return True
    return False


@njit
def share_of(far: float) -> float:
    """Of the leader's velocity: who is far behind goes straight to the place."""
    return max(1.0 - far, 0.0)


@njit
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


@njit
def wait_behind(
    i: int, wanted: tuple[float, float], field: Field, leaders: Leaders, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of person ``i``, no faster than those of its company right before it.

    So in a narrow place, and where the leader stands; only those nearer to the leader count, so
    nobody waits for one who waits for it.
    """
    k, discs, task = crowd.task[i, columns.LEADER], crowd.discs, crowd.task
    x, y = discs[i, columns.X], discs[i, columns.Y]
    speed = math.sqrt(wanted[0] ** 2 + wanted[1] ** 2)
    if speed < THERE or (
        leaders.course[k, STOOD] < STANDS_S and clearance_at(field, x, y) > NARROW
    ):
        return wanted
    c, s, most = wanted[0] / speed, wanted[1] / speed, speed
    row = leaders.rows[k]
    lx, ly = discs[row, columns.X], discs[row, columns.Y]
    own = (x - lx) ** 2 + (y - ly) ** 2
    for j in range(len(task) + 1):
        other = row if j == len(task) else j
        company = j == len(task) or (
            task[j, columns.WALKING] == columns.FOLLOWS and task[j, columns.LEADER] == k
        )
        ox, oy = discs[other, columns.X], discs[other, columns.Y]
        if not company or (ox - lx) ** 2 + (oy - ly) ** 2 >= own:
            continue
        ahead, left = c * (ox - x) + s * (oy - y), c * (oy - y) - s * (ox - x)
        reach = discs[i, columns.R] + discs[other, columns.R]
        if 0.0 < ahead < reach + FILE_M and abs(left) < FILE_HALF * reach:
            before = max(discs[other, columns.U] * c + discs[other, columns.V] * s, 0.0)
            most = min(most, before + GAIN * max(ahead - reach - FILE_GAP, 0.0))
    return most * c, most * s


@njit
def stand_in_line(i: int, time: float, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """Velocity to one's place in the line, which moves up by one every ``SERVED_S``."""
    place = crowd.task[i, columns.PLACE]
    first = crowd.task[i, columns.FIRST]
    n = int(leaders.lines[first, 2])
    now = (place - int(time / SERVED_S)) % n
    tx, ty = leaders.lines[first + now, 0], leaders.lines[first + now, 1]
    dx, dy = tx - crowd.discs[i, columns.X], ty - crowd.discs[i, columns.Y]
    return to_place(dx, dy, 0.0, 0.0)


@njit
def faces(i: int, leaders: Leaders, crowd: Crowd) -> float:
    """Heading rad of someone who stands: towards the leader, or up the line."""
    k = crowd.task[i, columns.LEADER]
    if k < 0:
        return float(crowd.state[i, columns.LOOK])
    disc = crowd.discs[leaders.rows[k]]
    dx, dy = (
        disc[columns.X] - crowd.discs[i, columns.X],
        disc[columns.Y] - crowd.discs[i, columns.Y],
    )
    return math.atan2(dy, dx)


def arrays(leaders: Leaders) -> dict[str, NDArray[np.generic]]:
    """The live arrays that are state."""
    return {"trail": leaders.trail, "course": leaders.course, "lines": leaders.lines}
