# SPDX-License-Identifier: Apache-2.0
"""How chairs, boards and people move in the plane: one kernel, in steps of at most 0.02 s.

Every thing is a segment with a radius: nothing overlaps a wall, a pillar or another thing. It keeps
``KEEP_M`` from the robot: what it comes too near to is pushed aside, and where there is no room,
stands elsewhere from then on. Each thing draws from a generator of its own.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scripts.integrity.geometry import clear_of_building, point_to_segment2, sees, segments2
from scripts.integrity.things import BOARD, BOX, LEGS, Plane, Thing
from slam._jit import inner, njit
from slam.frames import Float

KEEP_M = 0.35
SPIN_RADPS = 0.5  # of a board
WALK_MPS = 0.45  # about as fast as the robot drives
AHEAD_S = 0.5  # of the robot's trail, looked for at a time
SIDESTEPS = (0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6)  # rad, from the way it would go
TRIES = 40


@inner
def _draw(thing: Thing) -> float:
    """In [0, 1): splitmix64 of a thing."""
    thing.state += np.uint64(0x9E3779B97F4A7C15)
    z = thing.state
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) / 9007199254740992.0


@inner
def _somewhere(plane: Plane, thing: Thing) -> tuple[float, float]:
    """A drawn point of a drawn room, m."""
    k = int(_draw(thing) * plane.rooms.shape[0])
    x0, y0, x1, y1 = plane.rooms[k]
    return x0 + _draw(thing) * (x1 - x0), y0 + _draw(thing) * (y1 - y0)


# -- what a thing is about to do ------------------------------------------------------------------


@inner
def _decide(plane: Plane, thing: Thing, t: float) -> None:
    """What a thing does next: rest, slide, go somewhere in sight, or go with the robot."""
    thing.beside = 0.0
    thing.until = t + 1.0 + 4.0 * _draw(thing)
    thing.speed = thing.slow + (thing.fast - thing.slow) * _draw(thing)
    if _draw(thing) < thing.rests:
        thing.until = t + thing.rest_s * _draw(thing)
        thing.speed = 0.0
        return
    if thing.kind <= BOX:
        way = _draw(thing) * 2.0 * math.pi
        thing.gx = thing.x + 20.0 * math.cos(way)
        thing.gy = thing.y + 20.0 * math.sin(way)
        thing.turn = 1.6 * (_draw(thing) - 0.5)
        return
    thing.until += 5.0
    thing.turn = 0.9 * (_draw(thing) - 0.5)
    if thing.seen >= 0.0 and _draw(thing) < thing.follows:
        thing.beside = 1.0
        thing.gx = thing.near + (thing.wide - thing.near) * _draw(thing)
        thing.gy = 2.0 * math.pi * _draw(thing)
        return
    thing.gx, thing.gy = thing.x, thing.y
    for _ in range(TRIES):
        x, y = _somewhere(plane, thing)
        if sees(thing.x, thing.y, x, y, plane.walls):
            thing.gx, thing.gy = x, y
            return


@inner
def _goal(plane: Plane, thing: Thing, step: int) -> tuple[float, float]:
    """Where a thing goes now, m: beside the robot, or on its trail where that is hidden."""
    if thing.beside < 0.5:
        return thing.gx, thing.gy
    x, y, heading = plane.path[int(thing.seen)]
    if thing.seen < step:
        return x, y
    if thing.kind == BOARD:
        bearing = thing.gy + heading
        return x + thing.gx * math.cos(bearing), y + thing.gx * math.sin(bearing)
    along, across = thing.gx * math.cos(thing.gy), thing.gx * math.sin(thing.gy)
    at = step + int(along / WALK_MPS / plane.dt)  # people know the way, also through a door
    x, y, heading = plane.path[min(max(at, 0), plane.path.shape[0] - 1)]
    for _ in range(3):
        gx, gy = x - across * math.sin(heading), y + across * math.cos(heading)
        if sees(x, y, gx, gy, plane.walls):
            return gx, gy
        across *= 0.5
    return x, y


@inner
def _look(plane: Plane, thing: Thing, step: int) -> None:
    """Does a thing see the robot, or the next piece of its trail?"""
    path = plane.path
    if sees(thing.x, thing.y, path[step, 0], path[step, 1], plane.walls):
        thing.seen = step
    elif thing.seen >= 0.0:
        ahead = min(int(thing.seen) + math.ceil(AHEAD_S / plane.dt), step - 1)
        if sees(thing.x, thing.y, path[ahead, 0], path[ahead, 1], plane.walls):
            thing.seen = ahead


@inner
def _turned(plane: Plane, thing: Thing, way: float, step: int) -> float:
    """Which way a thing looks after a step towards ``way``, rad."""
    a: float = thing.a
    if thing.kind <= BOX:
        return a + float(thing.turn) * plane.dt
    if thing.kind >= LEGS:
        return way
    wanted = way  # a board: along its way, across the robot's sight
    if thing.seen >= step:
        wanted = math.atan2(thing.y - plane.path[step, 1], thing.x - plane.path[step, 0])
        wanted += thing.turn
        wanted += 0.5 * math.pi
    off = 0.5 * math.atan2(math.sin(2.0 * (wanted - a)), math.cos(2.0 * (wanted - a)))
    most = SPIN_RADPS * plane.dt
    return a + min(max(off, -most), most)


# -- where it may be ------------------------------------------------------------------------------


@inner
def _line(thing: Thing, x: float, y: float, a: float) -> tuple[float, float, float, float]:
    """The segment that a thing is at a pose."""
    c, s = thing.half * math.cos(a), thing.half * math.sin(a)
    return x - c, y - s, x + c, y + s


@inner
def _free(plane: Plane, i: int, x: float, y: float, a: float) -> bool:
    """Whether thing ``i`` overlaps nothing there."""
    thing: Thing = plane.things[i]
    line = _line(thing, x, y, a)
    if not clear_of_building(line, thing.radius, plane.walls, plane.pillars):
        return False
    for j in range(plane.things.shape[0]):
        other: Thing = plane.things[j]
        reach = thing.radius + other.radius
        far = reach + thing.half + other.half
        dx, dy = other.x - x, other.y - y
        if j == i or dx * dx + dy * dy > far * far:
            continue
        if segments2(line, _line(other, other.x, other.y, other.a)) < reach * reach:
            return False
    return True


@inner
def _spare_m(plane: Plane, i: int, x: float, y: float, a: float, step: int) -> float:
    """How much more than ``KEEP_M`` is between the robot and thing ``i`` there, m."""
    thing: Thing = plane.things[i]
    away2 = point_to_segment2(plane.path[step, 0], plane.path[step, 1], _line(thing, x, y, a))
    spare: float = math.sqrt(away2) - thing.radius - KEEP_M
    return spare


@inner
def _fits(plane: Plane, i: int, x: float, y: float, a: float, step: int) -> bool:
    return _spare_m(plane, i, x, y, a, step) >= 0.0 and _free(plane, i, x, y, a)


@njit
def may_stand(plane: Plane, i: int, pose: Float) -> bool:
    """Whether thing ``i`` is free at ``pose`` (3,) at the start, not too near to the robot."""
    x, y, a = pose
    return _spare_m(plane, i, x, y, a, 0) > 0.05 and _free(plane, i, x, y, a)


@inner
def _in_sight(plane: Plane, i: int, x: float, y: float, a: float, step: int) -> bool:
    """Whether the robot may see the middle or an end of thing ``i`` there."""
    thing: Thing = plane.things[i]
    rx, ry, heading = plane.path[step]
    for k in range(-1, 2):
        px = x + k * thing.half * math.cos(a)
        py = y + k * thing.half * math.sin(a)
        off = math.atan2(py - ry, px - rx) - heading
        off = abs(math.atan2(math.sin(off), math.cos(off)))
        if off < 0.5 * plane.fov + 0.2 and sees(rx, ry, px, py, plane.walls):
            return True
    return False


# -- a step ---------------------------------------------------------------------------------------


@inner
def _elsewhere(plane: Plane, i: int, step: int) -> bool:
    """Put thing ``i`` where it is free and out of sight; whether a place was found."""
    thing: Thing = plane.things[i]
    for _ in range(TRIES):
        x, y = _somewhere(plane, thing)
        a = _draw(thing) * 2.0 * math.pi
        if _spare_m(plane, i, x, y, a, step) < 0.3 or _in_sight(plane, i, x, y, a, step):
            continue
        if _free(plane, i, x, y, a):
            thing.x, thing.y, thing.a = x, y, a
            return True
    return False


@inner
def _move(plane: Plane, i: int, step: int) -> bool:
    """One step towards the goal, round what is in the way; whether it moved."""
    thing: Thing = plane.things[i]
    x, y = thing.x, thing.y
    gx, gy = _goal(plane, thing, step)
    far = min(thing.speed * plane.dt, math.sqrt((gx - x) ** 2 + (gy - y) ** 2))
    if far < 1e-9 and thing.kind != BOARD:
        return False
    way = math.atan2(gy - y, gx - x)
    look_at = _turned(plane, thing, way, step)
    for side in SIDESTEPS:
        nx, ny = x + far * math.cos(way + side), y + far * math.sin(way + side)
        for turn in range(2):
            a = look_at if turn == 0 else thing.a
            if thing.kind >= LEGS:
                a = look_at + side  # people look where they go
            if _fits(plane, i, nx, ny, a, step):
                thing.x, thing.y, thing.a = nx, ny, a
                return True
        if thing.kind <= BOX:
            break  # a chair stops
    if _fits(plane, i, x, y, look_at, step):
        thing.a = look_at
    thing.until = min(thing.until, step * plane.dt + 0.5)
    return False


@inner
def _gives_way(plane: Plane, i: int, step: int) -> bool:
    """Push thing ``i`` out of the robot's way; False where there is no room for it."""
    thing: Thing = plane.things[i]
    x, y, a, half = thing.x, thing.y, thing.a, thing.half
    rx, ry, _ = plane.path[step]
    spare = _spare_m(plane, i, x, y, a, step)
    if spare >= 0.0:
        return True
    along = (rx - x) * math.cos(a) + (ry - y) * math.sin(a)
    along = min(max(along, -half), half)
    way = math.atan2(y + along * math.sin(a) - ry, x + along * math.cos(a) - rx)
    for side in SIDESTEPS:
        for stretch in range(1, 4):
            far = stretch * (1e-3 - spare)
            nx, ny = x + far * math.cos(way + side), y + far * math.sin(way + side)
            if _fits(plane, i, nx, ny, a, step):
                thing.x, thing.y = nx, ny
                return True
    return False


@inner
def _one(plane: Plane, i: int, step: int) -> bool:
    """Let thing ``i`` live for a step; whether it moved by itself."""
    t = step * plane.dt
    thing: Thing = plane.things[i]
    hidden = thing.due > 0.5 and not _in_sight(plane, i, thing.x, thing.y, thing.a, step)
    there = _gives_way(plane, i, step)
    if (hidden or not there) and _elsewhere(plane, i, step):
        thing.due, thing.until = 0.0, -1.0
    if thing.kind >= BOARD:
        _look(plane, thing, step)
    if t >= thing.until:
        _decide(plane, thing, t)
    return thing.speed > 0.0 and _move(plane, i, step)


@njit
def live(
    plane: Plane, moved_every_s: float, every: int, poses: Float, moving: NDArray[np.bool_]
) -> None:
    """Fill ``poses`` (scans, m, 3) and ``moving`` (scans, m), a row each ``every`` steps."""
    next_s = moved_every_s
    for step in range(plane.path.shape[0]):
        due = step * plane.dt >= next_s
        if due:
            next_s += moved_every_s
        for i in range(plane.things.shape[0]):
            thing: Thing = plane.things[i]
            if due and thing.kind <= BOARD:
                thing.due = 1.0
            went = _one(plane, i, step)
            if step % every == 0:
                pose = poses[step // every, i]
                pose[0], pose[1], pose[2] = thing.x, thing.y, thing.a
                moving[step // every, i] = went
