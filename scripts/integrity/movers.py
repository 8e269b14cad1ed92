# SPDX-License-Identifier: Apache-2.0
"""How chairs, boards and people move in the plane: one kernel, in steps of at most 0.02 s.

Every thing is a segment with a radius: nothing overlaps a wall, a pillar or another thing. It keeps
``KEEP_M`` from the robot: what it comes too near to is pushed aside, and where there is no room,
stands elsewhere from then on. Each thing draws from a generator of its own.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from scripts.integrity.aims import draw, goal, look, plan, somewhere, turned
from scripts.integrity.crew import (
    BOARD,
    BOX,
    DUE,
    HALF,
    KEEP_M,
    LEGS,
    RADIUS,
    SPEED,
    UNTIL,
    Crew,
    Drive,
    Place,
)
from scripts.integrity.geometry import clear_of_building, point_to_segment2, sees, segments2
from slam._jit import inner, njit
from slam.frames import Float

SIDESTEPS = (0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6)  # rad, from the way it would go
TRIES = 40


@inner
def _free(crew: Crew, i: int, x: float, y: float, a: float, place: Place) -> bool:
    """Whether thing ``i`` may stand there."""
    half, radius = crew.traits[i, HALF], crew.traits[i, RADIUS]
    c, s = half * math.cos(a), half * math.sin(a)
    if not clear_of_building(x - c, y - s, x + c, y + s, radius, place.walls, place.pillars):
        return False
    for j in range(crew.at.shape[0]):
        u, v, b = crew.at[j, 0], crew.at[j, 1], crew.at[j, 2]
        other = crew.traits[j, HALF]
        reach = radius + crew.traits[j, RADIUS]
        far = reach + half + other
        if j == i or (u - x) * (u - x) + (v - y) * (v - y) > far * far:
            continue
        e, f = other * math.cos(b), other * math.sin(b)
        if segments2(x - c, y - s, x + c, y + s, u - e, v - f, u + e, v + f) < reach * reach:
            return False
    return True


@inner
def _spare_m(crew: Crew, i: int, x: float, y: float, a: float, robot: Float) -> float:
    """How much more than ``KEEP_M`` is between the robot and thing ``i`` there, m."""
    c, s = crew.traits[i, HALF] * math.cos(a), crew.traits[i, HALF] * math.sin(a)
    away2 = point_to_segment2(robot[0], robot[1], x - c, y - s, x + c, y + s)
    spare: float = math.sqrt(away2) - crew.traits[i, RADIUS] - KEEP_M
    return spare


@njit
def may_stand(crew: Crew, i: int, pose: Float, robot: Float, place: Place) -> bool:
    """Whether thing ``i`` is free at ``pose`` (3,), and not too near to the robot."""
    x, y, a = pose[0], pose[1], pose[2]
    return _spare_m(crew, i, x, y, a, robot) > 0.05 and _free(crew, i, x, y, a, place)


@inner
def _in_sight(crew: Crew, i: int, pose: Float, robot: Float, fov: float, place: Place) -> bool:
    """Whether the robot may see the middle or an end of thing ``i`` at ``pose``."""
    for k in range(-1, 2):
        px = pose[0] + k * crew.traits[i, HALF] * math.cos(pose[2])
        py = pose[1] + k * crew.traits[i, HALF] * math.sin(pose[2])
        off = math.atan2(py - robot[1], px - robot[0]) - robot[2]
        off = abs(math.atan2(math.sin(off), math.cos(off)))
        if off < 0.5 * fov + 0.2 and sees(robot[0], robot[1], px, py, place.walls):
            return True
    return False


@inner
def _elsewhere(crew: Crew, i: int, robot: Float, fov: float, place: Place) -> bool:
    """Put thing ``i`` where it is free and out of sight; whether a place was found."""
    pose = np.zeros(3)
    for _ in range(TRIES):
        pose[0], pose[1] = somewhere(crew, i, place)
        pose[2] = draw(crew, i) * 2.0 * math.pi
        if _spare_m(crew, i, pose[0], pose[1], pose[2], robot) < 0.3:
            continue
        if _in_sight(crew, i, pose, robot, fov, place):
            continue
        if _free(crew, i, pose[0], pose[1], pose[2], place):
            crew.at[i] = pose
            return True
    return False


@inner
def _move(crew: Crew, i: int, drive: Drive, step: int, place: Place) -> bool:
    """One step towards the goal, round what is in the way; whether it moved."""
    x, y, robot = crew.at[i, 0], crew.at[i, 1], drive.path[step]
    gx, gy = goal(crew, i, drive, step, place)
    far = min(crew.minds[i, SPEED] * drive.dt, math.sqrt((gx - x) ** 2 + (gy - y) ** 2))
    if far < 1e-9 and crew.kinds[i] != BOARD:
        return False
    way = math.atan2(gy - y, gx - x)
    look_at = turned(crew, i, way, drive, step)
    for side in SIDESTEPS:
        nx, ny = x + far * math.cos(way + side), y + far * math.sin(way + side)
        for turn in range(2):
            a = look_at if turn == 0 else crew.at[i, 2]
            if crew.kinds[i] >= LEGS:
                a = look_at + side  # people look where they go
            if _spare_m(crew, i, nx, ny, a, robot) >= 0.0 and _free(crew, i, nx, ny, a, place):
                crew.at[i, 0], crew.at[i, 1], crew.at[i, 2] = nx, ny, a
                return True
        if crew.kinds[i] <= BOX:
            break  # a chair stops
    if _spare_m(crew, i, x, y, look_at, robot) >= 0.0 and _free(crew, i, x, y, look_at, place):
        crew.at[i, 2] = look_at
    crew.minds[i, UNTIL] = min(crew.minds[i, UNTIL], step * drive.dt + 0.5)
    return False


@inner
def _gives_way(crew: Crew, i: int, robot: Float, place: Place) -> bool:
    """Push thing ``i`` out of the robot's way; False where there is no room for it."""
    x, y, a = crew.at[i, 0], crew.at[i, 1], crew.at[i, 2]
    spare = _spare_m(crew, i, x, y, a, robot)
    if spare >= 0.0:
        return True
    along = (robot[0] - x) * math.cos(a) + (robot[1] - y) * math.sin(a)
    along = min(max(along, -crew.traits[i, HALF]), crew.traits[i, HALF])
    way = math.atan2(y + along * math.sin(a) - robot[1], x + along * math.cos(a) - robot[0])
    for side in SIDESTEPS:
        for stretch in range(1, 4):
            far = stretch * (1e-3 - spare)
            nx, ny = x + far * math.cos(way + side), y + far * math.sin(way + side)
            if _spare_m(crew, i, nx, ny, a, robot) >= 0.0 and _free(crew, i, nx, ny, a, place):
                crew.at[i, 0], crew.at[i, 1] = nx, ny
                return True
    return False


@inner
def _one(crew: Crew, i: int, drive: Drive, step: int, place: Place) -> bool:
    """Let thing ``i`` live for a step; whether it moved by itself."""
    t, robot = step * drive.dt, drive.path[step]
    hidden = crew.minds[i, DUE] > 0.5 and not _in_sight(
        crew, i, crew.at[i], robot, drive.fov, place
    )
    there = _gives_way(crew, i, robot, place)
    if (hidden or not there) and _elsewhere(crew, i, robot, drive.fov, place):
        crew.minds[i, DUE], crew.minds[i, UNTIL] = 0.0, -1.0
    if crew.kinds[i] >= BOARD:
        look(crew, i, drive, step, place)
    if t >= crew.minds[i, UNTIL]:
        plan(crew, i, t, place)
    return crew.minds[i, SPEED] > 0.0 and _move(crew, i, drive, step, place)


@njit
def live(  # noqa: PLR0913 (kernel)
    crew: Crew,
    drive: Drive,
    place: Place,
    moved_every_s: float,
    every: int,
    poses: Float,
    moving: NDArray[np.bool_],
) -> None:
    """Fill ``poses`` (scans, m, 3) and ``moving`` (scans, m), a row each ``every`` steps."""
    next_s = moved_every_s
    for step in range(drive.path.shape[0]):
        due = step * drive.dt >= next_s
        if due:
            next_s += moved_every_s
        for i in range(crew.kinds.shape[0]):
            if due and crew.kinds[i] <= BOARD:
                crew.minds[i, DUE] = 1.0
            went = _one(crew, i, drive, step, place)
            if step % every == 0:
                poses[step // every, i] = crew.at[i]
                moving[step // every, i] = went
