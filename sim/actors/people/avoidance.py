# SPDX-License-Identifier: Apache-2.0
"""The velocity a person picks: nearest to the wanted one among those that hit nothing soon.

Reciprocal velocity obstacles by sampling (van den Berg, Lin, Manocha, ICRA 2008), with walls read
from the clearance field, the discs of all that moves and the angles of doors.
"""

import math

from sim.actors.config import FOLLOW, HOLD, STEER, WAY
from sim.actors.people import columns
from sim.actors.people.right_of_way import Addresses, Crowd, Doors, Int
from sim.core.flow import Field, clearance_at
from sim.core.state import Record, Records
from slam._jit import inner, uncounted
from slam.frames import Float


@inner
def sense(at: Addresses, qpos: Float, qvel: Float, ways: Doors, crowd: Crowd) -> None:
    """Read discs, headings, door angles and the discs that stand for the leaves."""
    discs, k = crowd.discs, at.discs.shape[0]
    for row in range(k):
        q, v = at.discs[row]
        discs[row].x, discs[row].y = qpos[q], qpos[q + 1]
        discs[row].u, discs[row].v = qvel[v], qvel[v + 1]
        if row < len(crowd.yaws):
            crowd.yaws[row] = qpos[q + 2]
    for d in range(at.doors.shape[0]):
        q, v = at.doors[d]
        x, y, closed, sign, slides = at.hinges[d]
        ways.doors[d].angle = qpos[q]
        if slides != 0.0:
            ways.doors[d].angle = 0.5 * math.pi * qpos[q] / ways.doors[d].width
        c, s = math.cos(closed + sign * qpos[q]), math.sin(closed + sign * qpos[q])
        for part in range(3):
            row = k + 3 * d + part
            length = (0.35 + 0.3 * part) * ways.doors[d].width
            if slides != 0.0:
                along = length + slides * qpos[q]
                discs[row].x, discs[row].y = x + along * c, y + along * s
                discs[row].u, discs[row].v = slides * qvel[v] * c, slides * qvel[v] * s
                continue
            discs[row].x, discs[row].y = x + length * c, y + length * s
            discs[row].u = -length * s * sign * qvel[v]
            discs[row].v = length * c * sign * qvel[v]
    first = len(discs) - len(crowd.long)
    for part in range(len(crowd.long)):
        row = int(crowd.long[part, 0])
        q, v = at.discs[row]
        rx, ry = (
            crowd.long[part, 1] * math.cos(qpos[q + 2]),
            crowd.long[part, 1] * math.sin(qpos[q + 2]),
        )
        end = discs[first + part]
        end.x, end.y = qpos[q] + rx, qpos[q + 1] + ry
        end.u, end.v = qvel[v] - qvel[v + 2] * ry, qvel[v + 1] + qvel[v + 2] * rx


@inner
def nearby(i: int, crowd: Crowd, sides: Int, near: Int) -> int:
    """Rows of discs within 3 m of person ``i``, into ``near``; returns how many.

    Who holds something looks farther.

    The leaf of a door one wants to pass is no obstacle: ``at_doors`` deals with it. Nor is the
    chair that one sits down on, nor what one holds.
    """
    discs, count = crowd.discs, 0
    seat, held = crowd.task[i].seat, crowd.task[i].held
    reach = 9.0 if held < 0 else HOLD.sight_m * HOLD.sight_m
    for k in range(discs.shape[0]):
        dx, dy = discs[k].x - discs[i].x, discs[k].y - discs[i].y
        if k in (i, seat) or dx * dx + dy * dy > reach or count == len(near):
            continue
        if held >= 0 and crowd.owner[k] == held:
            continue
        if discs[k].kind >= columns.LEAF and sides[i, int(discs[k].kind - columns.LEAF)] != 0:
            continue
        near[count] = k
        count += 1
    return count


@uncounted
def impact_time(dx: float, dy: float, wx: float, wy: float, reach: float) -> float:
    """s until a point moving at (wx, wy) is within ``reach`` of (dx, dy); HORIZON if later."""
    c = dx * dx + dy * dy - reach * reach
    b = dx * wx + dy * wy
    if c <= 0.0:
        return 0.0 if b > 0.0 else STEER.horizon_s
    a = wx * wx + wy * wy
    root = b * b - a * c
    if b <= 0.0 or root <= 0.0:
        return STEER.horizon_s
    return min(c / (b + math.sqrt(root)), STEER.horizon_s)


@inner
def danger(  # noqa: PLR0913 (kernel)
    i: int, vx: float, vy: float, near: Int, discs: Records, fade: float, dense: float
) -> float:
    """Cost of what person ``i`` would run into at velocity (vx, vy).

    fade, dense  weight of things and of people
    """
    x, y, r, ux, uy = discs[i].x, discs[i].y, discs[i].r, discs[i].u, discs[i].v
    cost = 0.0
    for k in range(len(near)):
        other = discs[near[k]]
        weight = fade
        if other.kind == columns.PERSON:
            weight = dense
        elif other.kind == columns.ROBOT:
            weight = 1.0
        if weight <= 0.0:
            continue
        dx, dy, reach = other.x - x, other.y - y, r + other.r + STEER.apart_m
        if other.kind == columns.PERSON:  # each takes half of the evasion
            wx, wy = 2.0 * vx - ux - other.u, 2.0 * vy - uy - other.v
        else:
            wx, wy = vx - other.u, vy - other.v
        gap2 = dx * dx + dy * dy
        if gap2 < reach * reach:
            closing = (dx * vx + dy * vy) / math.sqrt(max(gap2, 1e-6))
            cost += weight * STEER.touching * max(closing, 0.0)
        else:
            when = impact_time(dx, dy, wx, wy, reach)
            cost += weight * (1.0 / (when + STEER.soon_s) - 1.0 / (STEER.horizon_s + STEER.soon_s))
    return cost


@inner
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
    x, y = discs[i].x, discs[i].y
    heading = math.atan2(wy, wx)
    here = min(clearance_at(field, x, y), WAY.body_m)
    wish = math.sqrt(wx * wx + wy * wy)
    pace = max(wish, STEER.least_pace)
    hurry = (
        min(STEER.hurry * state[i].blocked, STEER.hurry_most) if wish > STEER.hurry_from else 0.0
    )
    best, best_x, best_y = math.inf, 0.0, 0.0
    for k in range(35):
        if k == 0:
            vx, vy = wx, wy
        elif k == 1:
            vx, vy = 0.0, 0.0
        elif k == 2:
            vx, vy = state[i].vx, state[i].vy
        else:
            angle = heading + (k - 3) // 2 * (math.pi / 8.0)
            speed = pace if k % 2 == 0 else 0.5 * pace
            vx, vy = speed * math.cos(angle), speed * math.sin(angle)
        speed = math.sqrt(vx * vx + vy * vy)
        cost = math.sqrt((vx - wx) ** 2 + (vy - wy) ** 2)
        cost += STEER.change * math.sqrt((vx - state[i].vx) ** 2 + (vy - state[i].vy) ** 2)
        cost += STEER.keep_right * max(0.0, wx * vy - wy * vx)  # people keep right
        if speed < STEER.slow * pace:  # who has been held up steps aside rather than stand
            cost += hurry * (1.0 - speed / pace)
        for step in range(1, 3):
            c = clearance_at(field, x + STEER.look_s * step * vx, y + STEER.look_s * step * vy)
            if c < here:
                cost += STEER.wall * (here - c)
        if cost < best:
            cost += danger(i, vx, vy, near, discs, fade, state[i].dense)
        if cost < best:
            best, best_x, best_y = cost, vx, vy
    return best_x, best_y


@inner
def spare_robot(
    i: int, wanted: tuple[float, float], near: Int, crowd: Crowd
) -> tuple[float, float]:
    """The velocity less what would run into the robot: nobody pushes it, not even when held up.

    Nor does anybody run into it with what is held: who pulls a train slows down when a wagon comes
    near the robot. Those of a crowd stop earlier.
    """
    vx, vy = wanted
    discs, held = crowd.discs, crowd.task[i].held
    spare, brake = STEER.spare_m, STEER.accel
    if crowd.state[i].dense < 1.0:
        spare, brake = STEER.crowd_spare_m, STEER.crowd_brake
    for k in range(len(near)):
        robot = discs[near[k]]
        if robot.kind != columns.ROBOT:
            continue
        vx, vy = _spare(vx, vy, discs[i], robot, spare, brake)
        for part in range(len(discs) if held >= 0 else 0):
            if crowd.owner[part] != held:
                continue
            u, v = discs[part].u, discs[part].v
            own = math.sqrt(u * u + v * v)
            if own < FOLLOW.moving_mps:
                vx, vy = _spare(
                    vx, vy, discs[part], robot, spare + STEER.held_spare_m, STEER.held_brake
                )
                continue
            sx, sy = _spare(u, v, discs[part], robot, spare + STEER.held_spare_m, STEER.held_brake)
            share = min(max((sx * u + sy * v) / (own * own), 0.0), 1.0)
            vx, vy = share * vx, share * vy
    return vx, vy


@inner
def _spare(
    vx: float, vy: float, disc: Record, robot: Record, spare: float, brake: float
) -> tuple[float, float]:
    dx, dy = robot.x - disc.x, robot.y - disc.y
    far = math.sqrt(max(dx * dx + dy * dy, 1e-6))
    ux, uy = dx / far, dy / far
    gap = far - disc.r - robot.r - spare
    # A person stops at ``brake``; what the robot itself comes nearer is stepped back from.
    approach = vx * ux + vy * uy - (robot.u * ux + robot.v * uy)
    allowed = math.sqrt(2.0 * brake * gap) if gap > 0.0 else 4.0 * gap
    excess = min(max(approach - allowed, 0.0), STEER.spare_mps)
    return vx - excess * ux, vy - excess * uy
