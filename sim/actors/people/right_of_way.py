# SPDX-License-Identifier: Apache-2.0
"""People and doors: whose turn it is, where the others wait, how near one comes to a closed leaf.

Also the tables that all kernels of the crowd share, one row for each person, disc or door.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.actors.config import DOORS, FOLLOW, WAY
from sim.actors.people import columns
from sim.core.flow import Field, clearance_at, time_at, way_at
from sim.core.state import Record, Records
from slam._jit import inner
from slam.frames import Float

Int = NDArray[np.int64]


class Crowd(NamedTuple):
    """The people and what is around them, in the records of ``columns``.

    discs (k,) people first; yaws rad of people and things; owner (k,) disc row of the mover that
    each disc is of; long (p, 2) disc row and m along its x axis of the last p discs, which are the
    ends of what is long; allowed (n, goals) where each one goes; state (n,); task (n,);
    draws (2 n,) generators:
    of each one's trips, then of each one's looking about while standing, which happens as often as
    time allows. So the trips of a person are the same, however long each takes.
    """

    discs: Records
    yaws: Float
    owner: Int
    long: Float
    allowed: NDArray[np.bool_]
    state: Records
    task: Records
    draws: NDArray[np.uint64]


class Doors(NamedTuple):
    """doors (m,), passage (m,), and from which side each person wants through, sides (n, m)."""

    doors: Records
    passage: Records
    sides: Int


class Addresses(NamedTuple):
    """Where things stand in qpos and qvel.

    discs (k, 2) first qpos and dof of each planar mover in the order of the disc rows;
    doors (m, 2) of each hinge; hinges (m, 5) of ``sim.core.bodies.Bodies.hinges``
    """

    discs: Int
    doors: Int
    hinges: Float


@inner
def wants_through(i: int, door: Record, field: Field, crowd: Crowd) -> int:
    """Side (+1 where the leaf swings to, -1) from which person ``i`` wants to pass; 0: none."""
    discs, task = crowd.discs, crowd.task
    dx, dy = discs[i].x - door.cx, discs[i].y - door.cy
    distance = math.sqrt(dx * dx + dy * dy)
    if task[i].walking != columns.WALKS or distance > WAY.wants_m:
        return 0
    goal = task[i].goal
    normal = dx * door.nx + dy * door.ny
    if distance < WAY.in_doorway_m:
        wx, wy = way_at(field, goal, discs[i].x, discs[i].y)
        return -1 if wx * door.nx + wy * door.ny > 0.0 else 1
    there = time_at(field, goal, door.cx, door.cy)
    if time_at(field, goal, discs[i].x, discs[i].y) - there < WAY.on_way * distance:
        return 0
    return 1 if normal > 0.0 else -1


@inner
def follows_through(i: int, door: Record, crowd: Crowd) -> int:
    """The same of person ``i`` who follows somebody, by the next place on its way."""
    dx, dy = crowd.discs[i].x - door.cx, crowd.discs[i].y - door.cy
    if crowd.task[i].walking != columns.FOLLOWS or dx * dx + dy * dy > WAY.wants_m * WAY.wants_m:
        return 0
    tx = crowd.state[i].arrive - door.cx
    ty = crowd.state[i].luck - door.cy
    here = dx * door.nx + dy * door.ny
    there = tx * door.nx + ty * door.ny
    if here * there >= 0.0:
        return 0
    share = here / (here - there)
    along = (dx + share * (tx - dx)) * door.ex + (dy + share * (ty - dy)) * door.ey
    if abs(along) > 0.5 * door.width + WAY.in_frame_m:
        return 0
    return 1 if here > 0.0 else -1


@inner
def give_turns(  # noqa: C901, PLR0912 (kernel)
    ways: Doors, field: Field, crowd: Crowd
) -> None:
    """Who may pass each door, and whether it shall open. Fills ``ways.sides``."""
    doors, passage, sides, discs = ways.doors, ways.passage, ways.sides, crowd.discs
    for d in range(doors.shape[0]):
        door = doors[d]
        inside, nearest, turn = 0, math.inf, 0
        kept, asked = False, False
        passage[d].inside = 0.0
        for i in range(sides.shape[0]):
            side = wants_through(i, door, field, crowd)
            if side == 0:
                side = follows_through(i, door, crowd)
            sides[i, d] = side
            dx, dy = discs[i].x - door.cx, discs[i].y - door.cy
            distance = math.sqrt(dx * dx + dy * dy)
            hx = dx + 0.5 * door.width * door.ex
            hy = dy + 0.5 * door.width * door.ey
            swept = door.slides == 0.0 and (
                dx * door.nx + dy * door.ny > 0.0 and hx * hx + hy * hy < WAY.swept_m2
            )
            if distance < DOORS.clear_m or swept:  # nobody is hit by a leaf that moves by itself
                passage[d].inside = 1.0
            if crowd.task[i].walking == columns.FOLLOWS and distance < FOLLOW.asks_m:
                asked = True
            if side == 0:
                continue
            across, along = dx * door.nx + dy * door.ny, dx * door.ex + dy * door.ey
            in_frame = abs(across) < WAY.in_frame_m and abs(along) < 0.5 * door.width
            if in_frame and (inside == 0 or side == int(passage[d].turn)):
                inside = side
            if side == int(passage[d].turn) and distance < WAY.kept_m:
                kept = True
            if distance < nearest:
                nearest, turn = distance, side
        if inside != 0:
            turn = inside
        elif kept:
            turn = int(passage[d].turn)
        passage[d].turn = turn
        for i in range(sides.shape[0]):
            if turn != 0 and sides[i, d] == turn:
                dx, dy = discs[i].x - door.cx, discs[i].y - door.cy
                # who pulls a door starts earlier, and what slides looks ahead
                reach = WAY.pull_m if turn > 0 or doors[d].slides != 0.0 else WAY.push_m
                asked = asked or dx * dx + dy * dy < reach * reach
        passage[d].asked = 1.0 if asked else 0.0


@inner
def wait_beside(
    i: int, door: Record, side: int, field: Field, discs: Records
) -> tuple[float, float]:
    """Velocity to a place on one's own side, out of the way of those who come through."""
    dx, dy = discs[i].x - door.cx, discs[i].y - door.cy
    beside = WAY.beside_m if dx * door.ex + dy * door.ey >= 0.0 else -WAY.beside_m
    for _ in range(2):
        tx = door.cx + WAY.back_m * side * door.nx + beside * door.ex
        ty = door.cy + WAY.back_m * side * door.ny + beside * door.ey
        if clearance_at(field, tx, ty) > WAY.body_m:
            break
        beside = -beside
    tx, ty = tx - discs[i].x, ty - discs[i].y
    gap = math.sqrt(tx * tx + ty * ty)
    speed = min(WAY.wait_mps, WAY.wait_gain * gap) / max(gap, 1e-6)
    return speed * tx, speed * ty


@inner
def hold_off(
    i: int, d: int, wanted: tuple[float, float], ways: Doors, discs: Records
) -> tuple[float, float]:
    """The wanted velocity less what would run into a leaf that is not open yet.

    Who pushes comes up to the leaf; who pulls stays out of the circle it sweeps; who comes second
    leaves room to the one in front.
    """
    door, side = ways.doors[d], ways.sides[i, d]
    dx, dy = discs[i].x - door.cx, discs[i].y - door.cy
    first = 0
    for k in range(len(ways.sides)):
        if k != i and ways.sides[k, d] == side:
            kx, ky = discs[k].x - door.cx, discs[k].y - door.cy
            first += kx * kx + ky * ky < dx * dx + dy * dy
    if door.slides != 0.0:
        rx, ry, stop = side * door.nx, side * door.ny, WAY.push_stop_m
        gap = dx * rx + dy * ry
    elif side > 0:
        rx = dx + 0.5 * door.width * door.ex
        ry = dy + 0.5 * door.width * door.ey
        gap = math.sqrt(rx * rx + ry * ry)
        rx, ry, stop = rx / gap, ry / gap, door.width + WAY.leaf_m
    else:
        rx, ry, stop = -door.nx, -door.ny, WAY.push_stop_m
        gap = dx * rx + dy * ry
    excess = -(wanted[0] * rx + wanted[1] * ry) - WAY.hold_gain * (gap - stop - WAY.queue_m * first)
    excess = min(max(excess, 0.0), WAY.hold_mps)
    return wanted[0] + excess * rx, wanted[1] + excess * ry


@inner
def round_leaf(
    i: int, wanted: tuple[float, float], ways: Doors, discs: Records
) -> tuple[float, float]:
    """The wanted velocity of one who follows, round the end of a leaf that stands in its way."""
    wx, wy = wanted
    speed = math.sqrt(wx * wx + wy * wy)
    for d in range(len(ways.doors) if speed > 0.0 else 0):
        door = ways.doors[d]
        if door.slides != 0.0:
            continue
        width = door.width
        c, s = math.cos(door.angle), math.sin(door.angle)
        lx, ly = c * door.ex + s * door.nx, c * door.ey + s * door.ny
        hx = discs[i].x - door.cx + 0.5 * width * door.ex
        hy = discs[i].y - door.cy + 0.5 * width * door.ey
        off = lx * hy - ly * hx
        towards = (ly * wx - lx * wy) / speed  # to the leaf, per m, where ``off`` is positive
        if off * towards <= 0.0 or abs(off) > abs(towards) * WAY.round_m:
            continue
        far = off / towards / speed
        met = (hx + far * wx) * lx + (hy + far * wy) * ly
        if 0.0 < met < width + WAY.body_m:
            dx, dy = (
                (width + WAY.round_end_m) * lx - hx,
                (width + WAY.round_end_m) * ly - hy,
            )
            gap = max(math.sqrt(dx * dx + dy * dy), 1e-6)
            wx, wy = speed * dx / gap, speed * dy / gap
    return wx, wy
