# SPDX-License-Identifier: Apache-2.0
"""What things of the plane are about to do, and where they go for it."""

from __future__ import annotations

import math

import numpy as np

from scripts.integrity.crew import (
    BOARD,
    BOX,
    CRUMB,
    FAST,
    FOLLOWS,
    GX,
    GY,
    LEGS,
    NEAR,
    REST_S,
    RESTS,
    SLOW,
    SPEED,
    TURN,
    UNTIL,
    WIDE,
    WITH,
    Crew,
    Drive,
    Place,
)
from scripts.integrity.geometry import sees
from slam._jit import inner

SPIN_RADPS = 0.5  # of a board
WALK_MPS = 0.45  # about as fast as the robot drives
TRIES = 40
AHEAD_S = 0.5  # of the robot's trail, looked for at a time


@inner
def draw(crew: Crew, i: int) -> float:
    """In [0, 1): splitmix64 of thing ``i``."""
    crew.states[i] += np.uint64(0x9E3779B97F4A7C15)
    z = crew.states[i]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) / 9007199254740992.0


@inner
def somewhere(crew: Crew, i: int, place: Place) -> tuple[float, float]:
    """A drawn point of a drawn room, m."""
    k = int(draw(crew, i) * place.rooms.shape[0])
    x0, y0, x1, y1 = place.rooms[k]
    return x0 + draw(crew, i) * (x1 - x0), y0 + draw(crew, i) * (y1 - y0)


@inner
def plan(crew: Crew, i: int, t: float, place: Place) -> None:
    """What thing ``i`` does next: rest, slide, go somewhere in sight, or go with the robot."""
    mind, traits = crew.minds[i], crew.traits[i]
    mind[WITH] = 0.0
    mind[UNTIL] = t + 1.0 + 4.0 * draw(crew, i)
    mind[SPEED] = traits[SLOW] + (traits[FAST] - traits[SLOW]) * draw(crew, i)
    if draw(crew, i) < traits[RESTS]:
        mind[UNTIL] = t + traits[REST_S] * draw(crew, i)
        mind[SPEED] = 0.0
        return
    if crew.kinds[i] <= BOX:
        way = draw(crew, i) * 2.0 * math.pi
        mind[GX] = crew.at[i, 0] + 20.0 * math.cos(way)
        mind[GY] = crew.at[i, 1] + 20.0 * math.sin(way)
        mind[TURN] = 1.6 * (draw(crew, i) - 0.5)
        return
    mind[UNTIL] += 5.0
    mind[TURN] = 0.9 * (draw(crew, i) - 0.5)
    if mind[CRUMB] >= 0.0 and draw(crew, i) < traits[FOLLOWS]:
        mind[WITH] = 1.0
        mind[GX] = traits[NEAR] + (traits[WIDE] - traits[NEAR]) * draw(crew, i)
        mind[GY] = 2.0 * math.pi * draw(crew, i)
        return
    mind[GX], mind[GY] = crew.at[i, 0], crew.at[i, 1]
    for _ in range(TRIES):
        x, y = somewhere(crew, i, place)
        if sees(crew.at[i, 0], crew.at[i, 1], x, y, place.walls):
            mind[GX], mind[GY] = x, y
            return


@inner
def goal(crew: Crew, i: int, drive: Drive, step: int, place: Place) -> tuple[float, float]:
    """Where thing ``i`` goes now, m: beside the robot, or on its trail where that is hidden."""
    mind = crew.minds[i]
    if mind[WITH] < 0.5:
        return mind[GX], mind[GY]
    x, y, heading = drive.path[int(mind[CRUMB])]
    if mind[CRUMB] < step:
        return x, y
    if crew.kinds[i] == BOARD:
        bearing = mind[GY] + heading
        return x + mind[GX] * math.cos(bearing), y + mind[GX] * math.sin(bearing)
    along, across = mind[GX] * math.cos(mind[GY]), mind[GX] * math.sin(mind[GY])
    at = step + int(along / WALK_MPS / drive.dt)  # people know the way, also through a door
    x, y, heading = drive.path[min(max(at, 0), drive.path.shape[0] - 1)]
    for _ in range(3):
        gx, gy = x - across * math.sin(heading), y + across * math.cos(heading)
        if sees(x, y, gx, gy, place.walls):
            return gx, gy
        across *= 0.5
    return x, y


@inner
def look(crew: Crew, i: int, drive: Drive, step: int, place: Place) -> None:
    """Does thing ``i`` see the robot, or the next piece of its trail?"""
    x, y, last = crew.at[i, 0], crew.at[i, 1], crew.minds[i, CRUMB]
    if sees(x, y, drive.path[step, 0], drive.path[step, 1], place.walls):
        crew.minds[i, CRUMB] = step
    elif last >= 0.0:
        ahead = min(int(last) + math.ceil(AHEAD_S / drive.dt), step - 1)
        if sees(x, y, drive.path[ahead, 0], drive.path[ahead, 1], place.walls):
            crew.minds[i, CRUMB] = ahead


@inner
def turned(crew: Crew, i: int, way: float, drive: Drive, step: int) -> float:
    """Which way thing ``i`` looks after a step towards ``way``, rad."""
    a: float = crew.at[i, 2]
    mind = crew.minds[i]
    if crew.kinds[i] <= BOX:
        return a + float(mind[TURN]) * drive.dt
    if crew.kinds[i] >= LEGS:
        return way
    robot, wanted = drive.path[step], way  # a board: along its way, across the robot's sight
    if mind[CRUMB] >= step:
        wanted = math.atan2(crew.at[i, 1] - robot[1], crew.at[i, 0] - robot[0]) + mind[TURN]
        wanted += 0.5 * math.pi
    off = 0.5 * math.atan2(math.sin(2.0 * (wanted - a)), math.cos(2.0 * (wanted - a)))
    most = SPIN_RADPS * drive.dt
    return a + min(max(off, -most), most)
