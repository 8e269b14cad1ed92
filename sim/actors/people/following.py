# SPDX-License-Identifier: Apache-2.0
"""People who accompany a leader, the robot or one of them, and people in a line.

Everybody has a place in the frame of the leader's course. Two who would cross each other's way take
each other's place. A place in a wall is drawn in towards the leader, so whoever is there can see
it; who cannot goes the way the leader went. When the leader stands for a while, the places around
it step back, which lets it out of a corner. Everybody makes way for the robot and for those who are
held up. Who is held up near the place rests there for a while.
"""

import math

from sim.actors.config import FOLLOW, WALK
from sim.actors.people import columns
from sim.actors.people.leaders import CRUMBS, Leaders
from sim.actors.people.right_of_way import Crowd
from sim.core.flow import FAR, Field, clearance_at, time_at, way_at
from slam._jit import inner

BEHIND = -0.5  # m; a place farther behind is one on the leader's way


@inner
def in_sight(field: Field, x: float, y: float, tx: float, ty: float) -> bool:
    """Whether the straight way between two places is free of walls."""
    dx, dy = tx - x, ty - y
    far = math.sqrt(dx * dx + dy * dy)
    steps = int(far / 0.15) + 1
    for k in range(1, steps + 1):
        if clearance_at(field, x + dx * k / steps, y + dy * k / steps) < FOLLOW.sight_m:
            return False
    return True


@inner
def through_door(field: Field, x: float, y: float, tx: float, ty: float) -> bool:
    """Whether the straight way between two places leads through something narrow."""
    dx, dy = tx - x, ty - y
    steps = int(math.sqrt(dx * dx + dy * dy) / 0.15)
    for k in range(steps // 4 + 2, steps - steps // 4 - 1):
        if clearance_at(field, x + dx * k / steps, y + dy * k / steps) < FOLLOW.wide_m:
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
    if clear < FOLLOW.narrow_m:  # those beside it go in file, those ahead keep between the walls
        room = max(clear - FOLLOW.narrow_side_m, 0.1)
        if ahead <= 0.5:
            ahead = -float(crowd.state[i].file)
        elif abs(left) > room:
            ahead += 0.5 * (abs(left) - room)
            left = room if left > 0.0 else -room
        far = math.sqrt(ahead * ahead + left * left)
    if ahead < BEHIND:  # on the way that the leader has come
        back = min(int(-ahead / FOLLOW.crumb_m), int(course.count) - 1)
        at = (int(course.last) - back) % CRUMBS
        return float(leaders.trail[k, at, 0]), float(leaders.trail[k, at, 1])
    back_off = min(
        max(course.stood - FOLLOW.give_way_s, 0.0) * FOLLOW.step_back, FOLLOW.step_back_m
    )
    far += back_off
    angle = course.heading + math.atan2(left, ahead)
    c, s = math.cos(angle), math.sin(angle)
    x, y, reach = disc.x, disc.y, 0.0
    while reach + 0.1 <= far:
        if clearance_at(field, x + (reach + 0.1) * c, y + (reach + 0.1) * s) < FOLLOW.margin_m:
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
            if gain > FOLLOW.crossing_m2:
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
    own = min(int(crowd.state[i].file / FOLLOW.crumb_m), count - 1)
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
    reach = FOLLOW.stands_m if leaders.course[k].stood > FOLLOW.stands_s else FOLLOW.near_m
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
    if far < FOLLOW.taken_m and taken(i, tx, ty, crowd):  # as near as one gets
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
    if far < FOLLOW.there_m and u * u + v * v < FOLLOW.moving_mps * FOLLOW.moving_mps:
        return 0.0, 0.0
    share = share_of(far)
    wx, wy = share * u + FOLLOW.gain * dx, share * v + FOLLOW.gain * dy
    speed = math.sqrt(wx * wx + wy * wy)
    over = max(speed / FOLLOW.fastest_mps, 1.0)
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
    if speed < FOLLOW.there_m or (
        leaders.course[k].stood < FOLLOW.stands_s and clearance_at(field, x, y) > FOLLOW.narrow_m
    ):
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
        if 0.0 < ahead < reach + FOLLOW.file_m and abs(left) < FOLLOW.file_half * reach:
            before = max(discs[other].u * c + discs[other].v * s, 0.0)
            most = min(most, before + FOLLOW.gain * max(ahead - reach - FOLLOW.file_gap_m, 0.0))
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
    if ahead < 0.0 or ahead > FOLLOW.way_m or abs(left) > FOLLOW.way_half_m:
        return wanted
    side = 1.0 if left >= 0.0 else -1.0
    narrow = clearance_at(field, crowd.discs[i].x, crowd.discs[i].y) < FOLLOW.narrow_m
    along = max(wanted[0] * c + wanted[1] * s, FOLLOW.aside_mps if narrow else 0.3)
    return along * c - side * FOLLOW.aside_mps * s, along * s + side * FOLLOW.aside_mps * c


@inner
def is_pushing(i: int, crowd: Crowd) -> bool:
    """Whether person ``i`` has something long before it, and not lost it since."""
    return bool(crowd.task[i].held >= 0 and crowd.state[i].turn_rate < WALK.turn_most)


@inner
def make_room(
    i: int, wanted: tuple[float, float], field: Field, crowd: Crowd
) -> tuple[float, float]:
    """The velocity of person ``i``, sideways where it stands in the way of one who is held up."""
    discs, task, state = crowd.discs, crowd.task, crowd.state
    for j in range(len(task)):
        if task[j].walking != columns.WALKS or state[j].blocked < FOLLOW.asked_s:
            continue
        dx, dy = discs[i].x - discs[j].x, discs[i].y - discs[j].y
        pushing = is_pushing(j, crowd)
        reach = FOLLOW.room_push_m if pushing else FOLLOW.room_m
        if dx * dx + dy * dy > reach * reach:
            continue
        c, s = math.cos(crowd.yaws[j]), math.sin(crowd.yaws[j])
        if not pushing:
            c, s = way_at(field, task[j].goal, discs[j].x, discs[j].y)
        ahead, left = c * dx + s * dy, c * dy - s * dx
        if ahead > 0.0 and abs(left) < FOLLOW.room_half_m:
            side = 1.0 if left >= 0.0 else -1.0
            return wanted[0] - side * FOLLOW.aside_mps * s, wanted[1] + side * FOLLOW.aside_mps * c
    return wanted


@inner
def rests(i: int, time: float, leaders: Leaders, crowd: Crowd) -> bool:
    """Whether person ``i`` was held up near its place and lets it be for a while."""
    state = crowd.state[i]
    if time < state.best_at:
        return True
    if state.blocked > FOLLOW.held_up_s and near_place(i, leaders, crowd):
        state.best_at, state.blocked = time + FOLLOW.rest_s, 0.0
        return True
    return False


@inner
def stand_in_line(i: int, time: float, leaders: Leaders, crowd: Crowd) -> tuple[float, float]:
    """Velocity to one's place in the line, which moves up by one every ``SERVED_S``."""
    place = crowd.task[i].place
    first = crowd.task[i].first
    n = int(leaders.lines[first].places)
    now = (place - int(time / FOLLOW.served_s)) % n
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
