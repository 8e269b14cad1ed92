# SPDX-License-Identifier: Apache-2.0
"""How people decide, all of them in one compiled call per control tick.

Each person stays somewhere, walks to the next goal down its flow field (``sim.core.flow``) or
follows somebody (``sim.actors.people.following``), gives way at doors, and picks a velocity that
hits nothing soon (``sim.actors.people.avoidance``). A person whose way is blocked by a chair loses
patience and pushes it; now and then one sits down (``sim.actors.people.trips``).
"""

import math
from typing import NamedTuple

from sim.actors.config import DOORS, STEER, WALK
from sim.actors.holding import Held
from sim.actors.people import columns
from sim.actors.people.avoidance import choose, nearby, sense, spare_robot
from sim.actors.people.carrying import clean, keep_hold, pushes, to_what_is_taken
from sim.actors.people.following import (
    faces,
    follow,
    is_pushing,
    make_room,
    make_way,
    near_place,
    rests,
    spread_out,
    stand_in_line,
    wait_behind,
)
from sim.actors.people.leaders import Leaders, note_ways
from sim.actors.people.right_of_way import (
    Addresses,
    Crowd,
    Doors,
    Int,
    give_turns,
    hold_off,
    round_leaf,
    wait_beside,
)
from sim.actors.people.trips import Hulls, on_chair, patience, plan, to_chair
from sim.core.flow import Field, clearance_at, time_at, way_at
from sim.core.state import Records
from slam._jit import inner
from slam.frames import Float

NEAR, CROWD_NEAR = 24, 64  # discs around one that are looked at, without and with a crowd
PARTS = 8  # most discs of one and of what it pushes


class People(NamedTuple):
    """Everybody in a room, n people.

    alive    whether they move at all
    rates    mean stay s, factor on each one's preferred speed
    at, field, ways, crowd  as in the modules they are from
    servos   (n,) first of the actuators vx, vy, vyaw of each
    torsos   (n, 2) first qpos and dof of each
    limbs    (n, 4) mocap rows of thigh_l, shank_l, thigh_r, shank_r
    feet     (n, 8) of ``sim.actors.people.gait``
    hulls    what of the model follows who sits
    leaders  who is followed; held  who holds what
    weights  (k, 2) mass kg and yaw inertia kg m2 of each planar disc row
    scratch  (CROWD_NEAR + PARTS,) disc rows, for one person at a time
    """

    alive: bool
    rates: tuple[float, float]
    at: Addresses
    field: Field
    ways: Doors
    crowd: Crowd
    servos: Int
    torsos: Int
    limbs: Int
    feet: Float
    hulls: Hulls
    leaders: Leaders
    held: Held
    weights: Float
    scratch: Int


@inner
def want(i: int, pace: float, ways: Doors, field: Field, crowd: Crowd) -> tuple[float, float]:
    """The velocity person ``i`` would like to have, other movers aside."""
    discs, state, task = crowd.discs, crowd.state, crowd.task
    if task[i].walking == columns.TO_SEAT:
        return to_chair(i, crowd)
    if task[i].walking != columns.WALKS:
        return 0.0, 0.0
    goal = task[i].goal
    wx, wy = way_at(field, goal, discs[i].x, discs[i].y)
    left = time_at(field, goal, discs[i].x, discs[i].y)
    speed = min(pace * state[i].speed * state[i].slow, 0.3 + 1.2 * left)
    wx, wy = speed * wx, speed * wy
    if state[i].stays == 0.0:
        wx, wy = keep_right(i, wx, wy, field, discs)
    return at_doors(i, (wx, wy), ways, field, discs)


@inner
def at_doors(
    i: int, wanted: tuple[float, float], ways: Doors, field: Field, discs: Records
) -> tuple[float, float]:
    """The wanted velocity, where it is others' turn to pass a door or the leaf is not open yet."""
    wx, wy = wanted
    for d in range(ways.doors.shape[0]):
        side, turn = ways.sides[i, d], ways.passage[d].turn
        if side == 0:
            continue
        if turn != 0.0 and side != turn:
            wx, wy = wait_beside(i, ways.doors[d], side, field, discs)
        elif ways.doors[d].angle < DOORS.passable_rad:
            wx, wy = hold_off(i, d, (wx, wy), ways, discs)
    return wx, wy


@inner
def keep_right(i: int, wx: float, wy: float, field: Field, discs: Records) -> tuple[float, float]:
    """The wanted velocity of one of a stream, which keeps to the right side of a corridor."""
    x, y = discs[i].x, discs[i].y
    speed = math.sqrt(wx * wx + wy * wy)
    if speed < WALK.still_mps or clearance_at(field, x, y) > STEER.lane_half_m:
        return wx, wy
    rx, ry = wy / speed, -wx / speed
    if (
        clearance_at(field, x + STEER.lane_side_m * rx, y + STEER.lane_side_m * ry)
        < STEER.lane_wall_m
    ):
        return wx, wy
    return wx + STEER.lane * speed * rx, wy + STEER.lane * speed * ry


@inner
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@inner
def steer(i: int, tick: float, vx: float, vy: float, crowd: Crowd, out: Float) -> None:
    """Change towards (vx, vy) as fast as legs allow and face the way; servo targets to ``out``."""
    state, yaw = crowd.state, crowd.yaws[i]
    dvx, dvy = vx - state[i].vx, vy - state[i].vy
    change = math.sqrt(dvx * dvx + dvy * dvy)
    share = min(1.0, STEER.accel * tick / change) if change > 0.0 else 0.0
    state[i].vx += share * dvx
    state[i].vy += share * dvy
    heading, most = yaw, state[i].turn_rate
    if on_chair(i, crowd) or is_pushing(i, crowd):
        heading = state[i].look
    elif state[i].vx ** 2 + state[i].vy ** 2 > 0.04:
        heading = math.atan2(state[i].vy, state[i].vx)
    elif crowd.task[i].walking in (columns.STANDS, columns.FOLLOWS, columns.QUEUES):
        heading = state[i].look
    out[0], out[1] = state[i].vx, state[i].vy
    out[2] = min(max(WALK.turn_gain * wrap(heading - yaw), -most), most)


@inner
def wish(i: int, time: float, tick: float, people: People) -> tuple[float, float]:
    """The velocity person ``i`` would like to have, whatever it does; keeps account of the way."""
    crowd, field = people.crowd, people.field
    state, task = crowd.state, crowd.task
    doing = task[i].walking
    if doing < columns.FOLLOWS:
        return want(i, people.rates[1], people.ways, field, crowd)
    if doing == columns.FOLLOWS:
        state[i].look = faces(i, people.leaders, crowd)
        if rests(i, time, people.leaders, crowd):
            return make_room(i, (0.0, 0.0), field, crowd)
        wx, wy = follow(i, field, people.leaders, crowd)
        wx, wy = round_leaf(i, (wx, wy), people.ways, crowd.discs)
        wx, wy = at_doors(i, (wx, wy), people.ways, field, crowd.discs)
        wx, wy = wait_behind(i, (wx, wy), field, people.leaders, crowd)
        wx, wy = make_room(i, (wx, wy), field, crowd)
        wx, wy = make_way(i, (wx, wy), field, people.leaders, crowd)
    elif doing == columns.QUEUES:
        wx, wy = stand_in_line(i, time, people.leaders, crowd)
    else:
        wx, wy = to_what_is_taken(i, field, people.leaders, crowd, people.held)
    if wx * wx + wy * wy > 0.09:
        still = crowd.discs[i].u ** 2 + crowd.discs[i].v ** 2 < WALK.still_mps * WALK.still_mps
        # Who stands still with the leader has nowhere to get on to.
        waits = still and doing == columns.FOLLOWS and near_place(i, people.leaders, crowd)
        state[i].walked_s += 0.0 if waits else tick
        if still:
            state[i].blocked += tick
            state[i].blocked_s += 0.0 if waits else tick
            return wx, wy
    state[i].blocked = max(0.0, state[i].blocked - 2.0 * tick)
    return wx, wy


@inner
def decide(clock: tuple[float, float], physics: tuple[Float, Float, Float], people: People) -> None:
    """One tick of all people, from positions to the set points of their servos.

    clock    time s, length of the tick s
    physics  qpos and qvel (read), ctrl (written)
    """
    time, tick = clock
    stay = people.rates[0]
    qpos, qvel, ctrl = physics
    at, field, ways, crowd = people.at, people.field, people.ways, people.crowd
    servos = people.servos
    most = NEAR
    for i in range(len(servos)):
        if crowd.state[i].dense < 1.0:
            most = CROWD_NEAR
    near, parts = people.scratch[:most], people.scratch[CROWD_NEAR:]
    sense(at, qpos, qvel, ways, crowd)
    note_ways(tick, people.leaders, crowd)
    spread_out(field, people.leaders, crowd)
    for i in range(len(servos)):
        plan(i, time, tick, stay, ways.doors, field, crowd)
        clean(i, time, field, people.leaders, crowd, people.held, at.discs, people.weights)
    give_turns(ways, field, crowd)
    for i in range(len(servos)):
        if on_chair(i, crowd):
            vx, vy = to_chair(i, crowd)
            steer(i, tick, vx, vy, crowd, ctrl[servos[i] : servos[i] + 3])
            continue
        wanted = wish(i, time, tick, people)
        count = nearby(i, crowd, ways.sides, near)
        fade = patience(i, time, crowd)
        if is_pushing(i, crowd):
            vx, vy = pushes(i, wanted, near[:count], field, crowd, parts, people.held)
        else:
            vx, vy = choose(i, wanted, near[:count], fade, field, crowd)
        before = vx * vx + vy * vy
        vx, vy = keep_hold(i, (vx, vy), crowd, people.held, at.discs)
        vx, vy = spare_robot(i, (vx, vy), near[:count], crowd)
        if is_pushing(i, crowd):  # nor is a long thing turned into it
            share = min(math.sqrt((vx * vx + vy * vy) / max(before, 1e-9)), 1.0)
            turn = crowd.state[i].look - crowd.yaws[i]
            crowd.state[i].look = crowd.yaws[i] + share * turn
        steer(i, tick, vx, vy, crowd, ctrl[servos[i] : servos[i] + 3])
